"""Cells of plane bodies divided at a surface, where the nodes of another one lie on it.

A cell is divided from the vertex opposite, so that the rest of the mesh stays as it is. Where that
is done on both sides of an interface their facets match.
"""

import basix.ufl
import numpy as np
import ufl
from dolfinx import la
from dolfinx.mesh import create_mesh, meshtags
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import sent_to
from perfplast_fenicsx.mesh.straight_geometry import OuterFacets, corners, outer_facets
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, distributed_tags


def surface_points(tagged_mesh: TaggedMesh, surface: str) -> Floats:
    """Ends of the outer facets of a plane surface, those of all ranks. Collective.

    Returns:
        Shape (num_points, 2), known to each rank.
    """
    outer = outer_facets(tagged_mesh.mesh)
    ends, _ = _facets(tagged_mesh, outer, surface)
    return np.concatenate(tagged_mesh.mesh.comm.allgather(ends.reshape(-1, 2)))


def divided(tagged_mesh: TaggedMesh, surface: str, points: Floats) -> TaggedMesh:
    """The mesh with cells divided where points lie inside of facets of a surface. Collective.

    A cell that has two facets of the surface is left, and so are points near the ends of a facet.

    Args:
        tagged_mesh: Plane bodies of straight cells, without ghost cells.
        surface: The surface.
        points: The same on each rank, shape (num_points, 2).

    Returns:
        The mesh, cells on the same ranks; itself where nothing is to be divided.
    """
    mesh = tagged_mesh.mesh
    comm, topology = mesh.comm, mesh.topology
    outer = outer_facets(mesh)
    ends, chosen = _facets(tagged_mesh, outer, surface)
    facet, at = _inside(ends, points)
    cells, places = outer.cells[chosen], outer.places[chosen]
    once = np.flatnonzero(np.bincount(cells, minlength=1)[cells] == 1) if len(cells) else cells
    kept = np.isin(facet, once)
    facet, at = facet[kept], at[kept]
    if not comm.allreduce(len(facet)):
        return tagged_mesh

    vertices, known = corners(mesh)
    owned = topology.index_map(0).size_local
    new = _between(ends, facet, at)
    first = comm.exscan(owned + len(new)) or 0
    numbers = la.vector(topology.index_map(0), 1, dtype=np.int64)
    numbers.array[:owned] = first + np.arange(owned)
    numbers.scatter_forward()
    of_cells = numbers.array[vertices].astype(np.int64)
    cut, counts = np.unique(facet, return_counts=True)
    chains = _chains(of_cells[cells[cut]], places[cut], counts, first + owned)
    whole = np.setdiff1d(np.arange(len(vertices)), cells[cut])
    parents = np.concatenate([whole, np.repeat(cells[cut], counts + 1)])
    every = np.concatenate([of_cells[whole], chains])
    element = basix.ufl.element("Lagrange", topology.cell_name(), 1, shape=(2,), dtype=known.dtype)
    first_cell = comm.exscan(len(every)) or 0
    finer = create_mesh(
        comm,
        every,
        x=np.concatenate([known[:owned], new]),
        e=ufl.Mesh(element),
        partitioner=sent_to(np.full(len(every), comm.rank)),
    )
    tags = np.zeros(len(vertices), dtype=np.int32)
    mine = tagged_mesh.cell_tags.indices < len(vertices)
    tags[tagged_mesh.cell_tags.indices[mine]] = tagged_mesh.cell_tags.values[mine]
    of_part = tags[parents[finer.topology.original_cell_index - first_cell]]

    topology.create_connectivity(1, 0)
    to_vertices = numbers.array[topology.connectivity(1, 0).array.reshape(-1, 2)].astype(np.int64)
    facets, values = tagged_mesh.facet_tags.indices, tagged_mesh.facet_tags.values
    gone = outer.facets[chosen][cut]
    left = (facets < topology.index_map(1).size_local) & ~np.isin(facets, gone)
    of_gone = np.zeros(len(gone), dtype=np.int32)
    of_gone[:] = tagged_mesh.surfaces[surface]
    return TaggedMesh(
        finer,
        meshtags(finer, 2, np.arange(len(of_part), dtype=np.int32), of_part),
        distributed_tags(
            finer,
            1,
            np.concatenate([to_vertices[facets[left]], chains[:, :2]]),
            np.concatenate([values[left].astype(np.int32), np.repeat(of_gone, counts + 1)]),
        ),
        tagged_mesh.volumes,
        tagged_mesh.surfaces,
        tagged_mesh.section,
    )


def _facets(tagged_mesh: TaggedMesh, outer: OuterFacets, surface: str) -> tuple[Floats, Longs]:
    """Ends of the owned outer facets of a surface, shape (n, 2, 2), and which of ``outer``."""
    topology = tagged_mesh.mesh.topology
    owned = outer.facets < topology.index_map(1).size_local
    chosen = np.flatnonzero(owned & np.isin(outer.facets, tagged_mesh.facets(surface)))
    vertices, points = corners(tagged_mesh.mesh)
    return points[_ends(vertices[outer.cells[chosen]], outer.places[chosen])], chosen


def _ends(cells: Ints | Longs, places: Ints) -> Longs:
    """Vertices of the facets opposite to places in cells, shape (n, 2)."""
    others = np.column_stack([(places + 1) % 3, (places + 2) % 3])
    return np.take_along_axis(cells.astype(np.int64), others.astype(np.int64), axis=1)


def _inside(ends: Floats, points: Floats) -> tuple[Longs, Floats]:
    """Facets that points lie inside of, and where between the ends, in this order."""
    nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
    if not len(ends) or not len(points):
        return nothing
    points = np.unique(points, axis=0)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    near = cKDTree(points).query_ball_point(ends.mean(axis=1), lengths / 2)
    facet = np.repeat(np.arange(len(ends)), [len(some) for some in near])
    found = np.concatenate([np.asarray(some, dtype=np.int64) for some in near])
    offset = points[found] - ends[facet, 0]
    e = along[facet] / lengths[facet, None]
    at = np.einsum("ni,ni->n", offset, e) / lengths[facet]
    off = np.abs(offset[:, 0] * e[:, 1] - offset[:, 1] * e[:, 0])
    # Distance of a point from a facet that it lies on, relative to the facet.
    on_facet = 1e-8
    # Distance of a point from an end of a facet, relative to the facet, that makes it the end.
    at_end = 1e-6
    good = (off <= on_facet * lengths[facet]) & (at > at_end) & (at < 1 - at_end)
    facet, at = facet[good], at[good]
    order = np.lexsort((at, facet))
    facet, at = facet[order], at[order]
    same = (np.diff(facet, prepend=-1) == 0) & (np.diff(at, prepend=-1.0) < at_end)
    return facet[~same], at[~same]


def _between(ends: Floats, facet: Longs, at: Floats) -> Floats:
    """The points on the facets, shape (n, 2)."""
    found: Floats = ends[facet, 0] + at[:, None] * (ends[facet, 1] - ends[facet, 0])
    return found


def _chains(cells: Longs, places: Ints, counts: Longs, first: int) -> Longs:
    """Parts of cells: the ends of their facet, and the vertex opposite.

    Args:
        cells: Numbers of their vertices, shape (n, 3).
        places: Of the vertex opposite the facet that is divided.
        counts: New vertices on that, at least 1.
        first: Number of the first of them.
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
