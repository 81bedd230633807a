"""Files that are replaced as a whole, so that no crash and no full disk harms what is there."""

import os
from pathlib import Path


def replace(path: Path, content: bytes) -> None:
    """Write a file so that whoever reads it, after any crash, finds the old one or the new one.

    Raises:
        OSError: If the system refuses; the file is then as it was.
    """
    part = path.with_name(path.name + ".part")
    try:
        part.unlink(missing_ok=True)  # it may be a link that leads elsewhere
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        part.unlink(missing_ok=True)
        raise
    put(part, path)


def put(part: Path, path: Path, before: Path | None = None) -> None:
    """Give a complete file its name, for good; the older one of that name gets another, if given.

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
