"""Find boundary points of a plane mesh at which the stress depends only on the direction.

There every cell has one stress, so that the angles of the cells limit the lower bound, whatever the
mesh elsewhere.
"""

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.given import Given


def singular_points(tagged_mesh: TaggedMesh, given: Given, valence: int, ends: bool = True) -> Ints:
    """Return local vertices of a plane mesh that need more cells. Collective.

    These are ends of loads, supports and contacts, and corners, at which the principal stresses
    rotate and too few cells meet.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.
        valence: Required number of cells where principal stresses may rotate by a right angle, as
            at the end of a load on a straight side. At an end they rotate by the body's angle minus
            a right angle; elsewhere by the body's angle minus a straight angle. For smaller
            rotations proportionally fewer cells suffice.
        ends: Whether to include ends of loads, supports and contacts, or only corners.
    """
    turn, cells, at_ends = turns_at_vertices(tagged_mesh, given)
    wanted = valence * turn * (ends | ~at_ends)
    return np.flatnonzero(cells < wanted).astype(np.int32)


def turns_at_vertices(
    tagged_mesh: TaggedMesh, given: Given
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return by how much principal stresses may rotate at local vertices. Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.

    Returns:
        Rotations in right angles, 0 to 1, and 0 inside; the number of cells that meet; and whether
        a load, support or contact ends.
    """
    topology = tagged_mesh.mesh.topology
    vertices, points = corners(tagged_mesh.mesh)
    angle = angles_at_corners(points[vertices])
    topology.create_connectivity(1, 2)
    topology.create_connectivity(1, 0)
    outer = exterior_facet_indices(topology)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[outer]
    kind = kinds_of_facets(tagged_mesh, given)[outer]

    count = topology.index_map(0).size_local + topology.index_map(0).num_ghosts
    sums = la.vector(topology.index_map(0), 5, dtype=np.float64)
    table = sums.array.reshape(count, 5)
    np.add.at(table, vertices.ravel(), _columns(angle.ravel(), 1.0, 0.0, 0.0, 0.0))
    twice = np.repeat(kind, 2).astype(np.float64)
    np.add.at(table, ends.ravel(), _columns(0.0, 0.0, np.ones(twice.size), twice, twice**2))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    angles, cells, facets, kinds, squares = table.T
    turn = (facets > 0) * turns(angles, facets, kinds, squares)
    return turn, cells.copy(), _changes(facets, kinds, squares)


def angles_at_corners(x: Floats) -> Floats:
    """Return angles of triangles, shape (n, 3).

    Args:
        x: Their vertices, shape (n, 3, 2).
    """
    one, other = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    across = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    angles: Floats = np.arctan2(np.abs(across), np.einsum("cvi,cvi->cv", one, other))
    return angles


def turns(angles: Floats, facets: Floats, kinds: Floats, squares: Floats) -> Floats:
    """Return how far principal stresses may rotate where outer facets meet, in right angles.

    Args:
        angles: Angles of the body between the facets, shape (n,).
        facets: Number of facets that meet.
        kinds: Sum of their numbers from :func:`kinds_of_facets`.
        squares: Sum of the squares of these numbers.
    """
    right = np.pi / 2
    rounding = 1e-6  # excess over a straight angle that is rounding
    least = np.where(_changes(facets, kinds, squares), right, np.pi) + rounding
    return np.asarray(np.clip(angles - least, 0.0, right) / right, dtype=np.float64)


def _changes(facets: Floats, kinds: Floats, squares: Floats) -> npt.NDArray[np.bool_]:
    """Return where facets differ in kind, so that their mean has another square."""
    unlike: npt.NDArray[np.bool_] = facets * squares - kinds**2 > 0.5
    return unlike


def _columns(*columns: Floats | float) -> Floats:
    return np.stack(np.broadcast_arrays(*columns), axis=1)


def kinds_of_facets(tagged_mesh: TaggedMesh, given: Given) -> Longs:
    """Return a number for each local facet, equal for facets with the same loads and supports.

    Collective.
    """
    loads = [load for load in given.loads if not load.in_volume]
    tags = tagged_mesh.tags_of(tagged_mesh.surfaces)
    acting: dict[int, set[Hashable]] = {tag: set() for tag in tags}
    surroundings: list[Any] = [*given.supports, *given.rigid, *loads, *given.obstacles]
    what_on = [(repr(replace(what, on="")), what.on) for what in surroundings]
    what_on += [("contact", name) for it in given.contacts for name in (it.primary, it.secondary)]
    for acts, name in what_on:
        for tag in tagged_mesh.tags_of([name]):
            acting[tag].add(acts)
    known = list(dict.fromkeys([frozenset[Hashable](), *map(frozenset, acting.values())]))
    topology = tagged_mesh.mesh.topology
    facets = topology.index_map(topology.dim - 1)
    kinds = np.zeros(facets.size_local + facets.num_ghosts, dtype=np.int64)
    for tag, held in acting.items():
        kinds[tagged_mesh.facet_tags.find(tag)] = known.index(frozenset(held))
    return kinds
