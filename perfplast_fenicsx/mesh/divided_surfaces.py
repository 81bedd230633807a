"""Divide cells of plane bodies at a surface on which nodes of another surface lie.

A cell is divided from the vertex opposite the surface, so the rest of the mesh does not change.
After a division on both sides of an interface, the facets of both sides match.

The surface may also approximate a curve by chords. Two polygons that approximate the same curve
have their vertices on the curve, but differ between the vertices. A point next to a chord therefore
counts as a point of the curve if two conditions hold. The point lies on the convex side, and the
point is at most as far from the chord as an arc that turns by the same angles as the chords.
"""

import basix.ufl
import numpy as np
import ufl
from dolfinx import la
from dolfinx.common import IndexMap
from dolfinx.mesh import create_mesh
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import sent_to
from perfplast_fenicsx.errors import raise_together
from perfplast_fenicsx.mesh.straight_geometry import OuterFacets, corners, outer_facets
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, cell_meshtags, distributed_tags


def bulges(ends: Floats, every: Floats) -> Floats:
    """Return the sines of the angles between chords and their neighbours, for both sides.

    Args:
        ends: Ends of some chords, shape (n, 2, 2).
        every: Ends of all chords of the surface, shape (m, 2, 2).

    Returns:
        Sines of the larger of the two angles at the ends of each chord, shape (n, 2). Column 0 is
        for bends that are convex to the left of the chord, column 1 for bends to the right. The
        sine is 0 where chords do not bend and next to corners.
    """
    corner = 0.6  # an angle with a larger sine is a corner, and does not approximate a curve
    found = np.zeros((len(ends), 2))
    if not len(every):
        return found
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None]
    tree = cKDTree(every.reshape(-1, 2))
    for end in (0, 1):
        here = ends[:, end]
        apart, which = tree.query(here, k=2)
        # the nearest ends belong to this chord and, except at an end of the surface, to the next
        # chord
        near = apart <= _off_by_rounding(lengths)[:, None]
        far = every[which // 2, 1 - which % 2] - here[:, None]
        reach = np.where(near, np.linalg.norm(far, axis=2), 1.0)
        sine = np.einsum("nki,ni->nk", far, left) / reach
        ahead = np.einsum("nki,ni->nk", far, along if end else -along) > 0
        sine = np.where(near & ahead & (np.abs(sine) < corner), sine, 0.0)
        found[:, 0] = np.maximum(found[:, 0], -sine.min(axis=1))
        found[:, 1] = np.maximum(found[:, 1], sine.max(axis=1))
    return found


def chord_points(ends: Floats, bulging: Floats, points: Floats) -> tuple[Longs, Longs, Floats]:
    """Return pairs of a chord and a point on it or next to it, with the position along the chord.

    Points near the ends of a chord are ignored.

    Args:
        ends: Ends of the chords, shape (n, 2, 2).
        bulging: The :func:`bulges` of the chords, shape (n, 2); 0 finds only points that lie on the
            chords up to rounding.
        points: Points, shape (m, 2).

    Returns:
        Indices of chords, indices of points, and positions as fractions of the chord; sorted by
        chord and position.
    """
    nothing = np.zeros(0, dtype=np.int64)
    if not len(ends) or not len(points):
        return nothing, nothing, np.zeros(0)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    near = cKDTree(points).query_ball_point(ends.mean(axis=1), lengths / 2)
    chord = np.repeat(np.arange(len(ends)), [len(some) for some in near])
    point = np.concatenate([np.asarray(some, dtype=np.int64) for some in near])
    offset = points[point] - ends[chord, 0]
    e, length = along[chord] / lengths[chord, None], lengths[chord]
    at = np.einsum("ni,ni->n", offset, e) / length
    off = (offset[:, 1] * e[:, 0] - offset[:, 0] * e[:, 1]) / length
    # A point this close to an end of a chord, relative to the chord's length, counts as the end.
    at_end = 1e-6
    # Largest distance of the arc from the chord, relative to the product of the chord's length and
    # the turning angle. At the middle it is at most 1/8, or 1/4 if the next chord is far shorter.
    most = 1.25 * at * (1 - at)
    left, right = bulging[chord].T * most + _off_by_rounding(np.ones(len(at)))
    good = (off <= left) & (off >= -right) & (at > at_end) & (at < 1 - at_end)
    chord, point, at = chord[good], point[good], at[good]
    order = np.lexsort((at, chord))
    chord, point, at = chord[order], point[order], at[order]
    same = (np.diff(chord, prepend=-1) == 0) & (np.diff(at, prepend=-1.0) < at_end)
    return chord[~same], point[~same], at[~same]


def farthest(every: Floats, points: Floats) -> float | None:
    """Return the largest distance of points from the chords of a surface (length).

    Args:
        every: Ends of all chords of the surface, shape (n, 2, 2).
        points: Points, shape (m, 2).

    Returns:
        The distance, 0 if all points lie on chords; None if a point is neither on a chord nor next
        to a chord, or if there are no chords or no points.
    """
    if not len(every) or not len(points):
        return None
    points = np.unique(points, axis=0)
    lengths = np.linalg.norm(every[:, 1] - every[:, 0], axis=1)
    away, _ = cKDTree(every.reshape(-1, 2)).query(points)
    known = away <= _off_by_rounding(lengths).min()
    known[chord_points(every, np.zeros((len(every), 2)), points)[1]] = True
    chord, point, at = chord_points(every, bulges(every, every), points)
    beside = ~known[point]
    chord, point, at = chord[beside], point[beside], at[beside]
    known[point] = True
    if not known.all():
        return None
    on_chord = every[chord, 0] + at[:, None] * (every[chord, 1] - every[chord, 0])
    return float(np.linalg.norm(points[point] - on_chord, axis=1).max(initial=0.0))


def _off_by_rounding(lengths: Floats) -> Floats:
    """Return the distances up to which points count as lying on chords of given lengths."""
    return 1e-8 * lengths


def surface_ends(tagged_mesh: TaggedMesh, surface: str) -> Floats:
    """Return the ends of all outer facets of a surface in the plane. Collective.

    Returns:
        The ends, shape (num_facets, 2, 2), the same on each rank.
    """
    outer = outer_facets(tagged_mesh.mesh)
    ends, _ = _facets(tagged_mesh, outer, surface)
    return np.concatenate(tagged_mesh.mesh.comm.allgather(ends))


def divided(
    tagged_mesh: TaggedMesh, surface: str, points: Floats, every: Floats | None = None
) -> TaggedMesh:
    """Return the mesh with cells divided at points on the facets of a surface. Collective.

    A cell with two facets on the surface is not divided. Points near ends of facets are ignored.

    Args:
        tagged_mesh: Plane bodies of straight cells, without ghost cells.
        surface: The surface.
        points: Points, the same on each rank, shape (num_points, 2).
        every: Ends of all facets of the surface, shape (num_facets, 2, 2). If given, points next to
            facets that lie on the approximated curve become vertices too.

    Returns:
        The mesh, with the cells on the same ranks; the given mesh if no cell is divided.

    Raises:
        InputError: If a division would fold a thin cell over.
    """
    mesh = tagged_mesh.mesh
    comm, topology = mesh.comm, mesh.topology
    outer = outer_facets(mesh)
    ends, chosen = _facets(tagged_mesh, outer, surface)
    bulging = np.zeros((len(ends), 2)) if every is None else bulges(ends, every)
    points = np.unique(points, axis=0)
    facet, point, at = chord_points(ends, bulging, points)
    cells, places = outer.cells[chosen], outer.places[chosen]
    once = np.flatnonzero(np.bincount(cells, minlength=1)[cells] == 1) if len(cells) else cells
    kept = np.isin(facet, once)
    facet, point, at = facet[kept], point[kept], at[kept]
    if not comm.allreduce(len(facet)):
        return tagged_mesh

    vertices, known = corners(mesh)
    owned = topology.index_map(0).size_local
    new = points[point]
    opposite = known[vertices[cells[facet], places[facet]]]
    raise_together(comm, _folded(surface, ends[facet], new, opposite))
    known = _snapped(known, points)
    first = comm.exscan(owned + len(new)) or 0
    numbers = _numbers(topology.index_map(0), first)
    of_cells = numbers[vertices].astype(np.int64)
    cut, counts = np.unique(facet, return_counts=True)
    chains = _chains(of_cells[cells[cut]], places[cut], counts, first + owned)
    whole = np.setdiff1d(np.arange(len(vertices)), cells[cut])
    parents = np.concatenate([whole, np.repeat(cells[cut], counts + 1)])
    triangles = np.concatenate([of_cells[whole], chains])
    element = basix.ufl.element("Lagrange", topology.cell_name(), 1, shape=(2,), dtype=known.dtype)
    first_cell = comm.exscan(len(triangles)) or 0
    finer = create_mesh(
        comm,
        triangles,
        x=np.concatenate([known[:owned], new]),
        e=ufl.Mesh(element),
        partitioner=sent_to(np.full(len(triangles), comm.rank)),
    )
    tags = _tags(tagged_mesh, len(vertices))
    of_part = tags[parents[finer.topology.original_cell_index - first_cell]]

    topology.create_connectivity(1, 0)
    to_vertices = numbers[topology.connectivity(1, 0).array.reshape(-1, 2)].astype(np.int64)
    facets, values = tagged_mesh.facet_tags.indices, tagged_mesh.facet_tags.values
    gone = outer.facets[chosen][cut]
    left = (facets < topology.index_map(1).size_local) & ~np.isin(facets, gone)
    of_gone = values[np.searchsorted(facets, gone)].astype(np.int32)
    return TaggedMesh(
        finer,
        cell_meshtags(finer, of_part),
        distributed_tags(
            finer,
            1,
            np.concatenate([to_vertices[facets[left]], chains[:, :2]]),
            np.concatenate([values[left].astype(np.int32), np.repeat(of_gone, counts + 1)]),
        ),
        tagged_mesh.volumes,
        tagged_mesh.surfaces,
        tagged_mesh.section,
        taken=tagged_mesh.taken,
    )


def _numbers(vertices: IndexMap, first: int) -> Longs:
    """Return new global numbers of the local vertices; each rank's numbers begin at its ``first``.

    Collective.
    """
    numbers = la.vector(vertices, 1, dtype=np.int64)
    numbers.array[: vertices.size_local] = first + np.arange(vertices.size_local)
    numbers.scatter_forward()
    return np.asarray(numbers.array, dtype=np.int64)


def _tags(tagged_mesh: TaggedMesh, count: int) -> Ints:
    """Return the tags of the ``count`` cells that this rank owns, shape (count,)."""
    tags = np.zeros(count, dtype=np.int32)
    mine = tagged_mesh.cell_tags.indices < count
    tags[tagged_mesh.cell_tags.indices[mine]] = tagged_mesh.cell_tags.values[mine]
    return tags


def _snapped(places: Floats, points: Floats) -> Floats:
    """Return ``places``, moved onto points that coincide with them up to rounding.

    The coordinates of surfaces that are meshed separately differ by rounding errors, such as 3e-12.
    With pressures of a hundred times the strength, no admissible stress satisfies equilibrium
    across such a step.

    Args:
        places: Positions, shape (n, 2).
        points: Points, at least one, shape (num_points, 2).
    """
    same = 1e-9 * float(np.ptp(points, axis=0).max())
    apart, nearest = cKDTree(points).query(places, distance_upper_bound=same)
    at = np.isfinite(apart)
    found = places.copy()
    found[at] = points[nearest[at]]
    return found


def _facets(tagged_mesh: TaggedMesh, outer: OuterFacets, surface: str) -> tuple[Floats, Longs]:
    """Return the ends of a surface's owned facets, shape (n, 2, 2), and their ``outer`` indices."""
    topology = tagged_mesh.mesh.topology
    owned = outer.facets < topology.index_map(1).size_local
    chosen = np.flatnonzero(owned & np.isin(outer.facets, tagged_mesh.facets(surface)))
    vertices, points = corners(tagged_mesh.mesh)
    return points[_ends(vertices[outer.cells[chosen]], outer.places[chosen])], chosen


def _ends(cells: Ints | Longs, places: Ints) -> Longs:
    """Return the vertices of the facets opposite the local vertices ``places``, shape (n, 2)."""
    others = np.column_stack([(places + 1) % 3, (places + 2) % 3])
    return np.take_along_axis(cells.astype(np.int64), others.astype(np.int64), axis=1)


def _folded(surface: str, ends: Floats, new: Floats, opposite: Floats) -> str | None:
    """Return a message if a division folds a cell over, otherwise None."""

    def turn(a: Floats, b: Floats) -> Floats:
        one, other = a - opposite, b - opposite
        return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])

    whole = turn(ends[:, 0], ends[:, 1])
    if all((part * whole > 0).all() for part in (turn(ends[:, 0], new), turn(new, ends[:, 1]))):
        return None
    return (
        f"a cell at '{surface}' is too thin for the curvature of the surface; refine the mesh at "
        "this surface, or give both surfaces the same nodes."
    )


def _chains(cells: Longs, places: Ints, counts: Longs, first: int) -> Longs:
    """Return the parts of divided cells: two vertices on the facet, and the opposite vertex.

    Args:
        cells: Vertices of the cells, shape (n, 3).
        places: Local index of the vertex opposite the divided facet.
        counts: Number of new vertices on each facet, at least 1.
        first: Number of the first new vertex.
    """
    ends = _ends(cells, places)
    opposite = np.take_along_axis(cells, places[:, None].astype(np.int64), axis=1)[:, 0]
    parts = counts + 1
    last = np.cumsum(parts) - 1
    begins = np.empty(parts.sum(), dtype=np.int64)
    new = first + np.arange(counts.sum())
    is_first = np.zeros(len(begins), dtype=bool)
    is_first[last - counts] = True
    begins[is_first], begins[~is_first] = ends[:, 0], new
    finishes = np.empty_like(begins)
    is_last = np.zeros(len(begins), dtype=bool)
    is_last[last] = True
    finishes[is_last], finishes[~is_last] = ends[:, 1], new
    return np.column_stack([begins, finishes, np.repeat(opposite, parts)])
