"""Show a run in a notebook: its tables as data frames, its report as the output of a cell."""

from html import escape
from pathlib import Path
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.export.result_rows import bound_rows, level_rows, resultant_rows
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.page import page_of
from perfplast_fenicsx.report.stored_summary import check_summary
from perfplast_fenicsx.report.view_data import view_data
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row, data_frame


class RunResults(NotebookResult):
    """The stored results of a run, which may still be active. Runs in a single process.

    A notebook shows the report, with bodies that can be rotated, if the last line of a cell is::

        RunResults("results/blocks")

    Examples:
        >>> found = RunResults("results/blocks")
        >>> found.levels.plot("alpha", "zeta")
        >>> found.bounds[["cells", "body_lower", "body_upper"]]
        >>> found.resultants.query("name == 'support bottom'")
    """

    def __init__(self, folder: str | Path) -> None:
        """Check that the folder has results.

        Args:
            folder: DIR of ``perfplast run``, or the folder of a
                :class:`~result_folder.ResultFolder`.

        Raises:
            InputError: If the folder has no results.
        """
        self.folder = Path(folder)
        self._reader  # noqa: B018 (raises an InputError if there are no results)

    def __repr__(self) -> str:
        return f"RunResults({str(self.folder)!r}: {self._reader.scene.title}; {self.verdict})"

    def _repr_html_(self) -> str:
        """Return the report in an ``iframe`` that allows only the scripts of the report."""
        reader = self._reader
        check_summary(reader)
        page = escape(page_of(reader, view_data(reader)))
        # Height of the report in a notebook (pixels): enough for the verdict and the bodies below
        # it.
        height = 760
        return (
            f'<iframe title="{escape(reader.scene.title or "A run")}" sandbox="allow-scripts"'
            f' style="width:100%;height:{height}px;border:0" srcdoc="{page}"></iframe>'
        )

    def in_words(self) -> str:
        """Return the outcome so far."""
        return self.verdict

    def rows(self) -> list[Row]:
        """Return the rows of ``levels``; if there are no levels, the rows of ``bounds``."""
        return level_rows(self._reader) or bound_rows(self._reader)

    def draw_into(self, axes: Any) -> None:
        """Draw the load factor over the work of the loads, or the bounds over the cells.

        Raises:
            InputError: If the run has neither levels nor bounds.
        """
        rows = self.rows()
        columns = set(rows[0]) if rows else set()
        if "alpha" in columns:
            solved = [row for row in rows if row["converged"]]
            axes.plot([row["alpha"] for row in solved], [row["zeta"] for row in solved], "o-")
            axes.set(xlabel="work of the growing loads, alpha", ylabel="load factor, zeta")
        elif "body_lower" in columns:
            for side, colour in COLOURS.items():
                known = [row for row in rows if row[f"body_{side}"] is not None]
                places = [row["cells"] for row in known], [row[f"body_{side}"] for row in known]
                axes.plot(*places, "o-", color=colour, label=f"{side} bound")
            axes.set(xscale="log", xlabel="cells", ylabel="load factor")
            axes.legend()
        else:
            raise InputError(
                f"'{self.folder}' has neither levels nor bounds on a load factor; perfplast plot"
                " DIR draws the pictures of this run."
            )
        axes.grid(alpha=0.3)

    @property
    def verdict(self) -> str:
        """Return the outcome of the run so far, in words."""
        summary = self._reader.summary
        if summary.limit and (found := summary.limit.get("verdict")):
            return str(found)
        solved = sum(bool(step["converged"]) for step in summary.steps)
        return f"{solved} of {len(summary.steps)} levels solved."

    @property
    def levels(self) -> Any:
        """Return a data frame with a row for each level (:func:`~result_rows.level_rows`)."""
        return data_frame(level_rows(self._reader))

    @property
    def resultants(self) -> Any:
        """Return a data frame of forces and moments (:func:`~result_rows.resultant_rows`)."""
        return data_frame(resultant_rows(self._reader))

    @property
    def bounds(self) -> Any:
        """Return a data frame of meshes with their bounds (:func:`~result_rows.bound_rows`)."""
        return data_frame(bound_rows(self._reader))

    @property
    def _reader(self) -> ResultReader:
        """Return a new reader at each access, because the run may still write results."""
        return ResultReader(self.folder)
