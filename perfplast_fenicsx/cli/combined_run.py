"""``perfplast run`` of a case with combinations of loads: each by itself, and a table of all."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.cli.run import NO_SOLUTION, SOLVED, run
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.rounding import rounded_down, rounded_up

TABLE = "combinations.csv"
"""File of the table, in the folder that has those of the combinations."""


def run_combined(
    comm: MPI.Intracomm,
    case: Case,
    output: str,
    force: bool,
    terminal: Terminal,
    log_level: str = "info",
    restart: bool = False,
    report: bool = False,
    trust: bool = False,
) -> int:
    """Solve each combination in a folder of its own, on one mesh and contact. Collective.

    Args:
        comm: The ranks.
        case: With combinations.
        output: Folder of their folders, and of :data:`TABLE`.
        force: Replace results in them.
        terminal: What is shown.
        log_level: As of :func:`run.run`.
        restart: Leave out those that are solved there.
        report: Write ``report.html`` of each.
        trust: Run a script that the mesh is made of.

    Returns:
        The largest exit status, or that of an interrupt, which ends all.

    Raises:
        InputError: As :func:`run.run`, before the first one is solved where that can be known.
    """
    path, statuses = str(case.path), [SOLVED]
    folders = {one.name: str(Path(output) / one.name) for one in case.combinations}
    done = on_rank0(comm, lambda: [n for n, where in folders.items() if _is_done(where, case)])
    solved: list[str] = comm.bcast(done) if restart else []
    for name, folder in folders.items():
        ResultFolder(comm, folder, force or name in solved)
    try:
        with Interrupts(comm) as interrupts:
            bodies = case.problem(comm)
            interrupts.check()
    except Interrupted as interrupted:
        return interrupted.status
    for one in case.combinations:
        if one.name in solved:
            terminal.say(f"'{one.name}' is solved already.")
            continue
        told = (path, folders[one.name], force, terminal, log_level, False, report, trust, False)
        statuses.append(run(comm, *told, case.combined(one), bodies))
        terminal.say()
        if statuses[-1] not in (SOLVED, NO_SOLUTION):
            return statuses[-1]

    def table() -> list[str]:
        found = {name: _limit(where) for name, where in folders.items()}
        rows = sorted(map(_row, found, found.values()), key=_worst)
        text = io.StringIO()
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        try:
            replace(Path(output) / TABLE, text.getvalue().encode())
        except OSError as error:
            raise InputError(f"'{TABLE}' cannot be written: {error.strerror}.") from error
        worst = rows[0]["combination"]
        words = ((found[worst] or {}).get("design") or {}).get("in_words", "")
        said = f"The worst of {len(rows)}: {words}" if words else f"The worst is '{worst}'."
        return [*shown(rows), said]

    for line in on_rank0(comm, table) or []:
        terminal.say(line)
    return max(statuses)


def shown(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The table as lines: combinations, bounds and verdicts."""
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
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if number in (0, len(widths) - 1) else cell.rjust(width)
            for number, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]


def _row(name: str, limit: Mapping[str, Any] | None) -> dict[str, Any]:
    """What is known of a combination: strict bounds of the bodies, and the estimate."""
    known = limit or {}
    body, design = known.get("body") or {}, known.get("design") or {}
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
    """What rows are sorted by: the smallest load that is known of, nothing known first."""
    known = [row[key] for key in ("lower", "estimate", "upper") if row[key] is not None]
    return min(known, default=float("-inf"))


def _limit(folder: str) -> dict[str, Any] | None:
    """What ``summary.json`` says of the limit load."""
    text = (Path(folder) / "summary.json").read_text(encoding="utf-8")
    found: dict[str, Any] | None = json.loads(text).get("limit")
    return found


def _is_done(folder: str, case: Case) -> bool:
    """Whether a combination of the same case is solved in a folder."""
    try:
        found = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(found.get("limit")) and found.get("case", {}).get("text") == case.text
