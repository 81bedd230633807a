"""Insert generated text at the marks of pages."""

from collections.abc import Callable
from typing import Any


def replace_mark(app: Any, mark: str, make: Callable[[], str]) -> dict[str, bool]:
    """Connect a function with which Sphinx replaces a mark in a page by a text.

    Args:
        app: The Sphinx application.
        mark: The mark in the page.
        make: Function that returns the text.

    Returns:
        Metadata of a Sphinx extension.
    """

    def read(_: Any, docname: str, source: list[str]) -> None:
        if mark in source[0]:
            source[0] = source[0].replace(mark, make())

    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
