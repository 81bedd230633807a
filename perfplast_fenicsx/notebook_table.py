"""Format tables of HTML, which a notebook shows for objects in the last line of a cell."""

from collections.abc import Sequence
from html import escape


def notebook_table(title: str, rows: Sequence[tuple[str, object]]) -> str:
    """Return a table of two columns as HTML.

    Args:
        title: Caption of the table.
        rows: Pairs of a name and a value; rows with an empty value are left out.
    """
    body = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(str(value))}</td></tr>"
        for name, value in rows
        if str(value)
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"
