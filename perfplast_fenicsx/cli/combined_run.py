"""Run a case with combinations of loads for ``perfplast run``: each one, and a table of all."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.run import Flags, OneOfSeveral, run, run_command
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.results.combination_table import TABLE, as_cells, write_table
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.report.report_file import Reporting, report_on


def run_combined(
    comm: MPI.Intracomm, case: Case, output: str, terminal: Terminal, flags: Flags
) -> int:
    """Solve each combination in a folder of its own, on one mesh and contact. Collective.

    Args:
        comm: The ranks of the run.
        case: A case with combinations.
        output: Folder for the combinations' folders and ``combinations.csv``.
        terminal: The terminal that shows the run.
        flags: Options of the command. ``restart`` leaves out those that are solved there. Pages of
            ``report`` are written at the end, with the table of all.

    Returns:
        The largest exit status, or that of an interrupt, which ends the run.

    Raises:
        InputError: As :func:`run.run`, if possible before the first combination is solved.
    """
    path, statuses = str(case.path), [SOLVED]
    folders = {one.name: str(Path(output) / one.name) for one in case.combinations}
    done = on_rank0(comm, lambda: [n for n, where in folders.items() if _is_done(where, case)])
    solved: list[str] = comm.bcast(done) if flags.restart else []
    written = {
        name: ResultFolder(comm, folder, flags.force or name in solved)
        for name, folder in folders.items()
    }
    command = run_command(path, output, flags.report, flags.trust)
    try:
        with Interrupts(comm) as interrupts:
            bodies = case.problem(comm)
            interrupts.check()
    except Interrupted as interrupted:
        return interrupted.status
    on_rank0(comm, lambda: _forget(Path(output)))
    for one in case.combinations:
        if one.name in solved:
            terminal.say(f"'{one.name}' is already solved.")
            continue
        live = flags.report if flags.report is Reporting.LIVE else Reporting.NEVER
        each = replace(flags, restart=False, report=live)  # pages come last, with all of them
        prepared = OneOfSeveral(case.combined(one), command, bodies)
        statuses.append(run(comm, path, folders[one.name], terminal, each, prepared))
        terminal.say()
        if statuses[-1] not in (SOLVED, NO_SOLUTION):
            if flags.report:
                names = list(written)[: case.combinations.index(one) + 1]
                _pages([written[name] for name in names], terminal)
            return statuses[-1]

    def table() -> list[str]:
        found = {name: _limit(where) for name, where in folders.items()}
        rows = write_table(Path(output), found)
        worst = rows[0]["combination"]
        known = found[worst] or {}
        words = (known.get("design") or known.get("strength") or {}).get("in_words", "")
        said = f"The worst of {len(rows)}: {words}" if words else f"The worst is '{worst}'."
        return [*shown(rows), said]

    lines = on_rank0(comm, table) or []
    if flags.report:
        _pages(list(written.values()), terminal)
        terminal.say()
    for line in lines:
        terminal.say(line)
    return max(statuses)


def _forget(folder: Path) -> None:
    """Remove the table of an earlier run, which does not belong to this one."""
    try:
        (folder / TABLE).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"'{folder / TABLE}' cannot be replaced: {error.strerror}.") from error


def _pages(folders: Sequence[ResultFolder], terminal: Terminal) -> None:
    """Write the report of each combination. Collective."""
    for folder in folders:
        if (page := report_on(folder)) is not None:
            terminal.say(f"Report: {page}")


def shown(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the table as lines, with combinations, bounds and verdicts."""
    cells = as_cells(rows)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if number in (0, len(widths) - 1) else cell.rjust(width)
            for number, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]


def _limit(folder: str) -> dict[str, Any] | None:
    """Return the table of the limit load in ``summary.json``."""
    text = (Path(folder) / "summary.json").read_text(encoding="utf-8")
    found: dict[str, Any] | None = json.loads(text).get("limit")
    return found


def _is_done(folder: str, case: Case) -> bool:
    """Return whether a combination of the same case is solved in a folder."""
    try:
        found = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(found.get("limit")) and found.get("case", {}).get("text") == case.text
