"""Find points, edges and cells that need a finer mesh regardless of error indicators.

At a singular point, each cell has only one stress. The angles of the cells therefore limit the
lower bound, however fine the mesh is elsewhere.

In 3D, the stress around a singular edge depends only on the direction, as at a singular point in
the plane normal to the edge. Bisection adds no new directions, at any cell size. Fans of cells
around the edge add directions.

In 2D, cells may be too wide where loads, supports or contacts end. Principal stresses rotate at
such points. A lower bound needs edges in many directions that all reach equally far, and therefore
long and thin cells. Next to a side with known traction, the stress is uniform within a certain
angle. Long cells within this angle do not improve the lower bound, and they worsen the mechanism.

The module also refines 3D edges at which a shear traction ends and too few cells balance the
traction. Stresses are symmetric: for a single stress at an edge, the traction on each side has the
same component along the normal of the other side. The given tractions may violate this condition,
for example with a shear traction next to a free side. Then the stress must change from one side to
the other, in as many steps as there are cells. With one or two cells, the lower bound is a small
part of the body's limit load. Bisection does not raise this bound, because the number of cells at
the edge remains the same.

Finally, the module divides 2D corners whose single cell cannot balance its loads. The stress of a
cell has three components at a corner. The tractions on both sides of the corner prescribe up to
four combinations of these components. For example, a pressure next to a free side prescribes four
combinations. They contradict each other unless the sides are at right angles, and the stress then
balances no load at all. A free side next to contact prescribes three combinations, which determine
the contact pressure in the corner, often as zero. A free side next to a surface with friction
prescribes two combinations; shear and pressure are then proportional, whatever the adhesion is. Two
cells that meet in the corner have six components, and the tractions prescribe at most six
combinations.

In 3D, corners need no division, because each cell consists of four parts (:mod:`stress_cells`).
Three parts meet at a vertex that belongs to a single cell, and their stresses at this vertex have
18 components. The tractions on three facets, and continuity at three facets between the parts, are
also 18 conditions. These conditions are regular for one tetrahedron, and therefore for all
tetrahedra, because Piola's transformation maps symmetric stresses to symmetric stresses and
tractions to tractions.
"""

import logging
from collections.abc import Hashable
from dataclasses import replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.bound_problems import with_matching_facets
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, bare_vertices, bound_body
from perfplast_fenicsx.mesh.bisection import edges_of_simplex
from perfplast_fenicsx.mesh.refinement import fan, fan_around
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import sums_at
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING

log = logging.getLogger(__name__)


def singular_points(tagged_mesh: TaggedMesh, given: Given, valence: int, ends: bool = True) -> Ints:
    """Return local vertices of a plane mesh that need more cells. Collective.

    At these vertices too few cells meet, and principal stresses rotate: at the ends of loads,
    supports and contacts, and at corners.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.
        valence: Required number of cells where principal stresses may rotate by a right angle, as
            at the end of a load on a straight side. At an end, principal stresses rotate by the
            body's angle minus a right angle; elsewhere by the body's angle minus a straight angle.
            Smaller rotations need proportionally fewer cells.
        ends: Whether to include ends of loads, supports and contacts, or only corners.
    """
    turn, cells, at_ends = turns_at_vertices(tagged_mesh, given)
    wanted = valence * turn * (ends | ~at_ends)
    return np.flatnonzero(cells < wanted).astype(np.int32)


