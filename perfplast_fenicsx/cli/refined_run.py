"""Implement ``perfplast run --refine``: a case as it is and with half the element size."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.run import Flags, run
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import on_rank0
from perfplast_fenicsx.limit_analysis.body.next_step import clock
from perfplast_fenicsx.outcome_words import percent
from perfplast_fenicsx.rounding import rounded_down, rounded_up

NONE = "-"


def run_refined(
    comm: MPI.Intracomm, path: str, output: str, terminal: Terminal, flags: Flags
) -> int:
    """Solve a case twice, the second time with elements of half the size. Collective.

    The arguments are those of :func:`run.run`; the finer results are in a separate folder.

    Returns:
        The larger of both exit statuses.

    Raises:
        InputError: As :func:`run.run`, and for curved cells.
    """
    half = "half"  # subfolder for the results with half the size
    finer = str(Path(output) / half)
    statuses = []
    for where, halved in ((output, False), (finer, True)):
        statuses.append(run(comm, path, where, terminal, flags, finer=halved))
        if statuses[-1] not in (SOLVED, NO_SOLUTION):
            return statuses[-1]

    def table() -> list[str]:
        found = [
            json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
            for folder in (output, finer)
        ]
        return compared(found[0], found[1])

    for line in on_rank0(comm, table) or []:
        terminal.say(line)
    return max(statuses)


def compared(coarse: Mapping[str, Any], fine: Mapping[str, Any]) -> list[str]:
    """Return two runs side by side: sizes, cells, results, and time.

    Args:
        coarse: ``summary.json`` of the case as it is.
        fine: ``summary.json`` of the run with half the size.
    """
    limits = [summary["limit"] for summary in (coarse, fine)]
    row = _of_limit if all(limits) else _of_levels
    heads = ["", "size", "cells", "unknowns", *row(coarse), "time"]
    rows = [heads]
    for name, one in (("as given", coarse), ("half the size", fine)):
        mesh = one["mesh"]
        sizes = [f"{one['element_size']:.4g}", f"{mesh['cells']}", f"{mesh['dofs']}"]
        time = clock(one["timings"].get("total", 0.0))
        rows.append([name, *sizes, *row(one).values(), time])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True)).rstrip()
        for cells in rows
    ]
    return [*lines, *_told(limits, coarse, fine)]


def _of_limit(summary: Mapping[str, Any]) -> dict[str, str]:
    limit = summary["limit"]
    body = limit.get("body") or {}
    lower, upper, estimate = body.get("lower"), body.get("upper"), limit["estimate"]
    return {
        "carried": NONE if lower is None else rounded_down(lower),
        "collapsed": NONE if upper is None else rounded_up(upper),
        "estimate": NONE if estimate is None else f"{estimate:.5g}",
    }


def _of_levels(summary: Mapping[str, Any]) -> dict[str, str]:
    solved = [step for step in summary["steps"] if step["converged"]]
    if not solved:
        return dict.fromkeys(("zeta", "alpha", "displacement", "plastic"), NONE)
    last = solved[-1]
    return {
        "zeta": f"{last['zeta']:.6g}",
        "alpha": f"{last['alpha']:.6g}",
        "displacement": f"{last['max_displacement']:.5g}",
        "plastic": f"{last['plastic_fraction']:.1%}",
    }


def _told(
    limits: Sequence[Mapping[str, Any] | None], coarse: Mapping[str, Any], fine: Mapping[str, Any]
) -> list[str]:
    """Return how much the finer mesh changes the result, and the best bounds of both."""
    if limits[0] is None or limits[1] is None:
        ends = [[s for s in one["steps"] if s["converged"]] for one in (coarse, fine)]
        if not all(ends) or abs(ends[0][-1]["zeta"] - ends[1][-1]["zeta"]) > 1e-9:
            return ["The last levels differ, so that the results are not compared."]
        before, after = (end[-1]["max_displacement"] for end in ends)
        change = f"{percent(abs(after / before - 1))} {_way(before, after)}" if before else "none"
        return [f"The largest displacement is {change} with half the size."]
    told = []
    before, after = (limit["estimate"] for limit in limits if limit is not None)
    if before and after:
        change = f"{percent(abs(after / before - 1))} {_way(before, after)}"
        told.append(f"The estimate is {change} with half the size.")
    bodies = [(limit or {}).get("body") or {} for limit in limits]
    lower = max((b["lower"] for b in bodies if b.get("lower") is not None), default=None)
    upper = min((b["upper"] for b in bodies if b.get("upper") is not None), default=None)
    if lower is not None and upper is not None:
        both = f"between {rounded_down(lower)} and {rounded_up(upper)}"
        apart = f", {percent(upper / lower - 1)} apart" if lower > 0 else ""
        told.append(f"Both meshes fill the same body, which collapses {both}{apart}.")
    return told


def _way(before: float, after: float) -> str:
    return "larger" if after > before else "smaller"
