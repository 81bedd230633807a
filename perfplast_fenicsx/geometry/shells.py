"""Faces that share no edges, parted into shells that are closed, by the order of the file."""

from collections.abc import Sequence

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs


def closed_shells(faces: Sequence[int], near: float) -> list[list[int]]:
    """Return the faces of each body, where files list those of one body one after another.

    Where bodies touch, an edge belongs to faces of several, and sewing all of them makes no solid.
    So faces are taken in their order until each edge so far is one of two of them.

    Args:
        faces: In the order of the file.
        near: Edges whose lengths and centres differ by less are one.

    Returns:
        The shells that are closed; faces after the last of them belong to none.
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
    """Return its edges, without the seams at which a round face meets itself."""
    return [tag for _, tag in gmsh.model.getBoundary([(2, face)], combined=True, oriented=False)]


def _measures(edges: Sequence[int]) -> Floats:
    """Length and centre of edges, which do not depend on their parameters, shape (n, 4)."""
    occ = gmsh.model.occ
    found = [[occ.getMass(1, tag), *occ.getCenterOfMass(1, tag)] for tag in edges]
    return np.array(found).reshape(-1, 4)


def _numbered(measures: Floats, near: float) -> Longs:
    """Return the same number for what is the same."""
    pairs = cKDTree(measures).query_pairs(near, output_type="ndarray")
    shape = (len(measures), len(measures))
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
