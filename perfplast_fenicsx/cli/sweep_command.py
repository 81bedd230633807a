"""Implement ``perfplast sweep``: a case with several values in turn, and a table of all."""

import json
import logging
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace as with_
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.run import Flags, OneOfSeveral, run
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0, raise_together
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import case_of, read_case
from perfplast_fenicsx.io.case.variations import Variation, grid, read_variation, varied
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.tables import csv_table

TABLE, PICTURE = "sweep.csv", "sweep.png"
"""Files of a sweep, in the folder that contains those of the cases."""

log = logging.getLogger(__name__)


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
        output: Folder for the cases' folders, :data:`TABLE` and :data:`PICTURE`.
        terminal: The terminal that shows the run.
        vary: Varied keys and their values, as :func:`variations.read_variation` takes them.
        flags: Options of the command. ``restart`` leaves out what is solved there, and goes on with
            what is begun.

    Returns:
        The largest exit status, or that of an interrupt, which ends the sweep.

    Raises:
        InputError: If the case, a value or the folder cannot be used, if possible before any
            solution.
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
    for line in shown(rows):
        terminal.say(line)
    terminal.say(f"Results in {output}: {TABLE}, {PICTURE}, and a folder for each case.")
    return max(statuses)


def sweep_cases(
    comm: MPI.Intracomm, path: str, variations: Sequence[Variation], trust: bool
) -> list[Case]:
    """Return the cases of a sweep, each checked as far as possible without its mesh. Collective.

    Raises:
        InputError: If a value is not valid, or if the case has combinations.
    """
    base = read_case(path, comm, trust)
    if base.combinations:
        raise InputError(
            f"{base.path.name}: the case has combinations, which have a table of their "
            "own; remove them, or vary nothing."
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
    """Return how far a case is solved in a folder: not at all, in part, or completely."""
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
    """Return the row of a case in the table of results."""
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
    """Write table and picture; return the error of the system, if there is one."""
    try:
        replace(output / TABLE, csv_table(rows))
        # importing Matplotlib takes a fifth of the start-up time of other commands
        from perfplast_fenicsx.pictures.sweep_curve import save_sweep

        if not save_sweep(rows, keys, title, output / PICTURE):
            log.info("no %s: values of '%s' are not numbers", PICTURE, keys[0])
    except OSError as error:
        return f"'{output}' cannot be written: {error.strerror}."
    return None


def shown(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the table as lines."""
    cells = [list(rows[0])]
    cells += [["-" if v is None else _text(v) for v in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in cells
    ]
