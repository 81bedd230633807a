"""Find outer facets of a model: by faces of elements, sets of nodes, flat elements on faces."""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.models.element_blocks import Block
from perfplast_fenicsx.models.outer_facets import OuterFacets
from perfplast_fenicsx.models.simplices import pieces

NONE: Longs = np.zeros(0, dtype=np.int64)


class ElementFacets:
    """Search of outer facets."""

    def __init__(
        self, points: Floats, blocks: Sequence[Block], outer: OuterFacets, dim: int
    ) -> None:
        """Store the mesh.

        Args:
            points: Coordinates of the points, shape (n, 3).
            blocks: All elements, flat ones too.
            outer: The outer facets.
            dim: Dimension of the model: 3, or 2 in the plane.
        """
        self._points, self._every, self._outer, self._dim = points, blocks, outer, dim
        corners = np.zeros(len(points), dtype=bool)
        corners[outer.corners] = True
        self._corner = corners

    def of_faces(self, elements: Longs, face: str) -> Longs:
        """Return the facets of a face (S1, P1, ...) of elements; all outer ones without a face."""
        found = [NONE]
        number = int(face[1:]) - 1 if face[1:].isdigit() and face[:1] in "SPF" else None
        for block in self._blocks(self._dim):
            mine = block.nodes[self._rows(block, elements)]
            shape = block.kind.shape
            numbers = range(len(shape.faces)) if number is None else [number]
            for one in numbers:
                if 0 <= one < len(shape.faces) and len(mine):
                    for piece, _ in pieces(mine[:, list(shape.faces[one])]):
                        found.append(self._outer.find(piece))
        every = np.concatenate(found)
        return np.unique(every[every >= 0])

    def of_flat_elements(self, elements: Longs) -> Longs:
        """Return the facets on which flat elements (lines in the plane) lie."""
        found = [NONE]
        for block in self._blocks(self._dim - 1):
            mine = block.nodes[self._rows(block, elements)]
            for piece, _ in pieces(mine[:, : block.kind.shape.corners]):
                found.append(self._outer.find(piece))
        every = np.concatenate(found)
        return np.unique(every[every >= 0])

    def count_of_flat(self, elements: Longs) -> int:
        """Return the number of facets of flat elements; a quadrilateral has two in space."""
        return sum(
            len(self._rows(block, elements)) * (block.kind.shape.corners - self._dim + 1)
            for block in self._blocks(self._dim - 1)
        )

    def of_nodes(self, nodes: Longs) -> Longs:
        """Return the facets whose corners are all among given nodes."""
        return self._outer.among(nodes, len(self._points))

    def covered(self, nodes: Longs, facets: Longs) -> bool:
        """Return whether facets exist, with all given nodes that are corners of outer facets."""
        on = np.zeros(len(self._corner), dtype=bool)
        on[self._outer.corners[facets]] = True
        corners = nodes[self._corner[nodes]]
        return bool(len(facets)) and bool(on[corners].all())

    def areas(self, facets: Longs) -> np.ndarray:
        """Return the area of each facet (in the plane, its length)."""
        p = self._points[self._outer.corners[facets]]
        if self._dim == 2:
            return np.asarray(np.linalg.norm(p[:, 1] - p[:, 0], axis=1))
        return np.asarray(
            np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2
        )

    def _blocks(self, dim: int) -> list[Block]:
        return [block for block in self._every if block.kind.shape.dim == dim]

    def _rows(self, block: Block, elements: Longs) -> Longs:
        inside = (elements >= block.first) & (elements < block.first + len(block.nodes))
        return elements[inside] - block.first
