"""Define the content of ``summary.json``, and of ``path.csv`` for runs without load levels."""

import json
import math
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Summary:
    """The content of ``summary.json``; the attributes are the keys.

    Attributes:
        prescribed: Prescribed quantity of each level, "zeta" or "alpha".
        mesh: Numbers of cells, vertices and displacement unknowns (dofs).
        element_size: Mean over the cells of the longest edge of each cell (length).
        model: The ``kind`` of the model, and the ``axes`` of the components of ``reactions``.
            ``forces`` states whether forces and works are per unit of depth or refer to the full
            turn.
        given: Materials, supports, loads and other input (:func:`result_folder.given_table`).
        seepage: Discharges of water by surface, and iterations of SNES-VI; None if no water flows.
        loads: Force and moment of each load at ζ = 1 (:class:`resultants.LoadResultant`).
        case: The case ``file`` and its ``text``; empty for a Python program.
        report: The keys that the case gives under ``[report]``, such as ``project`` and ``author``.
        surroundings: ``versions`` by name, ``petsc_options`` (PETSc options in use), ``command``
            (the shell command without these options), and ``began`` (the start of the run).
        remarks: Remarks on the problem before it was solved, one sentence each.
        warnings: Warnings of the run.
        steps: For each level a table with the keys :data:`result_folder.STEP_KEYS`.
        limit: The limit load; None if the run did not search for one.
        timings: Wall time by activity (s).
        peak_memory_mb: Sum of the peak resident sizes of all ranks (MiB).
        units: The unit of each quantity (:meth:`units.Units.table`); empty for a Python program
            without a scene.
        planned: Number of levels in the whole run; None if the run chooses its levels.
    """

    title: str
    version: str
    method: str
    prescribed: str
    ranks: int
    mesh: dict[str, int]
    model: dict[str, str]
    given: dict[str, Any] = field(default_factory=dict)
    element_size: float = 0.0
    loads: list[dict[str, Any]] = field(default_factory=list)
    seepage: dict[str, Any] | None = None
    case: dict[str, str] = field(default_factory=dict)
    report: dict[str, str] = field(default_factory=dict)
    surroundings: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    limit: dict[str, Any] | None = None
    timings: dict[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0
    units: dict[str, str] = field(default_factory=dict)
    planned: int | None = None


def to_json(value: Any) -> str:
    """Return a value as JSON; numbers that are not finite become null."""

    def finite(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: finite(entry) for key, entry in item.items()}
        if isinstance(item, list | tuple):
            return [finite(entry) for entry in item]
        if isinstance(item, float):
            return item + 0.0 if math.isfinite(item) else None  # adding 0.0 turns -0.0 into 0.0
        return item

    return json.dumps(finite(value), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def limit_rows(summary: Summary) -> list[dict[str, Any]]:
    """Return the rows of ``path.csv`` for a run without levels; all rows have the same columns.

    Args:
        summary: The summary, whose ``limit`` was computed without levels.

    Returns:
        A row for each mesh, with its number ``mesh`` (1 to n) and its ``cells``. The row of the
        last mesh also has the limit load of this mesh, as ``estimate``, ``static`` and
        ``kinematic``. ``body_lower`` and ``body_upper`` are the best bounds so far, and ``seconds``
        the time since the start of the first mesh. Unknown values are empty. For a factor of
        safety: each ``factor`` with strict bounds, ``lower`` and ``upper``, of the load multiple
        that the bodies carry with strengths divided by this factor. Rows of its curve follow: each
        ``factor`` with the ``work`` of the loads, the largest ``displacement``, and the cost. For
        an envelope: each ``angle`` (degrees), with three loads also ``elevation``; the distance
        ``carried``, up to which the bodies carry all loads; and the distance ``not carried from``.
        For a shakedown diagram: each ``angle`` with the factors ``first`` and ``second`` up to
        which the bodies shake down, and the type of ``failure``.
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
