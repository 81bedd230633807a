"""Detect whether a run is alive: it holds a lock on its ``run.log`` until it ends.

The system releases the locks of a process when it ends, for whatever reason. Process numbers are
meaningless in another container.
"""

import fcntl
from pathlib import Path
from typing import IO

ENDED = "ended after"
"""Beginning of the last log line of a run that was not killed."""

BEGUN = "PETSc options:"
"""Beginning of a line that each run in the folder logs before it solves."""

INTERRUPTED = "interrupted by"
"""Beginning of the line that names the signal."""


def hold(file: IO[str]) -> bool:
    """Lock a file until it is closed; the lock is shared. Return False if locking fails."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH)
    except OSError:  # some network file systems have no locks
        return False
    return True


def is_held(path: Path) -> bool:
    """Return whether a process holds a lock on a file; False without the file or without locks."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
