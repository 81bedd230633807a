"""Write the folder of ``perfplast mesh``: mesh, picture, page, first case and its schema."""

import json
import os
import sys
import webbrowser
from pathlib import Path

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.case_schema import case_schema

CASE, MESH, PICTURE, PAGE = "case.toml", "case.msh", "bodies.png", "setup.html"
"""Files of the folder."""

SCHEMA = "case.schema.json"
"""Schema file next to the case, with which editors complete its keys and mark faults."""

SCHEMA_LINE = f"#:schema ./{SCHEMA}\n"
"""First line of the case, for editors."""


def check_free(output: Path, force: bool) -> None:
    """Refuse a folder that already has a mesh or a case.

    Raises:
        InputError: If it has one and ``force`` is False.
    """
    existing = [name for name in (CASE, MESH) if (output / name).exists()]
    if existing and not force:
        raise InputError(
            f"'{output}' already has a {existing[0]}; give --force to replace it, or another -o."
        )


def fill(output: Path, made: Path, case: str) -> None:
    """Write the folder.

    Args:
        output: The folder.
        made: Folder with the files made: mesh, picture and page, as far as they exist.
        case: The text of the case.

    Raises:
        InputError: If the folder cannot be written.
    """
    schema = json.dumps(case_schema(), indent=1, ensure_ascii=False)
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name in (MESH, PICTURE, PAGE):
            if (made / name).exists():
                replace(output / name, (made / name).read_bytes())
        replace(output / CASE, (SCHEMA_LINE + case).encode())
        replace(output / SCHEMA, f"{schema}\n".encode())
    except OSError as error:
        raise InputError(f"'{output}' cannot be written: {error.strerror or error}.") from error


def written(output: Path) -> str:
    """Return the files of the folder in words."""
    return ", ".join(name for name in (MESH, PICTURE, PAGE, CASE) if (output / name).exists())


def files_in(folder: Path) -> list[str]:
    """Return the names of the files in a folder."""
    return sorted(path.name for path in folder.iterdir() if path.is_file())


def address_of(folder: str) -> str:
    """Return the address of the page that sets up a case."""
    return (Path(folder) / PAGE).resolve().as_uri()


def open_page(folder: str) -> str:
    """Open the page that sets up a case in a browser, where there is a screen.

    Args:
        folder: The folder that ``perfplast mesh`` has written.

    Returns:
        The outcome in a sentence, with the address of the page.

    Raises:
        InputError: If the folder has no such page.
    """
    page = Path(folder) / PAGE
    if not page.is_file():
        raise InputError(
            f"the folder '{folder}' has no {PAGE}; perfplast mesh DRAWING -o {folder} writes it."
        )
    address = address_of(folder)
    screen = sys.platform == "darwin" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if screen and webbrowser.open(address):
        return f"Opened {address}"
    return f"Open this page in a browser: {address}"
