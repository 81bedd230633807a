"""Write tables as CSV, and as HTML that a notebook shows."""

import csv
import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any


def csv_table(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return rows with the same keys as CSV: commas, points in numbers, all digits.

    Unknown values are empty. A table without rows gives an empty file.
    """
    if not rows:
        return b""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().encode()


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
