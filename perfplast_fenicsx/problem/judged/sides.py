"""Find the sides of bodies (outer facets by body and plane), and the names that cover sides."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.surface_facets import SHARP, exterior_facets, outer_facets
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING


@dataclass(frozen=True)
class OuterFacets:
    """The outer facets of the bodies on all ranks.

    Attributes:
        x: Vertices of each facet, shape (n, gdim, gdim).
        vertex: Global numbers of these vertices, shape (n, gdim).
        normal: Outward unit normals, shape (n, gdim).
        area: Areas (length², length in plane meshes, the full turn for bodies of revolution), shape
            (n,).
        body: Number of the connected body of each facet, shape (n,).
        tag: Tag of the named surface, −1 if the facet has no name, shape (n,).
    """

    x: Floats
    vertex: Longs
    normal: Floats
    area: Floats
    body: Longs
    tag: Longs


@dataclass(frozen=True)
class Side:
    """A flat or smoothly curved part of the outside of a connected body.

    Attributes:
        body: Number of the body.
        words: Description, such as ``side z = 5``, ``side with normal (0.6, 0.8)`` or ``curved
            side``.
        area: Total area of the side.
        pieces: Number of connected parts of the side.
    """

    body: int
    words: str
    area: float
    pieces: int


@dataclass(frozen=True)
class Cover:
    """The part of a side that a surface covers.

    Attributes:
        side: The side.
        area: The covered area.
        pieces: Number of connected parts of the side that are covered completely.
        rest: Areas of the other surfaces on the side, by their names; the key "" is for area
            without a name.
    """

    side: Side
    area: float
    pieces: int
    rest: dict[str, float]

    @property
    def whole(self) -> bool:
        """Return whether the surface covers the whole side."""
        return not self.rest


@dataclass(frozen=True)
class Sides:
    """The sides of all bodies.

    Attributes:
        facets: The outer facets on all ranks.
        sides: All sides.
        side: Number of the side of each facet, shape (n,).
        piece: Number of the connected part of a side that contains each facet, shape (n,).
        surfaces: Tag or tags of each name.
    """

    facets: OuterFacets
    sides: Sequence[Side]
    side: Longs
    piece: Longs
    surfaces: Mapping[str, int | tuple[int, ...]]

    def area(self, *names: str) -> float:
        """Return the area of surfaces together that lie on the outside of bodies."""
        return float(self.facets.area[self.on(*names)].sum())

    def on(self, *names: str) -> npt.NDArray[np.bool_]:
        """Return which facets belong to one of the surfaces, shape (n,)."""
        return np.isin(self.facets.tag, np.concatenate([np.ravel(self.surfaces[a]) for a in names]))

    def area_of_tags(self) -> dict[int, float]:
        """Return the total area of the facets with each tag."""
        tags, place = np.unique(self.facets.tag, return_inverse=True)
        areas = np.bincount(place, weights=self.facets.area, minlength=len(tags))
        return {int(tag): float(area) for tag, area in zip(tags, areas, strict=True)}

    def names_of_tags(self) -> dict[int, str]:
        """Return a name for each tag: that of the surface with this tag and the fewest tags."""
        widest_first = sorted(self.surfaces, key=lambda name: -np.size(self.surfaces[name]))
        return {int(tag): name for name in widest_first for tag in np.ravel(self.surfaces[name])}

    def names_of_all(self, tags: Iterable[int]) -> dict[int, str]:
        """Return a name for each of the given tags, and prefer names that cover many of them.

        A name of several tags is preferred only if all its tags are among the given tags.
        """
        left = set(tags)
        named = self.names_of_tags()
        groups = {name: set(np.ravel(of).tolist()) for name, of in self.surfaces.items()}
        wide = [name for name, group in groups.items() if 1 < len(group) and group <= left]
        found = {tag: named[tag] for tag in left if tag in named}
        for name in sorted(wide, key=lambda name: len(groups[name])):
            found |= dict.fromkeys(groups[name], name)
        return found

    def covers(self, *names: str) -> list[Cover]:
        """Return the part of each side that surfaces cover together, the largest part first."""
        facets, own = self.facets, self.on(*names)
        named = self.names_of_tags()
        found = []
        for number in np.unique(self.side[own]):
            here = self.side == number
            rest: dict[str, float] = {}
            for tag in np.unique(facets.tag[here & ~own]).tolist():
                there = here & (facets.tag == tag)
                other = named.get(tag, "")
                rest[other] = rest.get(other, 0.0) + float(facets.area[there].sum())
            left = np.unique(self.piece[here & ~own])
            whole = len(np.setdiff1d(self.piece[here & own], left))
            area = float(facets.area[here & own].sum())
            found.append(Cover(self.sides[number], area, whole, rest))
        return sorted(found, key=lambda cover: (-round(cover.area, 9), cover.side.words))

    def rest(self, name: str) -> npt.NDArray[np.bool_]:
        """Return which facets are on sides that a surface partly covers, but not on the surface."""
        own = self.on(name)
        return np.isin(self.side, self.side[own]) & ~own


def find_sides(problem: Problem) -> Sides | None:
    """Return the sides of a problem's bodies on rank 0; None on the other ranks. Collective."""
    found = gathered_facets(problem)
    if found is None:
        return None
    return sides_of(
        found, problem.kinematics.axes, problem.bodies.size, problem.tagged_mesh.surfaces
    )


