"""Tables as CSV, for all programs that read it."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any


def csv_table(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return rows with the same keys as CSV: commas, points in numbers, all digits.

    What is not known is empty, and so is a table without rows.
    """
    if not rows:
        return b""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().encode()
