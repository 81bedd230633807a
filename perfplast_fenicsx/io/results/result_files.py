"""Name the files and pictures in a result folder, and detect whether a run is alive.

``fields.vtkhdf.series`` lists the levels for ParaView; each level is a file in the folder
``fields``. Data that VTK does not support are outside the group that it reads.

List the pictures of a result folder, for the run, the report and the terminal.
An entry of :data:`FIGURES` contains the name of the function that draws. Drawing needs matplotlib
or VTK, and happens in a separate process. Functions are therefore given by name, and imported when
they draw. Installed packages add entries by entry points of the group :data:`GROUP`, each of which
refers to a :class:`Figure`.

Detect whether a run is alive: it holds a lock on its ``run.log`` until it ends.
The system releases the locks of a process when it ends, for whatever reason. Process numbers are
meaningless in another container.
"""

import fcntl
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO, Any, TypeAlias

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.extensions import loaded

NEWEST, BEFORE = "checkpoint.h5", "checkpoint_before.h5"
"""The checkpoints of the last and the previous level."""

SERIES, FIELDS, MECHANISM = "fields.vtkhdf.series", "fields", "mechanism.vtkhdf"
POINT_SERIES, MECHANISM_POINTS = "points.vtkhdf.series", "mechanism_points.vtkhdf"
"""Series of fields at the quadrature points."""

FLOW = "seepage.vtkhdf"
"""File of the seepage."""

EXPORTED = "export"
"""The folder with files for other programs."""

PROOF, LEAST = "bounds.h5", "least.h5"
"""Proof files of the bounds of the limit load, and of the limit load of the reversed loads."""

DIRECTIONS = "direction"
"""Prefix of the proof files of an envelope, before the angles (degrees)."""

KNOWN = "directions.json"
"""File of the proven directions of an envelope, for a continued run."""

STANDS, FALLS = "stands.h5", "falls.h5"
"""Proof files of a factor of safety: a stress with the strengths of the lower bound, and a velocity
with those of the upper bound."""
MESH = f"{FIELDS}/mesh.vtkhdf"

BESIDE = ("mesh.vtkhdf", MESH)
"""Files to which others link, with the names in these links."""

EARLIER = ("model.json", "fields.xdmf", "fields.h5", "mechanism.xdmf", "mechanism.h5")
"""Files of earlier versions, whose results this version does not read."""

GRID = "VTKHDF"
POINT_DATA, CELL_DATA, FIELD_DATA = f"{GRID}/PointData", f"{GRID}/CellData", f"{GRID}/FieldData"
POINTS, CONNECTIVITY, OFFSETS = f"{GRID}/Points", f"{GRID}/Connectivity", f"{GRID}/Offsets"
TYPES, BODY = f"{GRID}/Types", f"{CELL_DATA}/body"
SURFACES, SURFACE_TAGS = "perfplast/surfaces/facets", "perfplast/surfaces/tags"
"""Datasets of the named facets: the points at their vertices, and their tags."""


def level_file(number: int) -> str:
    """Return the file of a level, numbered from 1."""
    return f"{FIELDS}/level_{number:04}.vtkhdf"


def point_file(number: int) -> str:
    """Return the file of the quadrature points at a level, numbered from 1."""
    return f"{FIELDS}/points_{number:04}.vtkhdf"


NAMED = ("factor", "work", "driving_force", "bolt")
"""Columns of ``path.csv`` that are repeated for each name of stages or bolts."""


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


ENDED = "ended after"
"""Beginning of the last log line of a run that was not killed."""

BEGUN = "PETSc options:"
"""Beginning of a line that each run in the folder logs before it solves."""

INTERRUPTED = "interrupted by"
"""Beginning of the line that names the signal."""


def hold(file: IO[str]) -> bool:
    """Lock a file until it is closed; the lock is shared. Return False if locking fails."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH)
    except OSError:  # some network file systems have no locks
        return False
    return True


def is_held(path: Path) -> bool:
    """Return whether a process holds a lock on a file; False without the file or without locks."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
