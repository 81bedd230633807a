"""Replace files as a whole, so that a crash or a full disk does not damage an existing file."""

import os
from pathlib import Path


def replace(path: Path, content: bytes) -> None:
    """Write a file so that a reader finds the old one or the new one, after any crash.

    Raises:
        OSError: If the system refuses; the old file is then unchanged.
    """
    part = path.with_name(path.name + ".part")
    try:
        part.unlink(missing_ok=True)  # it may be a link to another place
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        part.unlink(missing_ok=True)
        raise
    put(part, path)


def put(part: Path, path: Path, before: Path | None = None) -> None:
    """Give a complete file its final name; an older file of that name gets ``before``, if given.

    Raises:
        OSError: If the system refuses.
    """
    if before is not None and path.exists():
        path.replace(before)
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
