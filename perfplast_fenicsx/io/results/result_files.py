"""Name the files in a result folder: checkpoints, and fields with their contents.

``fields.vtkhdf.series`` lists the levels for ParaView; each level is a file in the folder
``fields``. Data that VTK does not support are outside the group that it reads.
"""

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
