"""Cut simplices at the midpoints of marked edges, as arrays.

The algorithm cuts a simplex at its marked edge with the highest order, then its two parts at their
remaining marked edges, and so on. A face shared by two simplices is cut in the same way in both,
since its edges have the same order. So the parts conform whatever edges are marked, in the plane
and in space. If edges are ordered by length, and the longest edge of every cut triangle is marked,
this is the skeleton-based refinement of Plaza and Carey, doi:10.1016/S0168-9274(99)00022-7.
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
        cells: Their vertices, shape (num_parts, dim + 1).
        facets: Tags of their facets, with the facet opposite vertex k in column k, shape
            (num_parts, dim + 1).
        parents: The simplex of each part, shape (num_parts,).
    """

    cells: Longs
    facets: Ints
    parents: Longs


def edges_of_simplex(dim: int) -> Longs:
    """Return local vertices of a simplex's edges in DOLFINx's order, shape (num_edges, 2)."""
    return np.array(basix.topology(SIMPLEX[dim])[1])


def edges_of_faces(dim: int) -> Longs:
    """Return the three edges of each triangle of a simplex, shape (num_faces, 3)."""
    edges = edges_of_simplex(dim)
    faces = np.array(basix.topology(SIMPLEX[dim])[2])
    return np.array([np.flatnonzero(np.isin(edges, face).all(axis=1)) for face in faces])


def cut(cells: Longs, facets: Ints, middles: Longs, order: Longs, inner: int) -> Parts:
    """Return the parts of simplices cut at the marked edges.

    Args:
        cells: Vertices of each simplex, shape (n, dim + 1).
        facets: Tags of its facets, shape (n, dim + 1).
        middles: Index of the vertex on each of its edges, −1 for unmarked edges; shape (n,
            num_edges).
        order: Order of the edges, of which the largest is cut first; distinct in a simplex and
            equal in all simplices that share the edge; shape (n, num_edges).
        inner: The tag of facets between parts of one simplex.
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
    """Simplices with their remaining cuts.

    Attributes:
        cells: As for :class:`Parts`, also ``facets`` and ``parents``.
        middle: The vertex between two vertices, −1 for none, shape (n, dim + 1, dim + 1).
        rank: Order of the edges, of which the largest is cut first; same shape.
    """

    cells: Longs
    facets: Ints
    parents: Longs
    middle: Longs
    rank: Longs

    def rows(self, which: npt.NDArray[np.bool_]) -> "_Pieces":
        """Return some of the simplices."""
        return _Pieces(*(getattr(self, name)[which] for name in _NAMES))

    def half(self, kept: Longs, moved: Longs, inner: int) -> "_Pieces":
        """Return the half of each simplex that keeps one end of an edge.

        The other end moves to the middle.
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
