"""Pages of the site in which the program puts a text in place of a mark."""

from collections.abc import Callable
from typing import Any


def replace_mark(app: Any, mark: str, make: Callable[[], str]) -> dict[str, bool]:
    """Let Sphinx put a text where a page has a mark.

    Args:
        app: Sphinx.
        mark: Stands in the page.
        make: Makes the text.

    Returns:
        What Sphinx wants to know of an extension.
    """

    def read(_: Any, docname: str, source: list[str]) -> None:
        if mark in source[0]:
            source[0] = source[0].replace(mark, make())

    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