def turns_at_vertices(
    tagged_mesh: TaggedMesh, given: Given
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return the possible rotation of principal stresses at local vertices. Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.

    Returns:
        Rotations in right angles, from 0 to 1, with 0 at interior vertices; the number of cells
        that meet at each vertex; and whether a load, support or contact ends at the vertex.
    """
    topology = tagged_mesh.mesh.topology
    vertices, points = corners(tagged_mesh.mesh)
    angle = angles_at_corners(points[vertices])
    topology.create_connectivity(1, 2)
    topology.create_connectivity(1, 0)
    outer = exterior_facet_indices(topology)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[outer]
    kind = kinds_of_facets(tagged_mesh, given)[outer]

    twice = np.repeat(kind, 2).astype(np.float64)
    of_cells = _columns(angle.ravel(), 1.0, 0.0, 0.0, 0.0)
    of_facets = _columns(0.0, 0.0, np.ones(twice.size), twice, twice**2)
    parts = (vertices.ravel(), of_cells), (ends.ravel(), of_facets)
    table = sums_at(topology.index_map(0), 5, *parts)
    angles, cells, facets, kinds, squares = table.T
    turn = (facets > 0) * turns(angles, facets, kinds, squares)
    return turn, cells.copy(), _changes(facets, kinds, squares)


def angles_at_corners(x: Floats) -> Floats:
    """Return the angles at the corners of triangles, shape (n, 3).

    Args:
        x: Vertices of the triangles, shape (n, 3, 2).
    """
    one, other = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    across = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    angles: Floats = np.arctan2(np.abs(across), np.einsum("cvi,cvi->cv", one, other))
    return angles


def turns(angles: Floats, facets: Floats, kinds: Floats, squares: Floats) -> Floats:
    """Return the possible rotation of principal stresses where outer facets meet, in right angles.

    Args:
        angles: Angles of the body between the facets, shape (n,).
        facets: Number of facets that meet.
        kinds: Sum of the numbers of these facets from :func:`kinds_of_facets`.
        squares: Sum of the squares of these numbers.
    """
    right = np.pi / 2
    rounding = 1e-6  # excess over a straight angle that counts as rounding
    least = np.where(_changes(facets, kinds, squares), right, np.pi) + rounding
    return np.asarray(np.clip(angles - least, 0.0, right) / right, dtype=np.float64)


def _changes(facets: Floats, kinds: Floats, squares: Floats) -> npt.NDArray[np.bool_]:
    """Return flags of the places where facets of different kinds meet."""
    unlike: npt.NDArray[np.bool_] = facets * squares - kinds**2 > 0.5
    return unlike


def _columns(*columns: Floats | float) -> Floats:
    return np.stack(np.broadcast_arrays(*columns), axis=1)


def kinds_of_facets(tagged_mesh: TaggedMesh, given: Given) -> Longs:
    """Return a number for each local facet, equal for facets with equal conditions. Collective.

    The conditions are loads, supports, rigid surfaces, obstacles, and whether there is a contact.
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


def singular_edges(tagged_mesh: TaggedMesh, given: Given, valence: int) -> npt.NDArray[np.bool_]:
    """Return flags of the edges of owned cells that need more cells around them. Collective.

    Args:
        tagged_mesh: Mesh of tetrahedra.
        given: Its loads, supports and contacts.
        valence: Required number of cells around an edge at which principal stresses may rotate by a
            right angle (:func:`singular_points.singular_points`).

    Returns:
        Flags in DOLFINx's order of edges, shape (num_cells, 6).
    """
    topology = tagged_mesh.mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    topology.create_connectivity(2, 1)
    topology.create_connectivity(2, 3)
    cells, points = corners(tagged_mesh.mesh)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[: len(cells)]
    outer = exterior_facet_indices(topology)
    sides = topology.connectivity(2, 1).array.reshape(-1, 3)[outer]
    kind = np.repeat(kinds_of_facets(tagged_mesh, given)[outer], 3).astype(np.float64)

    angle = angles_at_edges(points[cells]).ravel()
    of_cells = _columns(angle, 1.0, 0.0, 0.0, 0.0)
    of_sides = _columns(0.0, 0.0, np.ones(kind.size), kind, kind**2)
    parts = (of_cell.ravel(), of_cells), (sides.ravel(), of_sides)
    table = sums_at(topology.index_map(1), 5, *parts)
    angles, around, facets, kinds, squares = table.T
    wanted = valence * turns(angles, facets, kinds, squares)
    wanting: npt.NDArray[np.bool_] = ((facets > 0) & (around < wanted))[of_cell]
    return wanting


def angles_at_edges(x: Floats) -> Floats:
    """Return the angle between the two faces that meet at each edge of tetrahedra.

    Args:
        x: Corners of tetrahedra, shape (num_cells, 4, 3).

    Returns:
        Angles, shape (num_cells, 6).
    """
    ends = edges_of_simplex(3)
    others = ends[::-1]  # edge k is opposite edge 5 - k
    along = x[:, ends[:, 1]] - x[:, ends[:, 0]]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    one, other = (
        away - np.einsum("cei,cei->ce", away, along)[..., None] * along
        for away in (x[:, others[:, k]] - x[:, ends[:, 0]] for k in (0, 1))
    )
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    angles: Floats = np.arctan2(across, np.einsum("cei,cei->ce", one, other))
    return angles


Flags = npt.NDArray[np.bool_]


def wide_corners(
    tagged_mesh: TaggedMesh, given: Given, gap: float | None = None
) -> tuple[Flags, Flags]:
    """Return flags of too wide corners at singular points, and of all corners at singular points.

    Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.
        gap: Relative gap of the bounds on this mesh. The part of the gap due to an angle is
            proportional to the square of the angle. The allowed angles are therefore halved once
            the bounds are close, and again each time the gap falls to a quarter.

    Returns:
        Two arrays of shape (num_cells, 3).
    """
    widest = np.deg2rad(7.5)  # largest angle for rotations by a right angle; larger otherwise
    near_enough = 0.004  # gap at which angles are halved; the angles cause a third of this gap
    if gap is not None and 0 < gap < near_enough:
        widest /= 2.0 ** np.ceil(np.log(near_enough / gap) / np.log(4.0))
    near = np.deg2rad(42.0)  # angle from a side; without friction, stress is uniform within 45°
    topology = tagged_mesh.mesh.topology
    vertices, points = corners(tagged_mesh.mesh)
    vertices = vertices[: topology.index_map(2).size_local]
    x = points[vertices]
    turn, _, at_ends = turns_at_vertices(tagged_mesh, given)
    turn = (turn * at_ends)[vertices]
    wide = angles_at_corners(x) * turn > widest
    return wide & (_from_sides(tagged_mesh, points, vertices) > near), turn > 0


def _from_sides(tagged_mesh: TaggedMesh, points: Floats, vertices: Ints) -> Floats:
    """Return for each corner the larger of its two edges' angles to the nearer side. Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        points: Coordinates of the local vertices.
        vertices: Vertices of the owned cells, shape (num_cells, 3).

    Returns:
        Angles, shape (num_cells, 3); not valid at vertices where no two sides meet.
    """
    topology = tagged_mesh.mesh.topology
    outer = exterior_facet_indices(topology)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[outer]
    along = _directions(points[ends[:, 1]] - points[ends[:, 0]])
    # Complex numbers represent the directions of the two sides at a vertex. The sum of these
    # numbers and the sum of their squares determine both numbers.
    sums = la.vector(topology.index_map(0), 4, dtype=np.float64)
    table = sums.array.reshape(-1, 2, 2)
    for end, direction in ((0, along), (1, -along)):
        powers = np.stack([direction, direction**2], axis=1)
        np.add.at(table, ends[:, end], np.stack([powers.real, powers.imag], axis=2))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    whole, squares = (table[:, k, 0] + 1j * table[:, k, 1] for k in (0, 1))
    root = np.sqrt(2 * squares - whole**2)
    sides = np.stack([whole + root, whole - root], axis=1)[vertices]

    x = points[vertices]
    edges = np.stack([_directions(np.roll(x, -k, axis=1) - x) for k in (1, 2)], axis=2)
    angles = np.abs(np.angle(edges[..., None] * np.conj(sides[:, :, None])))
    away: Floats = angles.min(axis=3).max(axis=2)
    return away


def _directions(vectors: Floats) -> npt.NDArray[np.complex128]:
    """Return plane vectors as complex numbers of modulus 1."""
    numbers = vectors[..., 0] + 1j * vectors[..., 1]
    directions: npt.NDArray[np.complex128] = numbers / np.abs(numbers)
    return directions


def with_sheared_edges_divided(problem: Problem) -> Problem:
    """Return the problem with fans around edges where a shear traction ends. Collective.

    Args:
        problem: The bodies with their loads. The function returns the problem unchanged without
            such edges, in 2D, on curved cells, and if tractions on facets are not known.
    """
    if problem.bodies.gdim == 2 or has_curved_cells(problem.tagged_mesh.mesh):
        return problem
    most = 3  # rounds of bisection, which divide a cell into up to eight cells
    for _ in range(most):
        body = bound_body(problem)
        if body.prevents is not None or not problem.as_declared:
            break
        edges = sheared_edges(problem, body)
        count = problem.comm.allreduce(int(edges.any(axis=1).sum()))
        if count == 0:
            break
        log.info("%d cells at edges where a shear traction ends are divided", count)
        pairs = opposite_vertices(problem.tagged_mesh, problem.given.contacts)
        problem = problem.on(fan_around(problem.tagged_mesh, edges, pairs).tagged_mesh)
    return problem


def sheared_edges(problem: Problem, body: BoundBody) -> npt.NDArray[np.bool_]:
    """Return flags of edges at which the shears on both sides differ and too few cells meet.

    Collective.

    Returns:
        Flags in DOLFINx's order of edges, shape (num_cells, 6).
    """
    topology = problem.tagged_mesh.mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    topology.create_connectivity(2, 1)
    topology.create_connectivity(1, 0)
    cells, points = corners(problem.tagged_mesh.mesh)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[: len(cells)]
    facets = body.geometry.exterior
    of_facet = topology.connectivity(2, 1).array.reshape(-1, 3)[facets]
    normals = body.geometry.normals(facets)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[of_facet]
    numbers = topology.index_map(0).local_to_global(np.arange(len(points), dtype=np.int32))
    sides = _sides(ends, points, numbers, body.geometry.corners(facets), normals)
    known = _told(body)[facets]
    pushes = [loads.tractions[facets].mean(axis=1) for loads in (body.live, body.dead)]

    edges = topology.index_map(1)
    sums = la.vector(edges, 14, dtype=np.float64)
    table = sums.array.reshape(edges.size_local + edges.num_ghosts, 14)
    angle = angles_at_edges(points[cells]).ravel()
    np.add.at(table[:, :2], of_cell.ravel(), np.column_stack([angle, np.ones(angle.size)]))
    of_facets = [known[:, None], normals]
    for push in pushes:
        of_facets += [push, np.einsum("fi,fi->f", push, normals)[:, None]]
    rows: Floats = np.repeat(np.hstack(of_facets).astype(np.float64)[:, None], 3, axis=1)
    rows[:, :, 4:] *= sides[:, :, None]
    np.add.at(table[:, 2:], of_facet.ravel(), rows.reshape(-1, 12))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    wrong = np.zeros(len(table), dtype=bool)
    noticed = 0.05  # relative to the largest traction; smaller differences have little effect
    for k, push in enumerate(pushes):
        # (t − s)·(m + n) − (t·m − s·n) = t·n − s·m
        at = 6 + 4 * k
        across = np.einsum("ei,ei->e", table[:, at : at + 3], table[:, 3:6]) - table[:, at + 3]
        largest = problem.comm.allreduce(np.abs(push).max(initial=0.0), MPI.MAX)
        wrong |= np.abs(across) > noticed * largest
    right = np.pi / 2
    valence = 2  # required number of cells in each right angle of the body
    rounding = 1e-6  # in numbers of cells, from rounding errors of their angles
    straight = 1.8  # angle of the body (right angles) from which an edge is not a corner
    few = table[:, 1] < valence * table[:, 0] / right - rounding
    few &= table[:, 0] < straight * right
    found: npt.NDArray[np.bool_] = (wrong & few & (table[:, 2] > 1.5))[of_cell]
    return found


def _sides(ends: Longs, points: Floats, numbers: Longs, facets: Floats, normals: Floats) -> Floats:
    """Return 1 or −1 for each edge of a facet, with opposite signs for the two facets at an edge.

    Args:
        ends: Vertices of the edges, shape (num_facets, 3, 2).
        points: Coordinates of all vertices.
        numbers: Numbers of all vertices, the same on all ranks.
        facets: Vertices of the facets, shape (num_facets, 3, 3).
        normals: Normals of the facets.
    """
    turned = np.diff(numbers[ends], axis=2) < 0
    along = np.where(turned, -1.0, 1.0) * np.diff(points[ends], axis=2)[:, :, 0]
    inwards = facets.mean(axis=1)[:, None] - points[ends].mean(axis=2)
    sides = np.sign(np.einsum("fei,fei->fe", np.cross(normals[:, None], along), inwards))
    return np.asarray(sides, dtype=np.float64)


def _told(body: BoundBody) -> npt.NDArray[np.bool_]:
    """Return flags of the facets with all components of the traction given, shape (num_facets,)."""
    told = ~np.asarray(body.facets.held.any(axis=1), dtype=np.bool_)
    told[body.facets.in_contact] = False
    told[body.facets.rubbing] = False
    told[body.rigid.surface >= 0] = False
    return told


def with_room_for_stress(problem: Problem) -> Problem:
    """Return the problem on a mesh in which all cells with an over-constrained stress are divided.

    Collective. On this mesh, the facets of contacts and ties match where possible, and ties are
    glued.

    Args:
        problem: The bodies with their loads.
    """
    problem = with_sheared_edges_divided(with_divided_corners(with_matching_facets(problem)))
    return with_divided_bare_cells(problem)


def with_divided_corners(problem: Problem) -> Problem:
    """Return the problem on a mesh with two cells in each corner of :func:`lone_corners`.

    Collective.

    The function divides the cell in each such corner from the corner to the midpoint of the
    opposite edge. Without such corners, it returns the problem itself.

    Args:
        problem: The bodies with their loads. In 3D, on curved cells, and if the data of the facets
            do not determine their tractions, the function returns the problem unchanged.
    """
    tagged_mesh = problem.tagged_mesh
    if problem.bodies.gdim == 3 or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    body = bound_body(problem)
    if body.prevents is not None:
        return problem
    points = lone_corners(problem, body)
    count = problem.comm.allreduce(len(points))
    if count == 0:
        return problem
    log.info("%d corners that consist of one cell and could not carry loads are divided", count)
    pairs = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(fan(tagged_mesh, points, pairs).tagged_mesh)


def lone_corners(problem: Problem, body: BoundBody) -> Ints:
    """Return local vertices where a single cell allows no stress or no contact force. Collective.

    Only the rank that owns the cell returns the vertex.
    """
    topology, facets = problem.tagged_mesh.mesh.topology, body.numbers.facets
    outside = np.isin(facets, exterior_facet_indices(topology))
    # Facets at each vertex of a triangle: the facets opposite the other two vertices.
    others = np.array([[1, 2], [0, 2], [0, 1]])
    cell, corner = np.nonzero(outside[:, others].all(axis=2))
    side = others[corner]
    here = facets[cell[:, None], side]
    slopes, _ = gradients(body.vertices[cell])
    normal = -slopes[np.arange(len(cell))[:, None], side]
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)

    axes, told = body.facets.axes[here], ~body.facets.held[here]
    pressed = np.isin(here, body.facets.in_contact)
    told[..., 0] &= ~pressed  # the contact pressure is not known
    told[body.rigid.surface[here] >= 0] = False  # only resultants are known
    rubs = np.isin(here, body.facets.rubbing)
    told[rubs] = False  # the shear traction is not known
    # Basis of in-plane stresses.
    components: Floats = np.array(
        [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]]], dtype=float
    )
    every = np.einsum("nfai,nfj,mij->nfam", axes, normal, components)
    rows = (every * told[..., None]).reshape(-1, 4, 3)
    beside = corner[:, None] - (side < corner[:, None])  # index among the facet's vertices
    place = body.numbers.places[cell[:, None], side, beside]
    inverse = np.linalg.pinv(rows)
    wrong = np.zeros(len(cell), dtype=bool)
    for loads in (body.live, body.dead):
        pushes = np.take_along_axis(loads.tractions[here], place[..., None, None], axis=2)[:, :, 0]
        given = (np.einsum("nfai,nfi->nfa", axes, pushes) * told).reshape(-1, 4)
        left = np.einsum("nrm,nmq,nq->nr", rows, inverse, given) - given
        largest = problem.comm.allreduce(np.abs(loads.tractions).max(initial=0.0), MPI.MAX)
        wrong |= np.linalg.norm(left, axis=1) > ROUNDING * largest
    room = every - np.einsum("nfam,nmr,nrq->nfaq", every, inverse, rows)
    wrong |= (pressed & (np.linalg.norm(room[:, :, 0], axis=2) < ROUNDING)).any(axis=1)
    least = np.linalg.svd(room, compute_uv=False)[..., -1]
    wrong |= (rubs & (least < ROUNDING)).any(axis=1)
    vertices = topology.connectivity(2, 0).array.reshape(-1, 3)
    found: Ints = vertices[cell[wrong], corner[wrong]]
    return found


