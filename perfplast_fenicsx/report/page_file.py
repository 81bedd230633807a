"""Write the file of a page."""

from collections.abc import Callable
from pathlib import Path

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError


def write_page(output: str | Path | None, default: Path, make: Callable[[], str]) -> Path:
    """Write a page completely or not at all. Not collective.

    Args:
        output: The file.
        default: The default file.
        make: Function that makes the HTML; called only if the file is not a folder.

    Returns:
        The path of the file.

    Raises:
        InputError: If the file is a folder, or if it cannot be written.
    """
    target = Path(output) if output else default
    if target.is_dir():
        raise InputError(f"the report '{target}' is a folder; give -o the name of a file.")
    page = make()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        replace(target, page.encode())
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"'{target}' cannot be written ({reason}); give another -o.") from error
    return target
