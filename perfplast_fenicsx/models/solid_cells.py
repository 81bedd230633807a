"""Divide the solid elements of a model into simplices whose faces match.

A quadrilateral face is cut by the diagonal from its corner with the smallest number; both cells at
the face have this corner (J. Dompierre, P. Labbé, M.-G. Vallet, R. Camarero, How to subdivide
pyramids, prisms and hexahedra into tetrahedra, 8th Int. Meshing Roundtable, 1999). Each
cell is then divided into cones, whose apex is the corner of the cell with the smallest number, and
whose bases are the faces without this corner.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import Block, Shape


def divided(cells: Longs, shape: Shape) -> tuple[Longs, Longs]:
    """Return the simplices into which cells of one shape are divided, and the cell of each.

    Args:
        cells: Numbers of the corners, shape (num_cells, shape.corners).
        shape: Shape of all cells.

    Returns:
        The corners of the simplices in any orientation, shape (n, dim + 1), and the cell of each
        simplex, shape (n,).
    """
    count = np.arange(len(cells))
    if shape.corners == shape.dim + 1:
        return cells, count
    apex = np.argmin(cells, axis=1)
    parts, parents = [], []
    for corner in range(shape.corners):
        mine = count[apex == corner]
        for face in shape.faces:
            if corner in face or not len(mine):
                continue
            for piece, of in pieces(cells[mine][:, list(face)]):
                top = cells[mine[of], corner][:, None]
                parts.append(np.hstack([top, piece]))
                parents.append(mine[of])
    return np.concatenate(parts), np.concatenate(parents)


def pieces(faces: Longs) -> list[tuple[Longs, Longs]]:
    """Return the simplices of faces: quadrilaterals are cut in two, other faces remain.

    Args:
        faces: Corners of each face in order around it, shape (num_faces, 2, 3 or 4).

    Returns:
        Pairs of arrays. The first has the corners of simplices, shape (n, 2 or 3), and the second
        has the face of each simplex, shape (n,).
    """
    count = np.arange(len(faces))
    if faces.shape[1] < 4:
        return [(faces, count)]
    even = np.argmin(faces, axis=1) % 2 == 0
    found = []
    for chosen, cuts in ((even, ((0, 1, 2), (0, 2, 3))), (~even, ((0, 1, 3), (1, 2, 3)))):
        for cut in cuts:
            found.append((faces[chosen][:, list(cut)], count[chosen]))
    return found


BENT = 1e-3
"""Largest distance of a midside node from the midpoint of a straight edge, relative to the edge."""


@dataclass(frozen=True, eq=False)
class SolidCells:
    """The simplices into which the solid elements of a model are divided.

    Attributes:
        dim: 3, or 2 if there are only flat elements.
        blocks: The elements of this dimension.
        cells: Corners of the simplices, shape (m, dim + 1). All volumes are positive.
        parents: Number of the element of each simplex, shape (m,).
        remarks: Remarks on changed elements, each a sentence.
    """

    dim: int
    blocks: list[Block]
    cells: Longs
    parents: Longs
    remarks: list[str]


def solid_cells(points: Floats, blocks: Sequence[Block], left_out: Mapping[str, int]) -> SolidCells:
    """Return the simplices of the elements with the highest dimension.

    Args:
        points: Coordinates of the points, shape (n, 3).
        blocks: All elements.
        left_out: Number of elements of unsupported types, by type.

    Raises:
        InputError: If there are no solid elements, if flat elements do not lie in a plane
            z = constant, or if an element has no volume.
    """
    solids = [block for block in blocks if block.kind.shape.dim > 1 and len(block.nodes)]
    if not solids:
        left = ", ".join(left_out) or "none"
        raise InputError(
            f"there are no solid elements (unsupported types: {left}); give tetrahedra, hexahedra, "
            "wedges or pyramids (C3D4, C3D10, C3D8, C3D20, C3D6, C3D15), or triangles and "
            "quadrilaterals in the plane (CPE, CPS, CAX)."
        )
    dim = max(block.kind.shape.dim for block in solids)
    solids = [block for block in solids if block.kind.shape.dim == dim]
    if dim == 2:
        _check_plane(points, solids)
    cells, parents = [], []
    for block in solids:
        corners, of = divided(block.nodes[:, : block.kind.shape.corners], block.kind.shape)
        cells.append(corners)
        parents.append(block.first + of)
    every, parent = np.concatenate(cells), np.concatenate(parents)
    once = (np.diff(np.sort(every, axis=1), axis=1) > 0).all(axis=1)
    # other simplices are flat, for example in a hexahedron that is collapsed to a wedge
    elements = np.unique(parent)
    every, parent = every[once], parent[once]
    full = _with_volume(points, every, dim)
    if not (full.all() and len(every)):
        place = points[every[~full][0]].mean(axis=0) if len(every) else points[0]
        flat = np.unique(parent[~full]) if len(every) else elements
        raise InputError(
            f"the mesh contains degenerate elements (zero area or volume): {len(flat)} in all, one "
            f"of them at ({', '.join(f'{x:.6g}' for x in place)}); repair the mesh in the program "
            "that made it."
        )
    remarks = _told(points, solids, left_out, len(every))
    return SolidCells(dim, solids, _oriented(points, every, dim), parent, remarks)


def _check_plane(points: Floats, solids: Sequence[Block]) -> None:
    """Raise an error for flat elements that do not lie in a plane z = const."""
    used = points[np.unique(np.concatenate([block.nodes.ravel() for block in solids]))]
    height, size = np.ptp(used[:, 2]), np.linalg.norm(np.ptp(used, axis=0))
    if height > BENT * size:
        raise InputError(
            "there are no solid elements, only shells, which perfplast does not support; give "
            "solid elements, or a plane model in x and y."
        )


def _with_volume(points: Floats, cells: Longs, dim: int) -> np.ndarray:
    edges = points[cells[:, 1:], :dim] - points[cells[:, :1], :dim]
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    # a simplex has no volume if its volume, relative to the longest edge cubed (squared), is below
    # this
    flat = 1e-10
    return np.asarray(np.abs(np.linalg.det(edges)) > flat * longest**dim)


def _oriented(points: Floats, cells: Longs, dim: int) -> Longs:
    """Return the cells with corners in an order that gives positive volumes."""
    edges = points[cells[:, 1:], :dim] - points[cells[:, :1], :dim]
    turned = np.linalg.det(edges) < 0
    cells = cells.copy()
    cells[turned] = cells[turned][:, [1, 0, *range(2, dim + 1)]]
    return cells


def _told(
    points: Floats, solids: Sequence[Block], left_out: Mapping[str, int], count: int
) -> list[str]:
    """Return remarks on elements that are ignored, divided or curved."""
    remarks = [
        f"{number} lines of elements of the unsupported type {name} are ignored"
        for name, number in left_out.items()
    ]
    whole = sum(len(block.nodes) for block in solids)
    if count > whole:
        remarks.append(
            f"{whole} elements are divided into {count} triangles or tetrahedra whose faces match"
        )
    bent = 0
    for block in solids:
        shape = block.kind.shape
        if block.kind.nodes < shape.corners + len(shape.midsides):
            continue
        ends = points[block.nodes[:, np.array(shape.midsides)]]
        middles = points[block.nodes[:, shape.corners : shape.corners + len(shape.midsides)]]
        off = np.linalg.norm(middles - ends.mean(axis=2), axis=2)
        bent += int((off > BENT * np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)).sum())
    if bent:
        remarks.append(
            f"{bent} midside nodes do not lie at the middle of a straight edge: curved elements "
            "are replaced by straight ones"
        )
    return remarks
