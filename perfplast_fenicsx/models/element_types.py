"""Define the element types of Abaqus and CalculiX: corners, faces and midside nodes."""

import re
from dataclasses import dataclass

from perfplast_fenicsx.arrays import Longs

Faces = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Shape:
    """The data of all elements with the same shape; indices start at 0.

    Attributes:
        dim: 3 for solids, 2 for flat elements, 1 for lines.
        corners: Number of vertices.
        faces: Corners of each face S1, S2, ..., in order around the face.
        midsides: Both ends of the edge of each midside node. The midside nodes of a quadratic
            element follow its corners.
    """

    dim: int
    corners: int
    faces: Faces
    midsides: tuple[tuple[int, int], ...]


TETRAHEDRON = Shape(
    3,
    4,
    ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
)
HEXAHEDRON = Shape(
    3,
    8,
    ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    (
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 0),
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
    ),
)
WEDGE = Shape(
    3,
    6,
    ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
)
PYRAMID = Shape(
    3,
    5,
    ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
)
TRIANGLE = Shape(2, 3, ((0, 1), (1, 2), (2, 0)), ((0, 1), (1, 2), (2, 0)))
QUADRILATERAL = Shape(2, 4, ((0, 1), (1, 2), (2, 3), (3, 0)), ((0, 1), (1, 2), (2, 3), (3, 0)))
LINE = Shape(1, 2, ((0,), (1,)), ((0, 1),))

SOLIDS = {
    4: TETRAHEDRON,
    10: TETRAHEDRON,
    5: PYRAMID,
    6: WEDGE,
    15: WEDGE,
    8: HEXAHEDRON,
    20: HEXAHEDRON,
}
FLAT = {3: TRIANGLE, 6: TRIANGLE, 4: QUADRILATERAL, 8: QUADRILATERAL}
"""Shapes of flat elements by number of nodes."""

PLANE = ("CPE", "CAX", "CPS", "S", "M3D", "SFM3D", "STRI", "R3D")
LINES = {"T2D2": 2, "T3D2": 2, "T2D3": 3, "T3D3": 3, "B21": 2, "B31": 2, "B22": 3, "B32": 3}
"""Number of nodes of line elements by name; ``PLANE`` has the prefixes of flat elements."""

STRAIN, AXIS, STRESS = "plane strain", "axisymmetry", "plane stress"


@dataclass(frozen=True)
class ElementType:
    """A type of elements: shape, number of nodes, and plane model.

    Attributes:
        shape: Shape of the elements.
        nodes: Number of nodes of each element, including midside nodes.
        model: Plane model, such as plane strain; "" for solids, surfaces and lines.
    """

    shape: Shape
    nodes: int
    model: str = ""


def element_type(name: str) -> ElementType | None:
    """Return the type with a name such as ``C3D10M`` or ``CPE4R``; None for unsupported types."""
    match = re.fullmatch(r"C3D(\d+)[A-Z]*", name)
    if match:
        nodes = int(match[1])
        return ElementType(SOLIDS[nodes], nodes) if nodes in SOLIDS else None
    models = {"CPE": STRAIN, "CAX": AXIS, "CPS": STRESS}  # plane models by prefix
    for kind in PLANE:
        match = re.fullmatch(rf"{kind}(\d)[A-Z]*\d?", name)
        if match and int(match[1]) in FLAT:
            nodes = int(match[1])
            return ElementType(FLAT[nodes], nodes, models.get(kind, ""))
    line = LINES.get(name.rstrip("RHO"))
    return ElementType(LINE, line) if line else None


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one type.

    Attributes:
        kind: Type of the elements.
        first: Number of the first element in the model; the other elements have the next numbers.
        nodes: Nodes of the elements as indices of points, shape (n, kind.nodes).
    """

    kind: ElementType
    first: int
    nodes: Longs
