"""Define the files and pictures of a result folder, and detect whether a run is in progress.

``fields.vtkhdf.series`` lists the levels for ParaView; each level is a file in the folder
``fields``. Data that VTK does not support are outside the group that VTK reads.

:data:`FIGURES` lists the pictures for the run, the report and the terminal. Each entry contains the
name of the function that draws: drawing needs Matplotlib or VTK and happens in a separate process,
which imports the function. Installed packages add figures by entry points in the group
:data:`GROUP`, each of which refers to a :class:`Figure`.

A run holds a lock on its ``run.log`` until it ends. The operating system releases the locks of a
process at its end, whatever the reason. A stored process number would not suffice, because it has
no meaning in another container.
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
"""The checkpoints of the last level and of the level before."""

SERIES, FIELDS, MECHANISM = "fields.vtkhdf.series", "fields", "mechanism.vtkhdf"
POINT_SERIES, MECHANISM_POINTS = "points.vtkhdf.series", "mechanism_points.vtkhdf"
"""Files with fields at the quadrature points: the list of levels, and the collapse mechanism."""

FLOW = "seepage.vtkhdf"
"""File with the seepage flow."""

EXPORTED = "export"
"""Folder with files for other programs."""

PROOF, LEAST = "bounds.h5", "least.h5"
"""Proof files: bounds on the limit load, and bounds on the limit load for reversed loads."""

DIRECTIONS = "direction"
"""Prefix in the names of an envelope's proof files; the angles (degrees) follow."""

KNOWN = "directions.json"
"""File with the proven directions of an envelope, which a continued run reads."""

STANDS, FALLS = "stands.h5", "falls.h5"
"""Proof files of a factor of safety: a stress field for strengths divided by the lower bound, and a
velocity field for strengths divided by the upper bound."""
MESH = f"{FIELDS}/mesh.vtkhdf"

BESIDE = ("mesh.vtkhdf", MESH)
"""The name in the links of field files to the mesh file, and the path of the mesh file."""

EARLIER = ("model.json", "fields.xdmf", "fields.h5", "mechanism.xdmf", "mechanism.h5")
"""Result files of earlier versions, which this version does not read."""

GRID = "VTKHDF"
POINT_DATA, CELL_DATA, FIELD_DATA = f"{GRID}/PointData", f"{GRID}/CellData", f"{GRID}/FieldData"
POINTS, CONNECTIVITY, OFFSETS = f"{GRID}/Points", f"{GRID}/Connectivity", f"{GRID}/Offsets"
TYPES, BODY = f"{GRID}/Types", f"{CELL_DATA}/body"
SURFACES, SURFACE_TAGS = "perfplast/surfaces/facets", "perfplast/surfaces/tags"
"""Datasets for the named facets: the points at the vertices of each facet, and its tag."""


def level_file(number: int) -> str:
    """Return the name of the field file of a level; numbers begin at 1."""
    return f"{FIELDS}/level_{number:04}.vtkhdf"


def point_file(number: int) -> str:
    """Return the name of a level's file for the quadrature points; numbers begin at 1."""
    return f"{FIELDS}/points_{number:04}.vtkhdf"


NAMED = ("factor", "work", "driving_force", "bolt")
"""Columns of ``path.csv`` that are repeated for each named load or motion of stages, or each
bolt."""


GROUP = "perfplast_fenicsx.figures"
"""Group of the entry points by which other packages add figures."""

Drawing: TypeAlias = Callable[[Path], str | None]
"""Function that draws a PNG file and returns a remark for the terminal, or None."""

OURS = "perfplast_fenicsx.pictures.result_figures"


@dataclass(frozen=True)
class Figure:
    """A picture of a run.

    Attributes:
        file: Name of the PNG file in the result folder.
        title: Title of the figure.
        source: The function for the picture, as "package.module:function". The function receives a
            :class:`~perfplast_fenicsx.pictures.result_reader.ResultReader`. It returns a
            :data:`Drawing`, or a string with the reason why there is no picture. None means that
            the picture does not apply to this kind of run.
        wide: Whether the picture has several panels side by side.
    """

    file: str
    title: str
    source: str
    wide: bool = False

    def of(self, reader: Any) -> Drawing | str | None:
        """Return the drawing function for results, the reason why there is no picture, or None.

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
"""The figures of this package, in the order in which they are drawn."""


@cache
def figures() -> tuple[Figure, ...]:
    """Return :data:`FIGURES`, then the figures of installed packages, sorted by entry points.

    Raises:
        InputError: If an entry point cannot be loaded, does not refer to a :class:`Figure`, or has
            a file name that is not ``*.png`` or is already used.
    """
    found = {figure.file: figure for figure in FIGURES}
    for entry, figure in loaded(GROUP, "the figure '{name}' cannot be loaded"):
        file = figure.file if isinstance(figure, Figure) else ""
        if Path(file).name != file or Path(file).suffix != ".png" or file in found:
            raise InputError(
                f"the figure '{entry.name}' of {entry.value} must be a Figure with an unused file "
                f"name *.png, not {figure!r}; repair or uninstall the package that adds the figure."
            )
        found[file] = figure
    return tuple(found.values())


ENDED = "ended after"
"""First words of the last line in the log of a run that was not killed."""

BEGUN = "PETSc options:"
"""First words of a line that each run in the folder logs before it solves."""

INTERRUPTED = "interrupted by"
"""First words of the line that names the signal which ended a run."""


def hold(file: IO[str]) -> bool:
    """Put a shared lock on a file until the file is closed; return False if locking fails."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH)
    except OSError:  # some network file systems do not support locks
        return False
    return True


def is_held(path: Path) -> bool:
    """Return whether a process holds a lock on a file; False if the file or locks are missing."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
