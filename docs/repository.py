"""Include or link files outside ``docs/`` in pages of the site.

``<!-- include PATH -->`` is replaced with the file. A link to a file that is not a page of the site
becomes the path of the file. In the repository, the links work unchanged, and the mark is
invisible.
"""

import os
import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
INCLUDE = re.compile(r"<!-- include (\S+) -->")
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def with_local_links(text: str, page: Path, origin: Path) -> str:
    """Return a text from ``origin`` with links that are valid on ``page``.

    Args:
        text: Markdown.
        page: The page that contains the text.
        origin: The file of the text.
    """

    def link(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        if "://" in target or target.startswith("mailto:"):
            return match[0]
        path = (origin.parent / target).resolve()
        if path.is_relative_to(DOCS):
            return f"[{words}]({relative(path, page.parent)}{anchor})"
        name = path.relative_to(ROOT).as_posix()
        return f"`{name}`" if words.strip("`") in name else f"{words} (`{name}`)"

    return LINK.sub(link, text)


def relative(path: Path, folder: Path) -> str:
    """Return a path relative to a folder."""
    return Path(os.path.relpath(path, folder)).as_posix()


def _read(app: Any, docname: str, source: list[str]) -> None:
    page = DOCS / f"{docname}.md"

    def included(match: re.Match[str]) -> str:
        origin = ROOT / match[1]
        return with_local_links(origin.read_text(encoding="utf-8"), page, origin)

    text = with_local_links(source[0], page, page)
    source[0] = INCLUDE.sub(included, text)


def setup(app: Any) -> dict[str, bool]:
    """Connect the functions above to Sphinx, which calls this function."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
