"""Write ``report.html`` into a result folder, at the end of a run or repeatedly during it."""

import logging
import time
from enum import StrEnum
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.page import page_of
from perfplast_fenicsx.report.page_file import write_page
from perfplast_fenicsx.report.stored_summary import check_summary
from perfplast_fenicsx.report.view_data import view_data

if TYPE_CHECKING:
    from perfplast_fenicsx.io.results.result_folder import ResultFolder


log = logging.getLogger(__name__)

MARK = "<!-- what the run is doing -->"


class Reporting(StrEnum):
    """When a run writes its report: never, at its end, or repeatedly."""

    NEVER = ""
    AT_END = "--report"
    LIVE = "--watch"


def write_report(folder: str | Path, output: str | Path | None = None) -> Path:
    """Write a page on the results of a run, which may still be in progress. Not collective.

    Args:
        folder: The result folder.
        output: The file; by default ``report.html`` in the folder.

    Returns:
        The path of the file.

    Raises:
        InputError: If the folder has no results, if they cannot be read, or if the file cannot be
            written.
    """
    reader = ResultReader(folder)
    return write_page(output, reader.path / "report.html", lambda: _checked_page(reader))


def _checked_page(reader: ResultReader, running: str = "") -> str:
    """Return the HTML of a report, after checking the results."""
    check_summary(reader)
    return page_of(reader, view_data(reader), running)


def report_on(folder: "ResultFolder") -> Path | None:
    """Write the report of a run into its folder. Collective.

    If the report cannot be written, rank 0 logs the reason, and the traceback if it is a fault of
    the program. The run does not stop.

    Returns:
        The path of the file, the same on every rank; None if the report could not be written.
    """
    found = None
    if folder.comm.rank == 0:
        try:
            found = write_report(folder.path)
        except InputError as error:
            log.warning("%s", error)
        except Exception:  # rank 0 must go on, because the other ranks wait for it
            log.exception("no report was written, because of a fault of the program")
    return folder.comm.bcast(found)


class LiveReport:
    """A report that a run updates until it ends.

    The page shows the stored results, and the activity of the run at the time of writing. It makes
    no statement on later times, so it remains true if the run is killed.
    """

    def __init__(self, folder: "ResultFolder") -> None:
        """Store the folder of the run; write nothing yet."""
        self._folder = folder
        self._page, self._words, self._results_at, self._written = "", "", "", 0.0

    def refresh(self) -> None:
        """Write the page from the results that are stored now. Collective."""
        if self._folder.comm.rank == 0:
            try:
                self._page = _checked_page(ResultReader(self._folder.path), MARK)
                self._results_at = _clock()
                self._write()
            except InputError as error:
                log.warning("%s", error)
        self._folder.comm.Barrier()

    def say(self, words: str) -> None:
        """Put the current activity on the page. Not collective: only rank 0 writes the page.

        Args:
            words: The activity, in the words of the terminal's live line.
        """
        period = 5.0  # shortest time between two pages (s), since a page may have 20 MB
        self._words = words
        if self._page and time.monotonic() - self._written > period:
            try:
                self._write()
            except InputError as error:
                self._page = ""
                log.warning("%s The page is no longer updated.", error)

    def _write(self) -> None:
        words = escape(self._words[:1].upper() + self._words[1:])
        doing = f" {words}." if words else ""
        state = (
            '<section id="running" aria-label="State of the run"><p>'
            f"<strong>At {_clock()} this run was in progress.</strong>{doing} The results below are"
            f" from {self._results_at}. Reload the page to update it.</p></section>"
        )
        target = self._folder.path / "report.html"
        write_page(None, target, lambda: self._page.replace(MARK, state, 1))
        self._written = time.monotonic()


def _clock() -> str:
    """Return the current date and time of day."""
    return time.strftime("%Y-%m-%d %H:%M:%S")
