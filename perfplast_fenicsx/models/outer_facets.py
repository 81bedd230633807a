"""Find outer facets of a model by corners, by element faces or by sets of nodes; name them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.models.element_types import Block
from perfplast_fenicsx.models.foreign_model import ForeignModel
from perfplast_fenicsx.models.solid_cells import pieces

NOWHERE = -1


class OuterFacets:
    """The facets that belong to only one cell.

    Attributes:
        corners: Corners of each facet, sorted by number, shape (num_facets, dim).
        cells: Cell of each facet, shape (num_facets,).
    """

    def __init__(self, cells: Longs, num_points: int) -> None:
        """Find the facets that belong to only one cell.

        Args:
            cells: Corners of all simplices, shape (m, dim + 1).
            num_points: Number of points.

        Raises:
            InputError: If there are too many points.
        """
        # with more points, the key of a triangle would not fit into 63 bits
        most_points = 2_000_000
        if num_points > most_points:
            raise InputError(
                f"the model has {num_points} nodes, but at most {most_points} are supported; give "
                "a coarser mesh."
            )
        dim = cells.shape[1] - 1
        self._base = np.int64(max(num_points, 1))
        sides = [list(side) for side in combinations(range(dim + 1), dim)]
        every = np.sort(np.concatenate([cells[:, side] for side in sides]), axis=1)
        owners = np.tile(np.arange(len(cells)), len(sides))
        keys = self._keys(every)
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        first = np.concatenate([[True], ordered[1:] != ordered[:-1]])
        alone = first & np.concatenate([first[1:], [True]])
        chosen = order[alone]
        self._found = ordered[alone]
        self.corners, self.cells = every[chosen], owners[chosen]

    def outwards(self, points: Floats, cells: Longs) -> Longs:
        """Return the corners of the triangles, counterclockwise as seen from outside.

        Args:
            points: Coordinates of the points, shape (n, 3).
            cells: The cells given to the constructor.
        """
        a, b, c = (points[self.corners[:, k]] for k in range(3))
        inside = points[cells[self.cells]].mean(axis=1)
        volume = np.einsum("ni,ni->n", np.cross(b - a, c - a), inside - a)
        turned: Longs = np.where((volume > 0)[:, None], self.corners[:, [0, 2, 1]], self.corners)
        return turned

    def _keys(self, corners: Longs) -> Longs:
        keys = np.zeros(len(corners), dtype=np.int64)
        for column in corners.T:
            keys = keys * self._base + column
        return keys

    def find(self, corners: Longs) -> Longs:
        """Return the numbers of the facets with these corners, shape (n,); -1 if unknown."""
        keys = self._keys(np.sort(corners, axis=1))
        at = np.minimum(np.searchsorted(self._found, keys), max(len(self._found) - 1, 0))
        there = self._found[at] == keys if len(self._found) else np.zeros(len(keys), dtype=bool)
        return np.where(there, at, NOWHERE)

    def among(self, points: Longs, num_points: int) -> Longs:
        """Return the numbers of the facets whose corners are all among the given points."""
        chosen = np.zeros(num_points, dtype=bool)
        chosen[points] = True
        return np.flatnonzero(chosen[self.corners].all(axis=1))


NONE: Longs = np.zeros(0, dtype=np.int64)


class ElementFacets:
    """Finds outer facets by the faces of elements, by flat elements or by nodes."""

    def __init__(
        self, points: Floats, blocks: Sequence[Block], outer: OuterFacets, dim: int
    ) -> None:
        """Store the mesh.

        Args:
            points: Coordinates of the points, shape (n, 3).
            blocks: All elements, including flat ones.
            outer: The outer facets.
            dim: 3, or 2 for plane models.
        """
        self._points, self._every, self._outer, self._dim = points, blocks, outer, dim
        corners = np.zeros(len(points), dtype=bool)
        corners[outer.corners] = True
        self._corner = corners

    def of_faces(self, elements: Longs, face: str) -> Longs:
        """Return facets on a face (S1, P1, ...) of elements; all their outer facets if it is ""."""
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
        """Return the facets on which flat elements (in the plane lines) lie."""
        found = [NONE]
        for block in self._blocks(self._dim - 1):
            mine = block.nodes[self._rows(block, elements)]
            for piece, _ in pieces(mine[:, : block.kind.shape.corners]):
                found.append(self._outer.find(piece))
        every = np.concatenate(found)
        return np.unique(every[every >= 0])

    def count_of_flat(self, elements: Longs) -> int:
        """Return the number of facets of flat elements; a quadrilateral in 3D has two facets."""
        return sum(
            len(self._rows(block, elements)) * (block.kind.shape.corners - self._dim + 1)
            for block in self._blocks(self._dim - 1)
        )

    def of_nodes(self, nodes: Longs) -> Longs:
        """Return the facets whose corners are all among the given nodes."""
        return self._outer.among(nodes, len(self._points))

    def covered(self, nodes: Longs, facets: Longs) -> bool:
        """Return whether ``facets`` is not empty and contains all outer corners in ``nodes``."""
        on = np.zeros(len(self._corner), dtype=bool)
        on[self._outer.corners[facets]] = True
        corners = nodes[self._corner[nodes]]
        return bool(len(facets)) and bool(on[corners].all())

    def areas(self, facets: Longs) -> np.ndarray:
        """Return the area (in the plane the length) of each facet."""
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


def with_flat_ends(model: ForeignModel) -> ForeignModel:
    """Return the model with names such as ``plate_z_low`` for unnamed flat ends of bodies."""
    outer = OuterFacets(model.cells, len(model.points))
    free = np.ones(len(outer.corners), dtype=bool)
    named = outer.find(model.facets)
    free[named[named != NOWHERE]] = False
    wanted, found = [], []
    # largest distance of the nodes of a flat end from its plane, relative to the body's size
    off_plane = 1e-6
    for number, body in enumerate(model.bodies):
        mine = free & (model.body[outer.cells] == number)
        places = model.points[np.unique(model.cells[model.body == number])][:, : model.dim]
        low, high = places.min(axis=0), places.max(axis=0)
        close = off_plane * float(np.linalg.norm(high - low))
        for axis, letter in enumerate("xyz"[: model.dim]):
            for side, end in (("low", low[axis]), ("high", high[axis])):
                off = np.abs(model.points[outer.corners, axis] - end).max(axis=1)
                at = np.flatnonzero(mine & (off <= close))
                if len(at):
                    wanted.append(f"{body}_{letter}_{side}")
                    found.append(at)
    if not found:
        return model
    names = unique_names([*model.surfaces, *wanted])
    first = len(model.surfaces)
    ends = [np.full(len(at), first + k) for k, at in enumerate(found)]
    return replace(
        model,
        facets=np.concatenate([model.facets, outer.corners[np.concatenate(found)]]),
        surface=np.concatenate([model.surface, *ends]),
        surfaces=names,
    )


class NamedSurfaces:
    """Stores surfaces by name, and divides surfaces that overlap.

    In a mesh, a facet has only one physical name. So facets that several surfaces share become
    separate surfaces, and a name then stands for several surfaces.
    """

    def __init__(self) -> None:
        self._members: dict[str, Longs] = {}

    def add(self, name: str, facets: Longs) -> None:
        """Add a surface, or add facets to an existing surface."""
        before = self._members.get(name, np.zeros(0, dtype=np.int64))
        self._members[name] = np.union1d(before, facets)

    def names(self) -> list[str]:
        """Return the names of the surfaces, in the order of their definition."""
        return list(self._members)

    def remove(self, name: str) -> None:
        """Remove a surface."""
        del self._members[name]

    def facets(self, name: str) -> Longs:
        """Return the facets of a surface."""
        return self._members[name]

    def divided(
        self, taken: Sequence[str] = ()
    ) -> tuple[list[str], Longs, Longs, dict[str, list[str]]]:
        """Return the surfaces, divided so that they have no common facets.

        Args:
            taken: Names of bodies, which surfaces must not have.

        Returns:
            The names of the divided surfaces; the facets, shape (k,); the surface of each facet,
            shape (k,); and for each added name the names of its divided surfaces.
        """
        names = [name for name, facets in self._members.items() if len(facets)]
        members = [self._members[name] for name in names]
        every = np.unique(np.concatenate([np.zeros(0, np.int64), *members]))
        signs = np.zeros((len(every), (len(names) + 62) // 63), dtype=np.int64)
        for number, name in enumerate(names):
            at = np.searchsorted(every, self._members[name])
            signs[at, number // 63] |= np.int64(1) << np.int64(number % 63)
        kinds, surface = np.unique(signs, axis=0, return_inverse=True)
        stands: dict[str, list[str]] = {name: [] for name in names}
        having = [
            [n for k, n in enumerate(names) if kind[k // 63] >> np.int64(k % 63) & 1]
            for kind in kinds
        ]
        plain = unique_names("_and_".join(some) for some in having)
        plain = [f"{name}_surface" if name in taken else name for name in plain]
        for called, some in zip(plain, having, strict=True):
            for name in some:
                stands[name].append(called)
        return plain, every, surface.ravel(), stands
