"""Write and read ``combinations.csv``: the results of all load combinations, the worst first."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.tables import csv_table

TABLE = "combinations.csv"
"""File of the table, in the folder that contains the folders of the combinations."""


Rows = list[dict[str, Any]]
"""Rows with the keys ``combination``, ``lower``, ``upper``, ``estimate`` and ``design load``."""


def write_table(folder: Path, found: Mapping[str, Mapping[str, Any] | None]) -> Rows:
    """Write ``combinations.csv``, with a row for each combination. Not collective.

    Args:
        folder: Folder that contains the folders of the combinations.
        found: Table ``limit`` from the ``summary.json`` of each combination, by name of the
            combination.

    Returns:
        The rows of the table.

    Raises:
        InputError: If the file cannot be written.
    """
    rows = sorted(map(_row, found, found.values()), key=_worst)
    try:
        replace(folder / TABLE, csv_table(rows))
    except OSError as error:
        raise InputError(
            f"'{TABLE}' cannot be written ({error.strerror}); free some space, or "
            "give another folder with -o."
        ) from error
    return rows


def read_table(folder: Path) -> Rows:
    """Return the rows of the table in a folder; an empty list if no table can be read."""
    try:
        with (folder / TABLE).open(encoding="utf-8", newline="") as file:
            rows: Rows = list(csv.DictReader(file))
        for row in rows:
            row |= {key: _number(row[key]) for key in ("lower", "upper", "estimate")}
            row |= {key: str(row[key]) for key in ("combination", "design load")}
    except (OSError, ValueError, KeyError, TypeError, csv.Error):
        return []
    return rows


def as_cells(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return the cells of the table as text: a row of headings, then a row per combination."""
    cells = [["combination", "carried", "collapses", "estimate", "design load"]]
    dash = "-"
    for row in rows:
        low, high, guess = row["lower"], row["upper"], row["estimate"]
        cells.append(
            [
                row["combination"],
                dash if low is None else rounded_down(low),
                dash if high is None else rounded_up(high),
                dash if guess is None else f"{guess:.5g}",
                row["design load"],
            ]
        )
    return cells


def _row(name: str, limit: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the row of a combination: strict bounds for the body, estimate, and verdict."""
    known = limit or {}
    body, design = known.get("body") or {}, known.get("design") or {}
    # bounds on the factor of safety, which must be at least 1
    if strength := known.get("strength"):
        body = design = strength
    low, high = design.get("lower"), design.get("upper")
    carried = low is not None and low >= 1
    refused = high is not None and high < 1
    return {
        "combination": name,
        "lower": body.get("lower"),
        "upper": body.get("upper"),
        "estimate": known.get("estimate"),
        "design load": "carried" if carried else "not carried" if refused else "not decided",
    }


def _worst(row: Mapping[str, Any]) -> float:
    """Return the sort key of a row: its smallest known number; rows without numbers come first."""
    known = [row[key] for key in ("lower", "estimate", "upper") if row[key] is not None]
    return min(known, default=float("-inf"))


def _number(text: str) -> float | None:
    return float(text) if text else None
