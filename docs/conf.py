"""Sphinx settings for the documentation site; `make docs` builds the site."""

import ast
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from perfplast_fenicsx import __version__  # noqa: E402

project = "perfplast_fenicsx"
author = "perfplast_fenicsx authors"
copyright = "perfplast_fenicsx authors"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "docs.mathml",
    "docs.case_reference",
    "docs.api_pages",
    "docs.command_reference",
    "docs.refusals",
    "docs.repository",
]
exclude_patterns = ["_build"]
# Markdown with formulas between dollar signs, headings as link targets, and definition lists.
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

# API pages: docstrings have Google style, and name types only where signatures do not.
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True, "show-inheritance": False}
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True

# No inventories are fetched, so the site builds without a network. Names from other packages are
# therefore not links.
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!perfplast_fenicsx\.)\w+(\.\w+)+"),
    ("py:.*", r"perfplast_fenicsx(\.\w+)+\._\w+"),  # private
    (
        "py:class",
        r"perfplast_fenicsx(\.\w+)+\.(T|First|Second|Function|AnyGround|Rubs)",
    ),  # type variables
    ("py:class", "DataFrame|Axes"),  # from pandas and matplotlib
    ("py:obj", r"perfplast_fenicsx\.problem\.judged\.state\.(Iteration|LevelReport)"),
]

html_theme = "furo"
html_title = f"perfplast_fenicsx {release}"
html_math_renderer = "perfplast_mathml"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = [("tribunal.js", {"defer": "defer"})]
html_copy_source = False
html_show_sphinx = False


SOURCES = sorted((ROOT / "perfplast_fenicsx").rglob("[!_]*.py"))
DOTTED = {path.stem: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in SOURCES}
HOMES = {
    statement.name: path.stem
    for path in SOURCES
    for statement in ast.parse(path.read_text(encoding="utf-8")).body
    if isinstance(statement, ast.ClassDef)
}
MODULES = "|".join(sorted(DOTTED, key=len, reverse=True))
SHORT = re.compile(rf":(class|mod|func|data|meth):`({MODULES})((?:\.\w+)*)`")
CLASS = re.compile(r":class:`([A-Z]\w*)`")


def _as_written(
    app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]
) -> None:
    """Change the lines of a docstring so that Sphinx interprets them as intended.

    Bars are literal, as in |J|. The first colon in the docstring of a constant does not end a type.
    References to modules may omit the package, and references to classes may omit the module.
    """

    def home(match: re.Match[str]) -> str:
        known = match[1] in HOMES
        return f":class:`{HOMES[match[1]]}.{match[1]}`" if known else match[0]

    for number, line in enumerate(lines):
        text = SHORT.sub(lambda m: f":{m[1]}:`~{DOTTED[m[2]]}{m[3]}`", CLASS.sub(home, line))
        parts = text.split("``")
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[number] = "``".join(parts)
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]  # a comment


def _parsable(
    app: Any, what: str, name: str, obj: object, options: Any, signature: str | None, returned: str
) -> tuple[str | None, str]:
    """Return a signature that is valid Python: three dots replace a default from a factory.

    Python shows such a default as ``<factory>``, in which Sphinx 9 mistakes parts of types for
    names.
    """
    return signature and signature.replace("<factory>", "..."), returned


def setup(app: Any) -> None:
    """Connect the functions above to Sphinx, which calls this function before napoleon."""
    app.connect("autodoc-process-docstring", _as_written, priority=400)
    app.connect("autodoc-process-signature", _parsable)
