"""Run a case several times: for load combinations, with smaller elements, or in a sweep."""

import json
import logging
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace as with_
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace as replace_file
from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.run import Flags, OneOfSeveral, run, run_command
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0, raise_together
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import case_of, read_case
from perfplast_fenicsx.io.case.variations import Variation, grid, read_variation, varied
from perfplast_fenicsx.io.results.combination_table import TABLE, as_cells, write_table
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.body_bounds import clock
from perfplast_fenicsx.outcome_words import percent
from perfplast_fenicsx.report.report_file import Reporting, report_on
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.tables import csv_table

log = logging.getLogger(__name__)


def run_combined(
    comm: MPI.Intracomm, case: Case, output: str, terminal: Terminal, flags: Flags
) -> int:
    """Solve all combinations on the same mesh and contacts, each in its own folder. Collective.

    Args:
        comm: The ranks of the run.
        case: A case with combinations.
        output: Folder for the combinations' folders and ``combinations.csv``.
        terminal: The terminal that shows the run.
        flags: Options of the command. ``restart`` skips combinations that are already solved. With
            ``report``, the reports are written at the end, because each contains the table of all
            combinations.

    Returns:
        The largest exit status. If a case is interrupted, the run ends
        with the exit status of that case.

    Raises:
        InputError: As for :func:`run.run`, if possible before the first combination is solved.
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
        # reports are written below, with the table of all combinations
        each = with_(flags, restart=False, report=live)
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
        return [*combination_lines(rows), said]

    lines = on_rank0(comm, table) or []
    if flags.report:
        _pages(list(written.values()), terminal)
        terminal.say()
    for line in lines:
        terminal.say(line)
    return max(statuses)


def _forget(folder: Path) -> None:
    """Remove the table of combinations that an earlier run has written."""
    try:
        (folder / TABLE).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"'{folder / TABLE}' cannot be replaced ({error.strerror}); give another "
            "folder with -o."
        ) from error


def _pages(folders: Sequence[ResultFolder], terminal: Terminal) -> None:
    """Write the report of each combination. Collective."""
    for folder in folders:
        if (page := report_on(folder)) is not None:
            terminal.say(f"Report: {page}")


def combination_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines of the table of combinations, with bounds and verdicts."""
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
    """Return the table ``limit`` from ``summary.json``."""
    text = (Path(folder) / "summary.json").read_text(encoding="utf-8")
    found: dict[str, Any] | None = json.loads(text).get("limit")
    return found


def _is_done(folder: str, case: Case) -> bool:
    """Return whether a folder has the solution of a combination of the same case."""
    try:
        found = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(found.get("limit")) and found.get("case", {}).get("text") == case.text


NONE = "-"


