"""Divide cells of plane bodies at a surface where nodes of another surface lie on it.

A cell is divided from its opposite vertex, so that the rest of the mesh does not change. After a
division on both sides of an interface, their facets match.
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
from perfplast_fenicsx.mesh.chord_points import bulges, chord_points
from perfplast_fenicsx.mesh.straight_geometry import OuterFacets, corners, outer_facets
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, distributed_tags
from perfplast_fenicsx.mesh.tags_of_cells import cell_meshtags


def surface_ends(tagged_mesh: TaggedMesh, surface: str) -> Floats:
    """Return the ends of the outer facets of a plane surface on all ranks. Collective.

    Returns:
        Ends, shape (num_facets, 2, 2), the same on each rank.
    """
    outer = outer_facets(tagged_mesh.mesh)
    ends, _ = _facets(tagged_mesh, outer, surface)
    return np.concatenate(tagged_mesh.mesh.comm.allgather(ends))


def divided(
    tagged_mesh: TaggedMesh, surface: str, points: Floats, every: Floats | None = None
) -> TaggedMesh:
    """Return the mesh with cells divided where points lie inside facets of a surface. Collective.

    A cell with two facets there is not divided. Points near the ends of a facet are ignored.

    Args:
        tagged_mesh: Plane bodies of straight cells, without ghost cells.
        surface: The surface.
        points: The same on each rank, shape (num_points, 2).
        every: Ends of all facets of the surface, shape (num_facets, 2, 2), if points next to them,
            as on a curve, become vertices too (:mod:`chord_points`).

    Returns:
        The mesh, with cells on the same ranks; the given mesh if nothing is divided.

    Raises:
        InputError: If a cell is thinner than the bend of its facet.
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
    """Return numbers of the vertices that this rank knows, those of each rank from its first on.

    Collective.
    """
    numbers = la.vector(vertices, 1, dtype=np.int64)
    numbers.array[: vertices.size_local] = first + np.arange(vertices.size_local)
    numbers.scatter_forward()
    return np.asarray(numbers.array, dtype=np.int64)


def _tags(tagged_mesh: TaggedMesh, count: int) -> Ints:
    """Return the tags of the cells that this rank owns, shape (count,)."""
    tags = np.zeros(count, dtype=np.int32)
    mine = tagged_mesh.cell_tags.indices < count
    tags[tagged_mesh.cell_tags.indices[mine]] = tagged_mesh.cell_tags.values[mine]
    return tags


def _snapped(places: Floats, points: Floats) -> Floats:
    """Return positions moved onto coinciding points, so that both sides have one number.

    Surfaces that are meshed apart differ by the rounding of their file, such as 3e-12. With
    pressures of a hundred times the strength, no stress satisfies equilibrium over such a step.

    Args:
        places: Positions, shape (n, 2).
        points: Points, shape (num_points, 2), at least one.
    """
    same = 1e-9 * float(np.ptp(points, axis=0).max())
    apart, nearest = cKDTree(points).query(places, distance_upper_bound=same)
    at = np.isfinite(apart)
    found = places.copy()
    found[at] = points[nearest[at]]
    return found


def _facets(tagged_mesh: TaggedMesh, outer: OuterFacets, surface: str) -> tuple[Floats, Longs]:
    """Return ends of a surface's owned outer facets, shape (n, 2, 2), and indices in ``outer``."""
    topology = tagged_mesh.mesh.topology
    owned = outer.facets < topology.index_map(1).size_local
    chosen = np.flatnonzero(owned & np.isin(outer.facets, tagged_mesh.facets(surface)))
    vertices, points = corners(tagged_mesh.mesh)
    return points[_ends(vertices[outer.cells[chosen]], outer.places[chosen])], chosen


def _ends(cells: Ints | Longs, places: Ints) -> Longs:
    """Return vertices of the facets opposite to places in cells, shape (n, 2)."""
    others = np.column_stack([(places + 1) % 3, (places + 2) % 3])
    return np.take_along_axis(cells.astype(np.int64), others.astype(np.int64), axis=1)


def _folded(surface: str, ends: Floats, new: Floats, opposite: Floats) -> str | None:
    """Return a message if a new vertex lies on the wrong side of the opposite vertex, else None."""

    def turn(a: Floats, b: Floats) -> Floats:
        one, other = a - opposite, b - opposite
        return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])

    whole = turn(ends[:, 0], ends[:, 1])
    if all((part * whole > 0).all() for part in (turn(ends[:, 0], new), turn(new, ends[:, 1]))):
        return None
    return (
        f"a cell at '{surface}' is thinner than the curve beside its facet is high; refine the mesh"
        " there, or give both surfaces the same nodes."
    )


def _chains(cells: Longs, places: Ints, counts: Longs, first: int) -> Longs:
    """Return parts of cells: the ends of their facet, and the opposite vertex.

    Args:
        cells: Vertices of the cells, shape (n, 3).
        places: Index of the vertex opposite the divided facet.
        counts: Number of new vertices on it, at least 1.
        first: Index of the first new vertex.
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
