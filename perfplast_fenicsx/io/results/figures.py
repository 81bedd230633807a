"""List the pictures of a result folder, for the run, the report and the terminal.

An entry of :data:`FIGURES` contains the name of the function that draws. Drawing needs matplotlib
or VTK, and happens in a separate process. Functions are therefore given by name, and imported when
they draw. Installed packages add entries by entry points of the group :data:`GROUP`, each of which
refers to a :class:`Figure`.
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
"""Group of entry points for figures of other packages."""

Drawing: TypeAlias = Callable[[Path], str | None]
"""Function that draws into a PNG file and returns a remark for the terminal, or None."""

OURS = "perfplast_fenicsx.pictures.result_figures"


@dataclass(frozen=True)
class Figure:
    """A picture of a run.

    Attributes:
        file: Name of its PNG file in the result folder.
        title: Title of the figure.
        source: The function that decides and draws, as "package.module:function". Its argument is a
            :class:`~perfplast_fenicsx.pictures.result_reader.ResultReader`. It returns a
            :data:`Drawing`, the reason why there is no picture, or None if the picture does not
            apply to this kind of run.
        wide: Whether it has several panels side by side.
    """

    file: str
    title: str
    source: str
    wide: bool = False

    def of(self, reader: Any) -> Drawing | str | None:
        """Return a drawing function for the results of a reader, why there is none, or None.

        Raises:
            ImportError: If the source or its dependencies are not installed.
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
"""Figures of this package, in the order of drawing."""


@cache
def figures() -> tuple[Figure, ...]:
    """Return :data:`FIGURES` and those of installed packages, ordered by entry point name.

    Raises:
        InputError: If an entry point cannot be loaded, does not refer to a :class:`Figure`, or has
            a file name that is not ``*.png`` or already used.
    """
    found = {figure.file: figure for figure in FIGURES}
    for entry, figure in loaded(GROUP, "the figure '{name}' cannot be loaded"):
        file = figure.file if isinstance(figure, Figure) else ""
        if Path(file).name != file or Path(file).suffix != ".png" or file in found:
            raise InputError(
                f"the figure '{entry.name}' of {entry.value} must be a Figure whose file "
                f"is a new name *.png, not {figure!r}; repair or uninstall the package "
                "that adds it."
            )
        found[file] = figure
    return tuple(found.values())
