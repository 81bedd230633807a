"""Make the API pages: the modules of each folder ("room"), and the table of public names.

On a page of ``api/``, Sphinx replaces ``<!-- room NAME -->`` with the documentation of the modules
in the folder NAME of the package, and :data:`PUBLIC` with the table of public names.
"""

import inspect
import re
from pathlib import Path
from typing import Any

import perfplast_fenicsx

PACKAGE = Path(perfplast_fenicsx.__file__).parent
ROOM = re.compile(r"<!-- room ([\w.]+) -->")
PUBLIC = "<!-- the public names -->"


def modules(room: str) -> str:
    """Return sections with the documentation of the modules in a room, as MyST.

    Args:
        room: Dotted name of the folder below the package, or "ground" for the package itself.
    """
    parts = () if room == "ground" else tuple(room.split("."))
    text = ""
    for path in sorted(PACKAGE.joinpath(*parts).glob("[!_]*.py")):
        directive = f".. automodule:: {'.'.join((PACKAGE.name, *parts, path.stem))}"
        text += f"## {path.stem}\n\n```{{eval-rst}}\n{directive}\n```\n\n"
    return text


def public() -> str:
    """Return the table of the package's public names, as MyST."""
    text = "| name | |\n|---|---|\n"
    for name in sorted(set(dir(perfplast_fenicsx)) - {"__version__"}):
        thing = getattr(perfplast_fenicsx, name)
        first = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
        first = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", first.replace("``", "`"))
        first = first.replace(" Collective.", "").replace("|", "\\|")
        text += f"| {{py:obj}}`{name} <{thing.__module__}.{name}>` | {first} |\n"
    return text


def _read(app: Any, docname: str, source: list[str]) -> None:
    if docname.startswith("api/"):
        text = ROOM.sub(lambda mark: modules(mark[1]), source[0])
        source[0] = text.replace(PUBLIC, public())


def setup(app: Any) -> dict[str, bool]:
    """Insert the documentation at the marks of a page; Sphinx calls this function."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
