"""Whether a run is alive: as long as it is it holds a lock on its ``run.log``, which ends with it.

However a process ends, the system releases its locks. Process numbers would mean nothing in another
container.
"""

import fcntl
from pathlib import Path
from typing import IO

ENDED = "ended after"
"""How the last line of the log begins where the run was not killed."""

BEGUN = "PETSc options:"
"""How a line begins that each run in the folder has, before anything is solved."""

INTERRUPTED = "interrupted by"
"""How the line begins that names the signal."""


def hold(file: IO[str]) -> bool:
    """Lock a file until it is closed, together with others that do; False if it cannot be done."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH)
    except OSError:  # some file systems of networks have no locks
        return False
    return True


def is_held(path: Path) -> bool:
    """Return whether a process holds a file; False where there is none, or no locks."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