def run_refined(
    comm: MPI.Intracomm, path: str, output: str, terminal: Terminal, flags: Flags
) -> int:
    """Solve a case twice, the second time with elements of half the size. Collective.

    The arguments are the same as for :func:`run.run`. The results of the finer mesh are in the
    subfolder ``half``.

    Returns:
        The larger of both exit statuses.

    Raises:
        InputError: As for :func:`run.run`, and for curved cells.
    """
    half = "half"  # subfolder for the results with half the element size
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
    """Return the lines of a table that compares two runs: sizes, cells, results, and time.

    Args:
        coarse: ``summary.json`` of the run with the given element size.
        fine: ``summary.json`` of the run with half the element size.
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
    """Return sentences on the change of the result by the finer mesh, and on the best bounds."""
    if limits[0] is None or limits[1] is None:
        ends = [[s for s in one["steps"] if s["converged"]] for one in (coarse, fine)]
        if not all(ends) or abs(ends[0][-1]["zeta"] - ends[1][-1]["zeta"]) > 1e-9:
            return ["The runs end at different load levels, so their results are not compared."]
        before, after = (end[-1]["max_displacement"] for end in ends)
        if not before:
            return ["All displacements are zero on the mesh as given."]
        change = f"{percent(abs(after / before - 1))} {_way(before, after)}"
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
        told.append(f"Both meshes fill the same body, so it collapses {both}{apart}.")
    return told


def _way(before: float, after: float) -> str:
    return "larger" if after > before else "smaller"


SWEEP_TABLE, PICTURE = "sweep.csv", "sweep.png"
"""Files of a sweep, in the folder that contains the folders of the cases."""


def sweep(
    comm: MPI.Intracomm,
    path: str,
    output: str,
    terminal: Terminal,
    vary: Sequence[str],
    flags: Flags,
) -> int:
    """Solve all cases of a sweep, each on all ranks in a separate folder. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        output: Folder for the cases' folders, :data:`SWEEP_TABLE` and :data:`PICTURE`.
        terminal: The terminal that shows the run.
        vary: Varied keys with their values, in the form that :func:`variations.read_variation`
            reads.
        flags: Options of the command. ``restart`` skips solved cases, and continues cases that are
            solved in part.

    Returns:
        The largest exit status. If a case is interrupted, the sweep
        ends with the exit status of that case.

    Raises:
        InputError: If the case, a value or the folder cannot be used; if possible before the first
            solve.
    """
    variations = [read_variation(text) for text in vary]
    cases = sweep_cases(comm, path, variations, flags.trust)
    folders = [str(Path(output) / f"{number:04d}") for number in range(1, len(cases) + 1)]
    pairs = list(zip(folders, cases, strict=True))
    states: list[str] = comm.bcast(on_rank0(comm, lambda: [_state(*pair) for pair in pairs]))
    if not flags.restart:
        for folder in folders:
            ResultFolder(comm, folder, flags.force)
        states = [ANEW] * len(states)
    command = ["perfplast", "sweep", path, "-o", output, *(f"--vary={text}" for text in vary)]
    statuses, rows = [SOLVED], list[dict[str, Any]]()
    for (folder, case), state, values in zip(pairs, states, grid(variations), strict=True):
        if state != DONE:
            terminal.say(f"{Path(folder).name}: {_in_words(values)}")
            begun = state == BEGUN
            replaced = (flags.force or flags.restart) and not begun
            each = with_(flags, force=replaced, restart=begun)
            one = OneOfSeveral(case, shlex.join(command))
            statuses.append(run(comm, path, folder, terminal, each, one))
            terminal.say()
            if statuses[-1] not in (SOLVED, NO_SOLUTION):
                return statuses[-1]
        rows.append(comm.bcast(on_rank0(comm, partial(_found, folder))) | values)
    keys = [variation.key for variation in variations]
    names = [*keys, *(name for name in rows[0] if name not in keys)]
    rows = [{name: row.get(name) for name in names} for row in rows]
    fault = on_rank0(comm, lambda: _written(rows, keys, cases[0].title, Path(output)))
    raise_together(comm, fault)
    for line in sweep_lines(rows):
        terminal.say(line)
    terminal.say(f"Results in {output}: {SWEEP_TABLE}, {PICTURE}, and a folder for each case.")
    return max(statuses)


def sweep_cases(
    comm: MPI.Intracomm, path: str, variations: Sequence[Variation], trust: bool
) -> list[Case]:
    """Return the cases of a sweep, after all checks that need no mesh. Collective.

    Raises:
        InputError: If a value is not valid, or if the case has combinations.
    """
    base = read_case(path, comm, trust)
    if base.combinations:
        raise InputError(
            f"{base.path.name}: a sweep solves one case for each value, but the case has "
            "combinations; remove them, or use perfplast run."
        )
    cases = []
    for values in grid(variations):
        try:
            case = case_of(base.path, base.text, varied(base.table, values))
        except InputError as error:
            raise InputError(f"with {_in_words(values)}: {error}") from error
        told = (_in_words(values),)
        cases.append(with_(case, trust=trust, remarks=(*case.remarks, *told)))
    return cases


def _in_words(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {_text(value)}" for key, value in values.items())


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


ANEW, BEGUN, DONE = "anew", "begun", "done"


def _state(folder: str, case: Case) -> str:
    """Return whether a folder has no results, a part or all of the results of a case."""
    try:
        found = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ANEW
    if case.remarks[-1] not in found.get("remarks", []):
        return ANEW
    steps = found.get("steps", [])
    if found.get("limit") or len(steps) == found.get("planned") or _failed(steps):
        return DONE
    return BEGUN if steps else ANEW


def _failed(steps: Sequence[Mapping[str, Any]]) -> bool:
    return bool(steps) and not steps[-1]["converged"]


def _found(folder: str) -> dict[str, Any]:
    """Return a case's row in the table of a sweep."""
    found = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    row: dict[str, Any] = {}
    limit = found.get("limit")
    if limit:
        known = limit.get("strength") or limit.get("body") or {}
        row = {"lower": known.get("lower"), "upper": known.get("upper")}
        row["estimate"] = None if limit.get("strength") else limit.get("estimate")
    solved = [step for step in found.get("steps", []) if step["converged"]]
    if solved:
        names = ("zeta", "alpha", "max_displacement", "plastic_fraction")
        row |= {name: solved[-1][name] for name in names}
    return row | {"folder": Path(folder).name}


def _written(
    rows: Sequence[Mapping[str, Any]], keys: Sequence[str], title: str, output: Path
) -> str | None:
    """Write the table and the picture; return a sentence if they cannot be written, else None."""
    try:
        replace_file(output / SWEEP_TABLE, csv_table(rows))
        # imported here, because Matplotlib would take a fifth of the start-up time of other
        # commands
        from perfplast_fenicsx.pictures.sweep_curve import save_sweep

        if not save_sweep(rows, keys, title, output / PICTURE):
            log.info("no %s: values of '%s' are not numbers", PICTURE, keys[0])
    except OSError as error:
        return f"'{output}' cannot be written ({error.strerror}); give another folder with -o."
    return None


def sweep_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines of a sweep's table."""
    cells = [list(rows[0])]
    cells += [["-" if v is None else _text(v) for v in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in cells
    ]
