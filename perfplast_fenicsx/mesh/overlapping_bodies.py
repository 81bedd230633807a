"""Find overlapping bodies, and bodies with cuts through their interior.

If two bodies overlap, a cell at the surface of one body overlaps a cell of the other body. The same
holds for a body that overlaps itself. Facets that approximate curved surfaces may overlap by their
sagitta.

Depths of overlaps come from the separating axis theorem (for boxes: S. Gottschalk, M. C. Lin, D.
Manocha, OBBTree, SIGGRAPH 1996). Two convex polytopes are disjoint if and only if their projections
on some axis are disjoint. It suffices to test the normals of their faces, and the cross products of
an edge of one polytope and an edge of the other.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, product

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx.common import IndexMap
from scipy.spatial import KDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError, place_of, raise_together
from perfplast_fenicsx.mesh.facet_sides import sides_of_facets
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box, send_rows, sums_at

AxisOf = Callable[[Floats, Floats], tuple[Floats, Floats]]


def overlap_depths(one: Floats, other: Floats, least: Floats) -> Floats:
    """Return the size of the smallest displacement that separates each pair of simplices.

    Args:
        one: Vertices of one simplex, shape (n, gdim + 1, gdim).
        other: Vertices of the other simplex, same shape.
        least: Largest depth that counts as no overlap, shape (n,).

    Returns:
        Depths (length), shape (n,); 0 for depths up to ``least``.
    """
    depth = np.full(len(one), np.inf)
    left = np.arange(len(one))
    # the product of two edges is ignored if the sine of their angle is below this value
    parallel = 1e-9
    for axis_of in _axes(one.shape[2]):
        axis, size = axis_of(one[left], other[left])
        length = np.linalg.norm(axis, axis=1)
        there = length > parallel * size
        axis = axis / np.where(there, length, 1.0)[:, None]
        a, b = (np.einsum("nki,ni->nk", x[left], axis) for x in (one, other))
        moved = np.minimum(a.max(axis=1) - b.min(axis=1), b.max(axis=1) - a.min(axis=1))
        moved[~there] = np.inf
        depth[left] = np.minimum(depth[left], moved)
        left = left[moved > least[left]]
    found = np.zeros(len(one))
    found[left] = depth[left]
    return found


def _axes(gdim: int) -> Iterator[AxisOf]:
    """Yield functions that return an axis for each pair of simplices, and a bound on its length."""
    for which in (0, 1):
        for place in range(gdim + 1):
            yield partial(_face_normal, which, place)
    if gdim == 3:
        edges = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
        for first, second in product(edges, edges):
            yield partial(_edge_product, first, second)


def _face_normal(which: int, place: int, *x: Floats) -> tuple[Floats, Floats]:
    """Return normals of facets opposite vertex ``place``, and their largest possible lengths."""
    corner, *rest = np.delete(np.arange(x[0].shape[1]), place)
    edges = [x[which][:, other] - x[which][:, corner] for other in rest]
    if len(edges) == 2:
        return _cross(*edges)
    normal = np.column_stack([edges[0][:, 1], -edges[0][:, 0]])
    return normal, np.asarray(np.linalg.norm(normal, axis=1))


def _edge_product(
    first: tuple[int, int], second: tuple[int, int], one: Floats, other: Floats
) -> tuple[Floats, Floats]:
    edges = (x[:, b] - x[:, a] for x, (a, b) in ((one, first), (other, second)))
    return _cross(*edges)


def _cross(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    size = np.asarray(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.asarray(np.cross(a, b)), size


class Slabs:
    """Divide space into one slab per rank, with about the same number of points in each slab."""

    def __init__(self, comm: MPI.Intracomm, places: Floats) -> None:
        """Choose the axis and the limits of the slabs. Collective.

        Args:
            comm: The ranks.
            places: Points of this rank, shape (n, gdim).
        """
        low, high = bounding_box(comm, places)
        self._comm, self.axis = comm, int(np.argmax(high - low))
        along = np.sort(places[:, self.axis])
        # largest number of points from each rank that determine the limits of the slabs
        samples = 200
        some = along[np.linspace(0, len(along) - 1, min(samples, len(along)), dtype=np.int64)]
        weights = np.full(len(some), len(along) / max(len(some), 1))
        every, weight = (np.concatenate(comm.allgather(part)) for part in (some, weights))
        order = np.argsort(every, kind="stable")
        before = np.cumsum(weight[order])
        shares = np.arange(1, comm.size) / comm.size * before[-1]
        self._ends = every[order][np.searchsorted(before, shares)]

    def send(self, rows: npt.NDArray, low: Floats, high: Floats) -> npt.NDArray:
        """Send each row to all ranks whose slabs it intersects; return received rows. Collective.

        Args:
            rows: Rows of a structured type, shape (n,).
            low: Lower ends of the rows' objects along ``axis``, shape (n,).
            high: Upper ends along ``axis``, shape (n,).
        """
        if self._comm.size == 1:
            return rows
        first = np.searchsorted(self._ends, low, side="left")
        count = np.searchsorted(self._ends, high, side="right") - first + 1
        which = np.repeat(np.arange(len(rows)), count)
        within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return send_rows(self._comm, rows[which], first[which] + within)


class CellSearch:
    """Find cells by position; cells of about the same size are in one tree."""

    def __init__(self, x: Floats) -> None:
        """Build search trees, one for each class of cell sizes.

        Args:
            x: Vertices of the cells, shape (num_cells, gdim + 1, gdim).
        """
        centres = x.mean(axis=1)
        radii = np.linalg.norm(x - centres[:, None], axis=2).max(axis=1)
        sizes = np.floor(np.log2(radii / radii.min(initial=np.inf)))
        self._trees: list[tuple[KDTree, Longs, float]] = []
        for size in np.unique(sizes):
            cells = np.flatnonzero(sizes == size)
            self._trees.append((KDTree(centres[cells]), cells, float(radii[cells].max())))

    def near(self, points: Floats, within: Floats) -> Iterator[tuple[Longs, Longs]]:
        """Yield all pairs of a point and a cell within a distance, and some farther pairs.

        Args:
            points: Points, shape (n, gdim).
            within: Distance for each point, shape (n,).

        Yields:
            Arrays of point indices and cell indices; each pair occurs once.
        """
        # number of points in one search, which limits the memory for pairs
        at_once = 20_000
        for tree, cells, radius in self._trees:
            for first in range(0, len(points), at_once):
                some = slice(first, first + at_once)
                found = tree.query_ball_point(points[some], within[some] + radius)
                counts = np.fromiter(map(len, found), dtype=np.int64, count=len(found))
                members = np.fromiter(
                    chain.from_iterable(found), dtype=np.int64, count=int(counts.sum())
                )
                yield np.repeat(np.arange(first, first + len(found)), counts), cells[members]


@dataclass(frozen=True)
class _Cells:
    """The cells of this rank as rows to send, and points just outside unnamed outer facets."""

    rows: npt.NDArray
    outside: npt.NDArray


def check_bodies(tagged_mesh: TaggedMesh, overlaps: bool = False) -> list[str]:
    """Raise an error if bodies overlap or have cuts through their interior. Collective.

    Args:
        tagged_mesh: The bodies.
        overlaps: Whether different bodies may overlap, as in a press fit.

    Returns:
        Remarks on bodies that touch at facets without a name.

    Raises:
        InputError: If bodies overlap or have such cuts; the message has the bodies and a place.
    """
    comm, gdim = tagged_mesh.mesh.comm, tagged_mesh.mesh.geometry.dim
    cells = _cells(tagged_mesh)
    x = cells.rows["x"]
    slabs = Slabs(comm, x.mean(axis=1))
    low, high = (end(x[:, :, slabs.axis], axis=1) for end in (np.min, np.max))
    rows = slabs.send(cells.rows, low, high)
    at = cells.outside["point"][:, slabs.axis]
    outside = slabs.send(cells.outside, at, at)
    search = CellSearch(rows["x"])
    names = {tag: name for name, tag in tagged_mesh.volumes.items()}
    extent = float(np.linalg.norm(np.subtract(*bounding_box(comm, x.reshape(-1, gdim)))))
    raise_together(comm, _deepest(rows, search, names, extent, overlaps))
    cut = np.concatenate(comm.allgather(_covered(rows, outside, search)))
    pairs, first, counts = np.unique(cut[["one", "other"]], return_index=True, return_counts=True)
    told = []
    for (one, other), number, count in zip(pairs.tolist(), first, counts, strict=True):
        place = place_of(cut["point"][number])
        if one == other:
            raise InputError(
                f"the body '{names[one]}' has an internal cut: {count} of its outer facets touch "
                f"cells of the same body, but share no nodes with them (one facet is at {place}); "
                "merge the nodes (in gmsh: Coherence, or remove duplicate nodes), or name the "
                "facets of an intended cut."
            )
        told.append(
            f"'{names[one]}' touches '{names[other]}' at {count} facets without a name, one at "
            f"{place}: the bodies can penetrate each other at these facets"
        )
    return told


def _cells(tagged_mesh: TaggedMesh) -> _Cells:
    """Return the cells of this rank, and points outside unnamed outer facets. Collective."""
    mesh = tagged_mesh.mesh
    tdim, gdim = mesh.topology.dim, mesh.geometry.dim
    cells, points = corners(mesh)
    sides = sides_of_facets(mesh)
    x, outer = points[cells], (sides.count == 1)[sides.of_cell]
    rows = np.zeros(
        len(cells),
        dtype=[
            *(("x", "f8", (tdim + 1, gdim)), ("vertices", "i8", (tdim + 1,))),
            *(("body", "i8"), ("outer", "?"), ("allowed", "f8")),
        ],
    )
    rows["x"], rows["outer"] = x, outer.any(axis=1)
    vertices = mesh.topology.index_map(0)
    rows["vertices"] = vertices.local_to_global(cells.ravel()).reshape(cells.shape)
    tags = tagged_mesh.cell_tags
    own = tags.indices < len(cells)
    rows["body"][tags.indices[own]] = tags.values[own]
    at, place = np.nonzero(outer)
    facets = np.array([np.delete(np.arange(tdim + 1), i) for i in range(tdim + 1)])[place]
    corner = np.take_along_axis(x[at], facets[:, :, None], axis=1)
    area = _area_vectors(corner)
    inside = x[at, place] - corner[:, 0]
    area *= -np.sign(np.einsum("ni,ni->n", area, inside))[:, None]
    length = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    ends = np.take_along_axis(cells[at], facets, axis=1)
    rows["allowed"] = _sagittas(mesh.comm, vertices, ends, area, length)[cells].max(axis=1)

    named = np.zeros(len(sides.count), dtype=np.bool_)
    named[tagged_mesh.facet_tags.indices] = True
    plain = ~named[sides.of_cell[at, place]]
    outside = np.zeros(int(plain.sum()), dtype=[("point", "f8", (gdim,)), ("body", "i8")])
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    # distance from a facet, relative to its size, of the outside point where cells are sought
    margin = 1e-4
    beyond = corner.mean(axis=1) + margin * length[:, None] * normal
    outside["point"], outside["body"] = beyond[plain], rows["body"][at[plain]]
    return _Cells(rows, outside)


def _area_vectors(corner: Floats) -> Floats:
    """Return a normal of each facet, with the area of the facet as its length, shape (n, gdim)."""
    edges = corner[:, 1:] - corner[:, :1]
    if edges.shape[1] == 1:
        return np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    return np.asarray(np.cross(edges[:, 0], edges[:, 1]) / 2)


def _sagittas(
    comm: MPI.Intracomm, vertices: IndexMap, ends: npt.NDArray, area: Floats, length: Floats
) -> Floats:
    """Return, for each vertex, an estimate of its facets' distance from a curved surface.

    Collective. The estimate is zero if all facets at the vertex lie in one plane; otherwise it is
    about the largest estimate of a single facet.
    """
    at_ends = (ends.ravel(), np.repeat(area, ends.shape[1], axis=0))
    mean = sums_at(vertices, area.shape[1], at_ends)
    across = np.einsum("nki,ni->nk", mean[ends], area)
    sizes = np.linalg.norm(mean[ends], axis=2) * np.linalg.norm(area, axis=1)[:, None]
    cosine = np.clip(across / np.maximum(sizes, np.finfo(float).tiny), -1, 1)
    # Facets at a vertex belong to one curved surface if their angles to the mean normal are below
    # 25°. In contact, two facets form one surface up to an angle of 40°, 20° from the mean.
    least_cosine = np.cos(np.deg2rad(25.0))
    aslant = np.where(cosine > least_cosine, np.arccos(cosine), 0.0)
    caution = 2.0  # factor on sagittas, because mean normals are only approximate
    sagitta = caution * length * np.tan(aslant.max(axis=1, initial=0) / 2) / 2
    longest = comm.allreduce(float(length.max(initial=0)), MPI.MAX) or 1.0
    # the sum of high powers is about the power of the largest
    powers = np.repeat((sagitta / longest) ** 8, ends.shape[1])[:, None]
    return np.asarray(longest * sums_at(vertices, 1, (ends.ravel(), powers))[:, 0] ** (1 / 8))


def _deepest(
    rows: npt.NDArray, search: CellSearch, names: dict[int, str], extent: float, overlaps: bool
) -> str | None:
    """Return a message on the cells with the deepest overlap; None if no cells overlap."""
    outer = np.flatnonzero(rows["outer"])
    x = rows["x"]
    edge = np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2), initial=0)
    centres = x[outer].mean(axis=1)
    radii = np.linalg.norm(x[outer] - centres[:, None], axis=2).max(axis=1, initial=0)
    low, high = x.min(axis=1), x.max(axis=1)
    worst, said = 0.0, None
    # Overlaps are ignored below this depth, relative to a cell's longest edge, because nodes are
    # not more accurate.
    rounding = 1e-3
    # Below this depth, relative to the size of all bodies, surfaces only touch.
    contact_depth = 1e-6
    for one, other in search.near(centres, radii):
        one = outer[one]
        apart = rows["body"][one] != rows["body"][other]
        asked = one != other
        asked &= ~(overlaps & apart)
        asked &= ~(rows["outer"][other] & (other < one))  # the pair occurs in both orders
        one, other = one[asked], other[asked]
        least = rounding * np.maximum(edge[one], edge[other]) + contact_depth * extent
        least += rows["allowed"][one] + rows["allowed"][other]
        boxes = np.minimum(high[one] - low[other], high[other] - low[one])
        asked = (boxes > least[:, None]).all(axis=1)
        one, other, least = one[asked], other[asked], least[asked]
        shared = rows["vertices"][one][:, :, None] == rows["vertices"][other][:, None]
        asked = ~shared.any(axis=(1, 2))
        one, other, least = one[asked], other[asked], least[asked]
        depth = overlap_depths(x[one], x[other], least)
        if depth.max(initial=0) <= worst:
            continue
        at = int(np.argmax(depth))
        worst = float(depth[at])
        bodies = sorted({names[int(rows["body"][cell])] for cell in (one[at], other[at])})
        who = f"the body '{bodies[0]}' overlaps itself"
        if len(bodies) == 2:
            who = f"the bodies '{bodies[0]}' and '{bodies[1]}' overlap"
        said = (
            f"{who}: cells around {place_of(x[one[at]].mean(axis=0))} overlap by {worst:.3g}; mesh "
            "the bodies so that they only touch, or give interference = true in their [[contact]]"
        )
    return said


def _covered(rows: npt.NDArray, outside: npt.NDArray, search: CellSearch) -> npt.NDArray:
    """Return the points of ``outside`` that lie in a cell, with the bodies of facet and cell."""
    found = [np.zeros(0, dtype=[("one", "i8"), ("other", "i8"), ("point", outside.dtype["point"])])]
    points = outside["point"]
    low, high = rows["x"].min(axis=1), rows["x"].max(axis=1)
    for point, cell in search.near(points, np.zeros(len(points))):
        at = points[point]
        close = ((low[cell] <= at) & (at <= high[cell])).all(axis=1)
        point, cell = point[close], cell[close]
        x = rows["x"][cell]
        local = np.linalg.solve(
            (x[:, 1:] - x[:, :1]).transpose(0, 2, 1), (points[point] - x[:, 0])[:, :, None]
        )[:, :, 0]
        inside = (local >= 0).all(axis=1) & (local.sum(axis=1) <= 1)
        hits = np.zeros(int(inside.sum()), dtype=found[0].dtype)
        ends = np.sort([outside["body"][point[inside]], rows["body"][cell[inside]]], axis=0)
        hits["one"], hits["other"], hits["point"] = *ends, points[point[inside]]
        found.append(hits)
    return np.concatenate(found)
