"""Write tables as CSV, and show them in a notebook as HTML, data frames and plots.

pandas and matplotlib are optional; they are imported when a data frame or a plot is requested.
"""

import csv
import io
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from perfplast_fenicsx.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

Row = dict[str, Any]

COLOURS = {"lower": "#3b6ea5", "upper": "#d62020"}
"""Colours of lower and upper bounds in plots."""


def csv_table(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return ``rows``, which have equal keys, as CSV: commas, decimal points, all digits.

    Unknown values are empty. A table without rows gives an empty file.
    """
    if not rows:
        return b""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().encode()


def notebook_table(title: str, rows: Sequence[tuple[str, object]]) -> str:
    """Return a table of two columns as HTML.

    Args:
        title: Caption of the table.
        rows: Pairs of a name and a value; rows with an empty value are omitted.
    """
    body = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(str(value))}</td></tr>"
        for name, value in rows
        if str(value)
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def data_frame(rows: Sequence[Mapping[str, Any]]) -> "DataFrame":
    """Return ``rows``, which have equal keys, as a data frame.

    Raises:
        InputError: If pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise InputError(
            "data frames need pandas, which is not installed (pip install pandas); rows() of a"
            " result and `perfplast export DIR --csv` give the same numbers without it."
        ) from error
    return DataFrame(list(rows))


class NotebookResult(ABC):
    """A result that a notebook shows as a table, and that converts to a data frame or a plot."""

    @abstractmethod
    def rows(self) -> list[Row]:
        """Return the numbers of the result as rows with the same keys."""

    @abstractmethod
    def in_words(self) -> str:
        """Return the result in sentences."""

    @abstractmethod
    def draw_into(self, axes: Any) -> None:
        """Draw the result.

        Args:
            axes: Axes of matplotlib, without a title.
        """

    @property
    def dimensions(self) -> int:
        """Return the number of dimensions of the axes for the plot."""
        return 2

    def to_dataframe(self) -> "DataFrame":
        """Return :meth:`rows` as a data frame.

        Raises:
            InputError: If pandas is not installed.
        """
        return data_frame(self.rows())

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the result, and return the matplotlib axes.

        Collective if the result has a mesh; then each rank has the whole plot.

        Args:
            axes: Axes to draw into; axes of a new figure by default.

        Raises:
            InputError: If matplotlib is not installed, or if the result has no such plot.
        """
        if axes is None:
            try:
                from matplotlib import pyplot
            except ImportError as error:
                raise InputError(
                    "plot needs matplotlib, which is not installed (pip install matplotlib); "
                    "rows() returns the numbers."
                ) from error
            projection = "3d" if self.dimensions == 3 else None
            _, axes = pyplot.subplots(subplot_kw={"projection": projection}, layout="constrained")
        self.draw_into(axes)
        return axes

    def _repr_html_(self) -> str:
        """Return the result as HTML: a table, and sentences."""
        rows = self.rows()
        columns = list(rows[0]) if rows else []
        head = "".join(f"<th>{escape(name)}</th>" for name in columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(_cell(row[name]))}</td>" for name in columns) + "</tr>"
            for row in rows
        )
        words = escape(self.in_words())
        name = escape(type(self).__name__)
        return f"<table><caption>{name}</caption><tr>{head}</tr>{body}</table><p>{words}</p>"


def _cell(value: object) -> str:
    """Return a value with few digits; empty if it is unknown."""
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
