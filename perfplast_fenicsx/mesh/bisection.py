"""Cut simplices, given as arrays, at the midpoints of marked edges.

The algorithm cuts a simplex at its marked edge with the highest order, then both parts at their
remaining marked edges, and so on. Two simplices cut their common face in the same way, because the
edges of the face have the same order in both. The parts therefore conform for any marked edges, in
2D and in 3D. If edges are ordered by length, and the longest edge of every cut triangle is marked,
the algorithm is the skeleton-based refinement of Plaza and Carey,
doi:10.1016/S0168-9274(99)00022-7.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import basix
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Ints, Longs

SIMPLEX = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}


@dataclass(frozen=True)
class Parts:
    """The parts of cut simplices.

    Attributes:
        cells: Vertices of the parts, shape (num_parts, dim + 1).
        facets: Tags of the facets of the parts, shape (num_parts, dim + 1); column k has the facet
            opposite vertex k.
        parents: Index of the simplex from which each part comes, shape (num_parts,).
    """

    cells: Longs
    facets: Ints
    parents: Longs


def edges_of_simplex(dim: int) -> Longs:
    """Return the local vertices of a simplex's edges in DOLFINx's order, shape (num_edges, 2)."""
    return np.array(basix.topology(SIMPLEX[dim])[1])


def edges_of_faces(dim: int) -> Longs:
    """Return the local edges of each triangular face of a simplex, shape (num_faces, 3)."""
    edges = edges_of_simplex(dim)
    faces = np.array(basix.topology(SIMPLEX[dim])[2])
    return np.array([np.flatnonzero(np.isin(edges, face).all(axis=1)) for face in faces])


def cut(cells: Longs, facets: Ints, middles: Longs, order: Longs, inner: int) -> Parts:
    """Return the parts of simplices that are cut at marked edges.

    Args:
        cells: Vertices of each simplex, shape (n, dim + 1).
        facets: Tags of the facets of each simplex, shape (n, dim + 1); column k has the facet
            opposite vertex k.
        middles: Index of the new vertex on each edge of each simplex, −1 for unmarked edges, shape
            (n, num_edges).
        order: Order of the edges, shape (n, num_edges); the edge with the largest number is cut
            first. The numbers differ within a simplex, and an edge has the same number in all
            simplices that share it.
        inner: Tag of the facets between parts of one simplex.
    """
    size = cells.shape[1]
    one, other = edges_of_simplex(size - 1).T
    middle = np.full((len(cells), size, size), -1, dtype=np.int64)
    middle[:, one, other] = middle[:, other, one] = middles
    rank = np.zeros_like(middle)
    rank[:, one, other] = rank[:, other, one] = order
    left = _Pieces(cells, facets, np.arange(len(cells)), middle, rank)
    done: list[_Pieces] = []
    while True:
        whole = ~np.any(left.middle >= 0, axis=(1, 2))
        done.append(left.rows(whole))
        if whole.all():
            break
        left = left.rows(~whole)
        last = np.where(left.middle >= 0, left.rank, -1).reshape(len(left.cells), -1).argmax(axis=1)
        i, j = np.divmod(last, size)
        halves = (left.half(i, j, inner), left.half(j, i, inner))
        left = _joined(halves)
    parts = _joined(done)
    return Parts(parts.cells, parts.facets, parts.parents)


@dataclass(frozen=True)
class _Pieces:
    """Simplices with the cuts that remain to be made.

    Attributes:
        cells: See :class:`Parts`, also for ``facets`` and ``parents``.
        middle: Index of the new vertex between two vertices, −1 if their edge is not to be cut,
            shape (n, dim + 1, dim + 1).
        rank: Order of the edges, same shape as ``middle``; the edge with the largest number is cut
            first.
    """

    cells: Longs
    facets: Ints
    parents: Longs
    middle: Longs
    rank: Longs

    def rows(self, which: npt.NDArray[np.bool_]) -> "_Pieces":
        """Return the simplices that ``which`` flags."""
        return _Pieces(*(getattr(self, name)[which] for name in _NAMES))

    def half(self, kept: Longs, moved: Longs, inner: int) -> "_Pieces":
        """Return the half of each simplex that contains the vertex ``kept`` of the cut edge.

        The edge's midpoint replaces the vertex ``moved``; the new facet gets the tag ``inner``.
        """
        row = np.arange(len(self.cells))
        half = _Pieces(*(getattr(self, name).copy() for name in _NAMES))
        half.cells[row, moved] = self.middle[row, kept, moved]
        half.facets[row, kept] = inner
        half.middle[row, moved] = half.middle[row, :, moved] = -1
        return half


_NAMES = tuple(field.name for field in fields(_Pieces))


def _joined(pieces: Sequence[_Pieces]) -> _Pieces:
    return _Pieces(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in _NAMES))
