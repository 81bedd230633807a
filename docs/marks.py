"""Insert generated text at the marks of pages."""

from collections.abc import Callable
from typing import Any


def replace_mark(app: Any, mark: str, make: Callable[[], str]) -> dict[str, bool]:
    """Let Sphinx replace a mark in a page with a text.

    Args:
        app: Sphinx.
        mark: The mark in the page.
        make: Function that makes the text.

    Returns:
        Metadata of a Sphinx extension.
    """

    def read(_: Any, docname: str, source: list[str]) -> None:
        if mark in source[0]:
            source[0] = source[0].replace(mark, make())

    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
