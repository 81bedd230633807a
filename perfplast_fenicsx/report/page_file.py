"""Write the HTML file of a page."""

from collections.abc import Callable
from pathlib import Path

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError


def write_page(output: str | Path | None, default: Path, make: Callable[[], str]) -> Path:
    """Write a page completely, or leave the old file unchanged. Not collective.

    Args:
        output: The file.
        default: The file, if ``output`` is missing.
        make: Function that returns the HTML; called only if the path is not a folder.

    Returns:
        The path of the file.

    Raises:
        InputError: If the path is a folder, or if the file cannot be written.
    """
    target = Path(output) if output else default
    if target.is_dir():
        raise InputError(
            f"the report cannot be written to '{target}', which is a folder; give the "
            "name of a file with -o."
        )
    page = make()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        replace(target, page.encode())
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"'{target}' cannot be written ({reason}); give another path with -o."
        ) from error
    return target
