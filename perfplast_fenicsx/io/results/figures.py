"""The pictures of a result folder: one list, which the run, the report and the terminal read.

An entry of :data:`FIGURES` names the function that draws. Drawing needs matplotlib or VTK, and goes
on in a process of its own; so functions are named here, and loaded where they draw. Installed
packages add entries by an entry point of the group :data:`GROUP`, which names a :class:`Figure`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.extensions import loaded

GROUP = "perfplast_fenicsx.figures"
"""Entry points of figures that other packages add."""

Drawing: TypeAlias = Callable[[Path], str | None]
"""Draws into a PNG file; returns a remark for the terminal, or None."""

OURS = "perfplast_fenicsx.pictures.result_figures"


@dataclass(frozen=True)
class Figure:
    """A picture of a run.

    Attributes:
        file: Its name in the result folder, of a PNG file.
        title: Heading of the figure.
        source: The function that decides and draws, as "package.module:function". Its argument is
            a :class:`~perfplast_fenicsx.pictures.result_reader.ResultReader`. It returns a
            :data:`Drawing`, a sentence that gives the reason for no picture, or None where the
            picture is of another kind of run.
        wide: Whether it has several parts side by side.
    """

    file: str
    title: str
    source: str
    wide: bool = False

    def of(self, reader: Any) -> Drawing | str | None:
        """Return what draws the results of a reader, why nothing can be drawn, or None.

        Raises:
            ImportError: If the source or what it needs is not installed.
        """
        module, function = self.source.split(":")
        found: Drawing | str | None = getattr(import_module(module), function)(reader)
        return found


FIGURES = (
    Figure("path.png", "The curve", f"{OURS}:path"),
    Figure("seepage.png", "Water in the ground", f"{OURS}:seepage"),
    Figure("fields.png", "The bodies at the last step", f"{OURS}:fields", wide=True),
    Figure("strength.png", "Strengths", f"{OURS}:strength"),
    Figure("envelope.png", "Pairs of loads", f"{OURS}:envelope"),
    Figure("shakedown.png", "Shakedown", f"{OURS}:shakedown"),
    Figure("mechanism.png", "The collapse mechanism", f"{OURS}:mechanism", wide=True),
)
"""Those of this package, in the order in which they are drawn."""


@cache
def figures() -> tuple[Figure, ...]:
    """Return :data:`FIGURES`, and those that installed packages add, by name of the entry point.

    Raises:
        InputError: If an entry point cannot be loaded, does not name a :class:`Figure`, or its file
            has another name than ``*.png`` or one that is taken.
    """
    found = {figure.file: figure for figure in FIGURES}
    for entry, figure in loaded(GROUP, "the figure '{name}' cannot be loaded"):
        file = figure.file if isinstance(figure, Figure) else ""
        if Path(file).name != file or Path(file).suffix != ".png" or file in found:
            raise InputError(
                f"the figure '{entry.name}' of {entry.value} must be a Figure whose file is a new"
                f" name *.png, not {figure!r}; mend or uninstall the package that adds it."
            )
        found[file] = figure
    return tuple(found.values())
