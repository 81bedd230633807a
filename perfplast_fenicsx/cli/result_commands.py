"""Implement commands that read results: pictures, animations, reports, claims, exports."""

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.cli.follow import Follower
from perfplast_fenicsx.cli.mesh_command import files_in
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import on_rank0
from perfplast_fenicsx.export.exported_files import export
from perfplast_fenicsx.pictures.drawing_process import animate, plot
from perfplast_fenicsx.report.beside import write_beside
from perfplast_fenicsx.report.claim import claim_of
from perfplast_fenicsx.report.report_file import write_report


def follow(comm: MPI.Intracomm, results: str, output: str | None, wait: float) -> None:
    """Show and draw the results of a run on rank 0 until the run ends. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        results: Folder of the run.
        output: Folder for the pictures; by default the result folder.
        wait: Longest time to wait for the first results (s).

    Raises:
        InputError: If there are no results within this time.
    """
    terminal = Terminal(comm)

    def watch() -> None:
        try:
            Follower(Path(results), terminal, lambda: plot(results, output), wait).follow()
        finally:
            terminal.clear()

    on_rank0(comm, watch)


def draw(comm: MPI.Intracomm, command: str, results: str, output: str | None) -> list[str]:
    """Draw pictures or an animation of results on rank 0, and return their paths. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        command: "plot" or "animate".
        results: Result folder.
        output: Folder for the pictures, or file for the animation; None uses the result folder.

    Raises:
        InputError: If there are no results, or if nothing can be drawn.
    """
    terminal = Terminal(comm)
    told: list[str] = []

    def write() -> None:
        terminal.status("drawing")
        try:
            {"plot": plot, "animate": animate}[command](results, output, _heard(terminal, told))
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return [line for line in told if Path(line).is_file()]


def report(comm: MPI.Intracomm, folders: Sequence[str], output: str | None) -> list[str]:
    """Write a page about one run, or about two runs side by side, on rank 0. Collective.

    Returns:
        The path of the page, on rank 0.

    Args:
        comm: The ranks; all but rank 0 wait.
        folders: One or two result folders.
        output: Path of the page; None for a page in the first folder.

    Raises:
        InputError: If there are no results, or if there are more than two folders.
    """
    terminal = Terminal(comm)
    told: list[str] = []

    def write() -> None:
        terminal.status("writing the page")
        try:
            one = len(folders) == 1
            page = write_report(folders[0], output) if one else write_beside(folders, output)
            _heard(terminal, told)(str(page))
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return told


def claim(comm: MPI.Intracomm, folder: str) -> dict[str, Any]:
    """Print the bounds that the proof files of a run prove, on rank 0. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        folder: Folder of the results.

    Returns:
        On rank 0 the claim for the JSON answer, otherwise an empty dictionary.

    Raises:
        InputError: If there are no results, or if nothing is proven.
    """
    found = on_rank0(comm, lambda: claim_of(folder))
    if found is None:
        return {}
    Terminal(comm).say(found.in_words())
    return found.table()


def export_results(
    comm: MPI.Intracomm, results: str, output: str | None, kinds: set[str]
) -> list[str]:
    """Write fields and tables for other programs, on rank 0, and return their paths. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        results: Result folder.
        output: Folder for the files; None for a folder in the result folder.
        kinds: The kinds to write, "vtu" and "csv"; both if empty.

    Raises:
        InputError: If there are no results, if they cannot be read, or if the files cannot be
            written.
    """
    told: list[str] = []
    say = _heard(Terminal(comm), told)
    wanted = {kind: kind in kinds or not kinds for kind in ("vtu", "csv")}
    on_rank0(comm, lambda: export(results, output, **wanted, say=say))
    return told


def results_in(folder: str, command: str) -> dict[str, Any]:
    """Return the files and the results of a run or a sweep, for the JSON answer.

    Args:
        folder: Result folder.
        command: "run" or "sweep".
    """
    path = Path(folder)
    found: dict[str, Any] = {"folder": folder, "files": files_in(path)}
    if command == "sweep":
        table = path / "sweep.csv"
        lines = table.read_text(encoding="utf-8").splitlines() if table.is_file() else []
        return found | {"rows": list(csv.DictReader(lines))}
    summary = path / "summary.json"
    known = summary.is_file()
    return found | {"summary": json.loads(summary.read_text(encoding="utf-8")) if known else None}


def pictures_in(folder: str) -> list[str]:
    """Return the paths of the pictures in a folder."""
    return [str(path) for path in sorted(Path(folder).glob("*.png"))]


def _heard(terminal: Terminal, told: list[str]) -> Callable[[str], None]:
    """Return a function that prints a line and appends it to a list."""

    def say(line: str) -> None:
        told.append(line)
        terminal.say(line)

    return say
