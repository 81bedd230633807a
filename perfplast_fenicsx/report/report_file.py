"""``report.html`` of a result folder. Single-process, but for :func:`report_on`."""

import logging
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


def write_report(folder: str | Path, output: str | Path | None = None) -> Path:
    """Write a page about the results of a run, which may still be going on. Not collective.

    Args:
        folder: The results.
        output: The file; by default ``report.html`` in the folder.

    Returns:
        The file.

    Raises:
        InputError: If the folder has no results, they cannot be read, or the file not be written.
    """
    reader = ResultReader(folder)

    def page() -> str:
        check_summary(reader)
        return page_of(reader, view_data(reader))

    return write_page(output, reader.path / "report.html", page)


def report_on(folder: "ResultFolder") -> Path | None:
    """Write the report of a run into its folder. Collective.

    Where it cannot be written, rank 0 logs why, a fault with its traceback: a report is no reason
    to stop.

    Returns:
        The file, on every rank alike; None if there is none.
    """
    found = None
    if folder.comm.rank == 0:
        try:
            found = write_report(folder.path)
        except InputError as error:
            log.warning("%s", error)
        except Exception:  # the other ranks wait
            log.exception("no report was written, by a fault of the program")
    return folder.comm.bcast(found)
