"""Replace files as a whole, so a crash or a full disk cannot damage an existing file."""

import os
from pathlib import Path


def replace(path: Path, content: bytes) -> None:
    """Write ``content`` to a file; after a crash, the file has either its old or its new content.

    Raises:
        OSError: If a file operation fails. If the new file could not be written, the old file is
            unchanged.
    """
    part = path.with_name(path.name + ".part")
    try:
        part.unlink(missing_ok=True)  # an existing file may be a link to another place
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        part.unlink(missing_ok=True)
        raise
    put(part, path)


def put(part: Path, path: Path, before: Path | None = None) -> None:
    """Rename the complete file ``part`` to ``path``, and first an old ``path`` to ``before``.

    Without ``before``, the old file is replaced.

    Raises:
        OSError: If a file operation fails.
    """
    if before is not None and path.exists():
        path.replace(before)
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
