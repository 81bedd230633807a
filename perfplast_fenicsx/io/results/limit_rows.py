"""Return rows of ``path.csv`` for a limit load without levels: one for each mesh."""

from typing import Any

from perfplast_fenicsx.io.results.summary import Summary


def limit_rows(summary: Summary) -> list[dict[str, Any]]:
    """Return the rows, all with the same columns; unknown values are empty.

    Args:
        summary: Summary with a ``limit`` that was computed without levels.

    Returns:
        A row for each mesh, with its number ``mesh`` (1 to n) and its ``cells``; ``estimate``,
        ``static`` and ``kinematic`` of its limit load, for the last mesh only; ``body_lower`` and
        ``body_upper``, the best bounds of the bodies so far; ``seconds`` since the start of the
        first. For a factor of safety: each ``factor`` with strict bounds, ``lower`` and ``upper``,
        of how many times the loads are carried; then the points of its curve, each ``factor`` with
        the ``work`` of the loads, the largest ``displacement``, and the cost. For an envelope: each
        ``angle`` (degrees), with three numbers also ``elevation``, with the distance ``carried`` up
        to which all is carried, and ``not carried from``. For a shakedown diagram: each ``angle``
        with the factors ``first`` and ``second`` to which bodies shake down, and its ``failure``.
    """
    limit = summary.limit or {}
    if envelope := limit.get("envelope"):
        return [dict(row) for row in envelope["rows"]]
    if diagram := (limit.get("shakedown") or {}).get("diagram"):
        return [dict(row) for row in diagram]
    if strength := limit.get("strength"):
        points = (strength.get("path") or {}).get("points", [])
        rows = [dict(row) for row in (*strength["curve"], *points)]
        keys = dict.fromkeys(key for row in rows for key in row)
        return [dict.fromkeys(keys) | row for row in rows]
    body = limit.get("body") or {}
    lower = upper = None
    rows = []
    for one in body.get("meshes", []):
        lower = max((a for a in (lower, one["lower"]) if a is not None), default=None)
        upper = min((a for a in (upper, one["upper"]) if a is not None), default=None)
        rows.append(_row(one["number"], one["cells"], lower, upper, one["seconds"]))
    if not rows:
        rows = [_row(1, summary.mesh["cells"], None, None, summary.timings.get("solve"))]
    rows[-1] |= {
        "estimate": limit["estimate"],
        "static": limit["lower"],
        "kinematic": limit["upper"],
        "body_lower": body.get("lower"),
        "body_upper": body.get("upper"),
    }
    return rows


def _row(
    mesh: int, cells: int, lower: float | None, upper: float | None, seconds: float | None
) -> dict[str, Any]:
    sides = dict.fromkeys(("estimate", "static", "kinematic"))
    bounds = {"body_lower": lower, "body_upper": upper, "seconds": seconds}
    return {"mesh": mesh, "cells": cells} | sides | bounds
