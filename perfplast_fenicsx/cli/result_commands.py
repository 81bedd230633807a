"""Implement commands that read results: pictures, animations, reports, files for other programs."""

import json
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.cli.follow import Follower
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import on_rank0
from perfplast_fenicsx.export.exported_files import export
from perfplast_fenicsx.pictures.drawing_process import animate, plot
from perfplast_fenicsx.report.beside import write_beside
from perfplast_fenicsx.report.claim import claim_of
from perfplast_fenicsx.report.report_file import write_report


def follow(comm: MPI.Intracomm, results: str, output: str | None, wait: float) -> int:
    """Show and draw the results of a run until it ends, on rank 0. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        results: Folder of the run.
        output: Folder for the pictures; by default the result folder.
        wait: Longest time to wait for first results (s).

    Raises:
        InputError: If there are no results in that time.
    """
    terminal = Terminal(comm)

    def watch() -> None:
        try:
            Follower(Path(results), terminal, lambda: plot(results, output), wait).follow()
        finally:
            terminal.clear()

    on_rank0(comm, watch)
    return SOLVED


def draw(comm: MPI.Intracomm, command: str, results: str, output: str | None) -> int:
    """Draw pictures or an animation of results on rank 0. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        command: "plot" or "animate".
        results: Result folder.
        output: Folder for the pictures, or file for the animation; by default in the result folder.

    Raises:
        InputError: If there are no results, or if nothing can be drawn.
    """
    terminal = Terminal(comm)

    def write() -> None:
        terminal.status("drawing")
        try:
            {"plot": plot, "animate": animate}[command](results, output, terminal.say)
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return SOLVED


def report(comm: MPI.Intracomm, folders: Sequence[str], output: str | None) -> int:
    """Write a page about a run, or about two side by side, on rank 0. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        folders: One or two result folders.
        output: The page; by default in the first folder.

    Raises:
        InputError: If there are no results, or not one or two folders.
    """
    terminal = Terminal(comm)

    def write() -> None:
        terminal.status("writing the page")
        try:
            one = len(folders) == 1
            page = write_report(folders[0], output) if one else write_beside(folders, output)
            terminal.say(str(page))
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return SOLVED


def claim(comm: MPI.Intracomm, folder: str, as_json: bool) -> int:
    """Print what the proof files of a run prove, on rank 0. Collective.

    Args:
        comm: The ranks; the others wait.
        folder: Folder of the results.
        as_json: Print JSON instead of sentences.

    Raises:
        InputError: If there are no results, or nothing is proven.
    """

    def words() -> str:
        found = claim_of(folder)
        text = json.dumps(found.table(), indent=2, ensure_ascii=False, allow_nan=False)
        return text if as_json else found.in_words()

    Terminal(comm).say(on_rank0(comm, words) or "")
    return SOLVED


def export_results(comm: MPI.Intracomm, results: str, output: str | None, kinds: set[str]) -> int:
    """Write fields and tables for other programs, on rank 0. Collective.

    Args:
        comm: The ranks; all but rank 0 wait.
        results: Result folder.
        output: Folder for the files; by default in the result folder.
        kinds: The kinds to write, "vtu" and "csv"; both if empty.

    Raises:
        InputError: If there are no results, if they cannot be read, or if the files cannot be
            written.
    """
    terminal = Terminal(comm)
    wanted = {kind: kind in kinds or not kinds for kind in ("vtu", "csv")}
    on_rank0(comm, lambda: export(results, output, **wanted, say=terminal.say))
    return SOLVED
