"""Write tables as CSV, for any program that reads it."""

import csv
import io
from collections.abc import Mapping, Sequence
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