def with_divided_bare_cells(problem: Problem) -> Problem:
    """Return the problem with divisions of all cohesionless cells that could carry no stress.

    Collective.

    The function divides such a cell together with all cells around its vertex opposite an inner
    edge.

    Args:
        problem: The bodies with their loads. The function returns the problem unchanged without
            such cells, in 3D, in axisymmetry, on curved cells, and if tractions on facets are not
            known.
    """
    tagged_mesh, cones = problem.tagged_mesh, body_cones(problem)
    if problem.bodies.gdim == 3 or tagged_mesh.axisymmetric or not cones.loose:
        return problem
    if has_curved_cells(tagged_mesh.mesh):
        return problem
    body = bound_body(problem)
    if body.prevents is not None or not problem.as_declared:
        return problem
    topology, loose = tagged_mesh.mesh.topology, cones.at_cells()[0] == 0
    outside = np.isin(body.numbers.facets, exterior_facet_indices(topology))
    bare = bare_vertices(problem, body, loose).all(axis=1) & ~outside.all(axis=1)
    here = np.flatnonzero(bare)
    count = problem.comm.allreduce(len(here))
    if count == 0:
        return problem
    log.info("%d cells with neither cohesion nor confinement are divided", count)
    vertices = topology.connectivity(2, 0).array.reshape(-1, 3)
    points = np.unique(vertices[here, np.argmin(outside[here], axis=1)])
    pairs = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(fan(tagged_mesh, points, pairs).tagged_mesh)
