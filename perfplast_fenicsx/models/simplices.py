"""Divide hexahedra, wedges, pyramids and quadrilaterals into simplices whose faces match.

A quadrilateral face is cut by the diagonal from its corner with the smallest number, which both
cells at it share (J. Dompierre, P. Labbé, M.-G. Vallet, R. Camarero, How to subdivide pyramids,
prisms and hexahedra into tetrahedra, 8th Int. Meshing Roundtable, 1999). A cell is then divided
into the cones of its own smallest corner over the faces without this corner.
"""

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.models.element_types import Shape


def divided(cells: Longs, shape: Shape) -> tuple[Longs, Longs]:
    """Return simplices of cells of one shape.

    Args:
        cells: Corners by number, shape (num_cells, shape.corners).
        shape: Shape of all cells.

    Returns:
        Corners of the simplices, shape (n, dim + 1), in any orientation; the cell of each simplex,
        shape (n,).
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
    """Return faces as simplices: quadrilaterals are cut in two, others remain.

    Args:
        faces: Corners around each face, shape (num_faces, 2, 3 or 4).

    Returns:
        Pairs of corners, shape (n, 2 or 3), and the face of each simplex, shape (n,).
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
