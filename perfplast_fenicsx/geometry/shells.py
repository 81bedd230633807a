"""Group faces without common edges into closed shells, by the order in the file."""

from collections.abc import Sequence

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs


def closed_shells(faces: Sequence[int], near: float) -> list[list[int]]:
    """Return the faces of each body, if the file lists them body by body.

    Where bodies touch, an edge belongs to faces of several bodies, and sewing all faces gives no
    solid. So the function takes faces in order until each edge so far belongs to two of them.

    Args:
        faces: Faces in the order of the file.
        near: Edges are equal if their lengths and centres differ by less.

    Returns:
        The closed shells; faces after the last shell belong to none.
    """
    edges = [_edges(face) for face in faces]
    numbers = _numbered(np.concatenate([_measures(own) for own in edges]), near)
    ends = np.cumsum([len(own) for own in edges])
    shells, shell, open_edges = list[list[int]](), list[int](), set[int]()
    for face, own in zip(faces, np.split(numbers, ends[:-1]), strict=True):
        shell.append(face)
        for edge in map(int, own):
            open_edges ^= {edge}
        if not open_edges:
            shells.append(shell)
            shell = []
    return shells


def _edges(face: int) -> list[int]:
    """Return its edges, without the seams at which a closed face meets itself."""
    return [tag for _, tag in gmsh.model.getBoundary([(2, face)], combined=True, oriented=False)]


def _measures(edges: Sequence[int]) -> Floats:
    """Return length and centre of edges, independent of their parameters, shape (n, 4)."""
    occ = gmsh.model.occ
    found = [[occ.getMass(1, tag), *occ.getCenterOfMass(1, tag)] for tag in edges]
    return np.array(found).reshape(-1, 4)


def _numbered(measures: Floats, near: float) -> Longs:
    """Return the same number for equal edges."""
    pairs = cKDTree(measures).query_pairs(near, output_type="ndarray")
    shape = (len(measures), len(measures))
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
