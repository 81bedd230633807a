"""API pages: which module is documented where, and the table of the package's public names.

On a page of ``api/``, ``<!-- modules NAME ... -->`` stands for the documentation of these modules,
``<!-- modules * -->`` for that of all that no page names, and :data:`PUBLIC` for the public names.
"""

import inspect
import re
from pathlib import Path
from typing import Any

import perfplast_fenicsx

PAGES = Path(__file__).parent / "api"
PACKAGE = Path(perfplast_fenicsx.__file__).parent
MODULES = re.compile(r"<!-- modules ([\w* ]+) -->")
PUBLIC = "<!-- the public names -->"


def named() -> list[str]:
    """The modules that pages name."""
    pages = (page.read_text(encoding="utf-8") for page in sorted(PAGES.glob("*.md")))
    return [name for page in pages for names in MODULES.findall(page) for name in names.split()]


def remaining() -> list[str]:
    """The modules that no page names."""
    modules = {path.stem for path in PACKAGE.glob("*.py")}
    return sorted(modules - set(named()) - {"__init__"})


def modules(names: list[str]) -> str:
    """Sections with the documentation of modules, as MyST."""
    text = ""
    for name in names:
        directive = f".. automodule:: perfplast_fenicsx.{name}"
        text += f"## {name}\n\n```{{eval-rst}}\n{directive}\n```\n\n"
    return text


def public() -> str:
    """The table of the package's public names, as MyST."""
    text = "| name | |\n|---|---|\n"
    for name in perfplast_fenicsx.__all__:
        thing = getattr(perfplast_fenicsx, name)
        first = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
        first = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", first.replace("``", "`"))
        first = first.replace(" Collective.", "").replace("|", "\\|")
        text += f"| {{py:obj}}`{name} <{thing.__module__}.{name}>` | {first} |\n"
    return text


def _read(app: Any, docname: str, source: list[str]) -> None:
    def content(mark: re.Match[str]) -> str:
        return modules(remaining() if mark[1] == "*" else mark[1].split())

    if docname.startswith("api/"):
        source[0] = MODULES.sub(content, source[0]).replace(PUBLIC, public())


def setup(app: Any) -> dict[str, bool]:
    """Put the documentation in where a page has a mark; called by Sphinx."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