def gathered_facets(problem: Problem) -> OuterFacets | None:
    """Return the outer facets of all ranks on rank 0; None on the other ranks. Collective."""
    V, tagged_mesh, gdim = problem.V, problem.tagged_mesh, problem.bodies.gdim
    chosen = exterior_facets(tagged_mesh)
    own = outer_facets(V, tagged_mesh, chosen)
    tags = tagged_mesh.facet_tags
    tag = np.full(len(chosen), -1, dtype=np.int64)
    _, at, named = np.intersect1d(chosen, tags.indices, return_indices=True)
    tag[at] = tags.values[named]
    normal = own.normal.mean(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    vertex = V.dofmap.index_map.local_to_global(own.nodes[:, :gdim].ravel())
    parts = (
        own.x[:, :gdim],
        np.asarray(vertex, dtype=np.int64).reshape(-1, gdim),
        normal,
        own.weight.sum(axis=1),
        problem.bodies.of_node[own.nodes[:, 0]].astype(np.int64),
        tag,
    )
    gathered = problem.comm.gather(parts)
    if gathered is None:
        return None
    return OuterFacets(*(np.concatenate(part) for part in zip(*gathered, strict=True)))


def sides_of(
    facets: OuterFacets, axes: str, size: float, surfaces: Mapping[str, int | tuple[int, ...]]
) -> Sides:
    """Group facets into sides, and return the sides.

    Facets of one body that lie in one plane and have the same direction form a side, even if they
    do not touch. Facets whose direction changes by small angles form a curved side.

    Args:
        facets: All outer facets.
        axes: Letters of the coordinates.
        size: Size of the bodies (length).
        surfaces: Tag or tags of each name.
    """
    count, gdim = len(facets.area), facets.x.shape[2]
    pairs = _neighbours(facets.vertex)
    turn = np.einsum("pi,pi->p", facets.normal[pairs[:, 0]], facets.normal[pairs[:, 1]])
    most = 1e-3  # largest angle (rad) between facets in one plane, for coordinates with few digits
    flat = turn >= np.cos(most)
    _, patch = _joined(count, pairs[flat])
    bends = pairs[~flat & (turn >= SHARP)]
    curved, smooth = _curved(patch, bends, gdim)
    # Each patch has the direction and position of its largest facet, so that errors do not
    # accumulate.
    largest = np.lexsort((facets.area, patch))
    ends = np.searchsorted(patch[largest], np.arange(patch.max(initial=-1) + 1), side="right") - 1
    of_patch = largest[ends]
    normal, centre = facets.normal[of_patch], facets.x[of_patch].mean(axis=1)
    offset = np.einsum("pi,pi->p", normal, centre)
    # Planes of one body count as equal if they differ by less than 1e-3 rad in direction and
    # 1e-6 of the size in position. The factor separates planes of different bodies.
    body_apart = 10.0
    place = np.column_stack([normal / 1e-3, offset[:, None] / (1e-6 * size)])
    place = np.column_stack([place, facets.body[of_patch] * body_apart])
    level = np.flatnonzero(~smooth)
    near = cKDTree(place[level]).query_pairs(1.0, output_type="ndarray") if len(level) else None
    group = np.arange(len(normal))
    if near is not None and len(near):
        _, joined = _joined(len(level), near)
        group[level] = level[np.unique(joined, return_index=True)[1]][joined]
    group[smooth] = len(normal) + curved[smooth]
    _, first, side = np.unique(group[patch], return_index=True, return_inverse=True)
    side = np.asarray(side, dtype=np.int64).ravel()
    piece = np.where(smooth[patch], len(normal) + side, patch).astype(np.int64)
    area = np.bincount(side, weights=facets.area, minlength=len(first))
    pieces = np.bincount(np.unique(np.column_stack([side, piece]), axis=0)[:, 0])
    found = []
    for number, one in enumerate(first.tolist()):
        words = "curved side"
        if not smooth[patch[one]]:
            words = _plane(normal[patch[one]], float(offset[patch[one]]), axes, size)
        body = int(facets.body[one])
        found.append(Side(body, words, float(area[number]), int(pieces[number])))
    return Sides(facets, found, side, piece, dict(surfaces))


def _neighbours(vertex: Longs) -> Longs:
    """Return pairs of facets that share all vertices except one, shape (m, 2)."""
    count, size = vertex.shape
    corners = np.array(list(combinations(range(size), size - 1)))
    keys = np.sort(vertex[:, corners], axis=2).reshape(-1, size - 1)
    facet = np.repeat(np.arange(count), len(corners))
    order = np.lexsort(keys.T[::-1])
    keys, facet = keys[order], facet[order]
    same = (keys[1:] == keys[:-1]).all(axis=1)
    return np.column_stack([facet[:-1][same], facet[1:][same]])


def _joined(count: int, pairs: npt.NDArray[np.integer]) -> tuple[int, Longs]:
    """Return the number of connected groups, and the group of each of ``count`` items."""
    ones = np.ones(len(pairs), dtype=np.int8)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    number, group = connected_components(graph, directed=False)
    return int(number), group.astype(np.int64)


def _curved(patch: Longs, bends: Longs, gdim: int) -> tuple[Longs, npt.NDArray[np.bool_]]:
    """Return the curved side of each patch, and whether the patch is part of a curved side.

    A patch counts as a strip if at least half of its facets have a neighbour in a patch of slightly
    different direction. In plane meshes, a strip has only one facet. At least three neighbouring
    strips form a curved side.

    Args:
        patch: Number of the patch (facets in one plane) of each facet, shape (n,).
        bends: Pairs of neighbours with slightly different directions, shape (m, 2).
        gdim: Space dimension.
    """
    count = int(patch.max(initial=-1)) + 1
    at_bend = np.zeros(len(patch), dtype=np.bool_)
    at_bend[bends.ravel()] = True
    facets = np.bincount(patch, minlength=count)
    share = np.bincount(patch, weights=at_bend, minlength=count) / np.maximum(facets, 1)
    strip = (share >= 0.5) & ((facets == 1) if gdim == 2 else True)
    ends = patch[bends]
    _, group = _joined(count, ends[strip[ends].all(axis=1)])
    strips = np.bincount(group, weights=strip, minlength=count)
    return group, strip & (strips[group] >= 3)


def _plane(normal: Floats, offset: float, axes: str, size: float) -> str:
    """Return a description of a plane in words."""
    along = int(np.argmax(np.abs(normal)))
    straight = 1e-6  # components of a normal below this value count as zero
    if np.delete(np.abs(normal), along).max() <= straight:
        place = offset * np.sign(normal[along])
        place = 0.0 if abs(place) <= ROUNDING * size else place
        return f"side {axes[along]} = {place:.5g}"
    rounded = np.round(normal, 3) + 0.0
    return f"side with normal ({', '.join(f'{a:g}' for a in rounded)})"
