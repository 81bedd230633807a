"""Formulate contact on facets, and check whether a mechanism penetrates contact facets.

The jump w of a quadratic velocity along a fixed normal is quadratic on a facet. Its Bernstein
coefficients are its values at the vertices, and 2 w_m − (w_a + w_b)/2 at a midside node m between a
and b. If no coefficient is positive, w is nowhere positive. Nodal values that are not positive are
not sufficient: the values 0, 0 and −1 at one end, the middle and the other end of an edge give w =
1/8 between the nodes.

:func:`with_facet_contact` prevents penetration of all facets of curved surfaces. Nodes of curved
surfaces have an averaged normal. Even with a velocity that does not penetrate along this normal,
bodies can penetrate the adjacent facets. The function therefore gives each pair of nodes a cone of
at most d directions around the normals of all facets at the pair. The constraints act on the jump
along these directions, at midsides on its Bernstein coefficient. With these constraints, the
mechanism penetrates no facet. If the constraints need more unknowns than the nodes have, for
example where three bodies meet, the nodes move together. This excludes some mechanisms, but the
load of each remaining mechanism is still an upper bound.

:func:`with_associated_slip` makes slip with Coulomb's friction normal to the friction cone.
Surfaces that slip then separate by w_n ≥ μ‖w_t‖, and only adhesion dissipates. In 2D, this
condition is a pair of bounds, with the jump s = −w_n along the normal,

    a = s + μ w_t ≤ 0,   b = s − μ w_t ≤ 0,

where a and b replace s and w_t as unknowns. In 3D, the cone is not a wedge, and the function lets
surfaces with friction neither slip nor separate. This excludes some mechanisms, but the load of
each remaining mechanism is still an upper bound.
"""

from dataclasses import replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.contact.formulations.tangential_rows import tangential_rows
from perfplast_fenicsx.contact.rows.constraints import (
    Constraints,
    Entries,
    entries_of,
    make_constraints,
    matrix_of_entries,
    stacked,
    unknowns,
)
from perfplast_fenicsx.contact.rows.jump_basis import make_basis
from perfplast_fenicsx.contact.surfaces.surface_facets import LEAST_COSINE
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import Flags, strength_of
from perfplast_fenicsx.limit_analysis.facets.contact_facets import (
    SAME,
    UNSEEN,
    ContactFacets,
    FacingNodes,
    at_nodes,
    contact_facets,
    face_jumps,
    facing_nodes,
    flat_faces,
    has_pair,
    matched_facets,
    owners,
    rows_of,
)
from perfplast_fenicsx.parallel import send_rows
from perfplast_fenicsx.problem.problem import Problem, variant

NARROWEST = 0.02
"""Tangent of the smallest angle of a cone. With a smaller angle, the directions would hardly be a
basis."""


def enclosing_cones(directions: Floats, known: Flags) -> tuple[Floats, Ints]:
    """Return cones of at most d directions that enclose given directions.

    For a single direction, or for two directions in a plane, the cone consists of these directions,
    unless their angle is too small. For more directions in 3D, the function chooses the smallest of
    several triangles that enclose the intersections of the directions with a plane.

    Args:
        directions: Directions, shape (n, most, d); zero vectors fill missing directions.
        known: Flags of the existing directions, shape (n, most).

    Returns:
        Unit vectors b, shape (n, d, d), and the number of vectors in each cone, shape (n,); −1
        where a direction is more than 84° from the mean direction.
    """
    same = 1e-9  # tangents that differ by less than this number count as equal
    widest = 0.1  # least cosine between each direction and the mean
    n, _, d = directions.shape
    sizes = np.linalg.norm(directions, axis=2)
    known = known & (sizes > same)
    units = np.where(known[..., None], directions, 0.0) / np.where(known, sizes, 1.0)[..., None]
    mean = units.sum(axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    along = np.einsum("nki,ni->nk", units, mean)
    wide = (known & (along < widest)).any(axis=1)
    flat = units / np.where(known & (along >= widest), along, 1.0)[..., None] - mean[:, None]
    flat[~known | wide[:, None]] = 0.0
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", flat, flat))
    axes = np.swapaxes(axes, 1, 2)[:, ::-1][:, : d - 1]  # the axis of the widest spread first
    at = np.einsum("nki,nai->nka", flat, axes)
    spread = np.abs(at).max(axis=1, initial=0.0)
    count = np.where(known.any(axis=1), 1 + (spread > same).sum(axis=1), 0)
    ends = np.zeros((n, d, d - 1))
    low, high = at[..., 0].min(axis=1, initial=0.0), at[..., 0].max(axis=1, initial=0.0)
    short = np.maximum(NARROWEST - (high - low), 0.0) / 2
    ends[:, 0, 0], ends[:, 1, 0] = low - short, high + short
    ends[count == 1] = 0.0
    if d == 3:
        of = count == 3
        ends[of] = _triangles(at[of], known[of], spread[of])
    vectors = mean[:, None] + np.einsum("nka,nai->nki", ends, axes)
    vectors /= np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-300)
    return vectors, np.where(wide, -1, count).astype(np.int32)


def _triangles(at: Floats, known: Flags, spread: Floats) -> Floats:
    """Return the corners of triangles around points in the plane, shape (n, 3, 2)."""
    scale = np.maximum(spread, NARROWEST / 2)
    points = at / scale[:, None]
    turn = np.linspace(0.0, 2 * np.pi / 3, 24, endpoint=False)  # orientations to try
    angle = turn[:, None] + np.arange(3) * (2 * np.pi / 3)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=2)  # shape (turns, 3, 2)
    reach = np.einsum("nka,tja->ntjk", points, out)
    reach = np.where(known[:, None, None], reach, -np.inf).max(axis=3)
    best = np.argmin(reach.sum(axis=2), axis=1)
    reach, out = reach[np.arange(len(at)), best], out[best]
    short = np.maximum(1.0 - reach.sum(axis=1), 0.0) / 3
    reach += short[:, None]
    after = [1, 2, 0]
    sides = np.stack([out, out[:, after]], axis=2)
    corners: Floats = np.linalg.solve(sides, np.stack([reach, reach[:, after]], axis=2)[..., None])[
        ..., 0
    ]
    return corners * scale[:, None]


def with_facet_contact(problem: Problem) -> Problem | None:
    """Return the problem with contact constraints under which no facet is penetrated. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.

    Returns:
        A problem that shares everything except contact with the given problem. None if there are
        obstacles, friction, ties or facets that do not match, or if ``_rows`` finds no host.
    """
    others = problem.given.obstacles or problem.friction.count or problem.num_tied
    matched = None if others or problem.constraints.in_mean else matched_facets(problem)
    if matched is None:
        return None
    pairs = facing_nodes(problem, matched)
    vectors, count = enclosing_cones(pairs.normals, pairs.known)
    free = ~pairs.held
    hosts = (free.sum(axis=2)[:, 1] > free.sum(axis=2)[:, 0]).astype(np.int64)
    every = np.arange(len(pairs))
    lacks = (free[every, 1 - hosts] & ~free[every, hosts]).any(axis=1)
    glued = (count < 0) | ((count > 1) & (pairs.crowded | lacks))
    one = (count == 1) & ~glued
    touching = _rows(problem, pairs, vectors, count, hosts, glued, one)
    if touching is None:
        return None
    contact, ties = touching
    rows = stacked(problem.V, [contact, ties])
    basis = make_basis(problem.V, rows, problem.fixed, len(ties.host))
    found = variant(problem, rows=(contact, problem.sliding), basis=basis)
    found.num_tied = problem.comm.allreduce(len(ties.host))
    return found


def _rows(
    problem: Problem,
    pairs: FacingNodes,
    vectors: Floats,
    count: Ints,
    hosts: Longs,
    glued: Flags,
    one: Flags,
) -> tuple[Constraints, Constraints] | None:
    """Return the constraints for pairs that may separate, and for tied nodes. Collective.

    The function returns ``None`` if the host of a pair belongs to a group of tied nodes.
    """
    comm = problem.comm
    knots = _Knots(problem, pairs, glued)
    # Pairs within a group of tied nodes add no constraint. If only one node of a pair is in a
    # group, the other node becomes the host of the pair.
    place = np.searchsorted(knots.nodes, pairs.nodes)
    inside = np.isin(pairs.nodes, knots.nodes)
    label = np.full(pairs.nodes.shape, -1)
    label[inside] = knots.labels[place[inside]]
    kept = (count > 0) & ~glued & ~(inside.all(axis=1) & (label[:, 0] == label[:, 1]))
    along = np.abs(vectors[:, 0])[:, None] * ~pairs.held
    able = (along.max(axis=2) >= LEAST_COSINE) & ~inside
    hosts = np.where(one & ~able[np.arange(len(pairs)), hosts], 1 - hosts, hosts)
    lost = kept & inside[np.arange(len(pairs)), hosts]
    if comm.allreduce(int(lost.sum())):
        return None
    gdim = vectors.shape[2]
    which, slot = np.nonzero(np.arange(gdim) < np.where(kept, count, 0)[:, None])
    rows: npt.NDArray[np.void] = np.zeros(
        len(which),
        dtype=[
            ("host", np.int64),
            ("nodes", np.int64, (3, 2)),
            ("vector", np.float64, gdim),
            ("contact", np.int32),
        ],
    )
    rows["host"] = pairs.nodes[which, hosts[which]]
    rows["nodes"][:, 0], rows["nodes"][:, 1:] = pairs.nodes[which], pairs.ends[which]
    rows["vector"], rows["contact"] = vectors[which, slot], pairs.contact[which]
    rows = send_rows(comm, rows, owners(problem, rows["host"]))
    contact = _contact(problem, rows)
    return contact, _ties(problem, knots)


def _contact(problem: Problem, rows: npt.NDArray[np.void]) -> Constraints:
    """Return constraints on jumps at vertices and on Bernstein coefficients at midsides.

    Collective.
    """
    first = problem.V.dofmap.index_map.local_range[0]
    middle = rows["nodes"][:, 1, 0] >= 0
    factors = np.where(middle[:, None], [2.0, -0.5, -0.5], [1.0, 0.0, 0.0])
    row, which = np.nonzero(factors)
    terms = []
    for side, sign in enumerate((1.0, -1.0)):
        coefficients = sign * factors[row, which][:, None] * rows["vector"][row]
        terms.append((row, rows["nodes"][row, which, side], coefficients))
    return make_constraints(
        problem.V,
        (rows["host"] - first).astype(np.int32),
        np.zeros(len(rows)),
        rows["vector"],
        rows["contact"],
        terms,
        sources=problem.constraints.sources,
    )


class _Knots:
    """Groups of nodes that move together.

    Attributes:
        nodes: Global numbers of all nodes in groups, ascending, equal on every rank, shape (n,).
        labels: Label of the group of each node, shape (n,).
        held: Flags of components that supports hold, shape (n, d).
    """

    def __init__(self, problem: Problem, pairs: FacingNodes, glued: Flags) -> None:
        """Find the groups, for example along edges where three bodies meet. Collective."""
        gdim = problem.bodies.gdim
        edge = [("nodes", np.int64, 2), ("held", np.bool_, (2, gdim))]
        mine = np.zeros(int(glued.sum()), dtype=edge)
        mine["nodes"], mine["held"] = pairs.nodes[glued], pairs.held[glued]
        edges = np.concatenate(problem.comm.allgather(mine))
        self.nodes, at = np.unique(edges["nodes"].ravel(), return_inverse=True)
        ends = at.reshape(-1, 2)
        size = len(self.nodes)
        graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
        self.labels = connected_components(graph, directed=False)[1] if size else ends[:, 0]
        self.held = np.zeros((size, gdim), dtype=np.bool_)
        self.held[ends] = edges["held"]


def _ties(problem: Problem, knots: _Knots) -> Constraints:
    """Return constraints that tie each group's free components to a held node or to the first."""
    V = problem.V
    first, last = V.dofmap.index_map.local_range
    parts = []
    gdim = problem.bodies.gdim
    size = len(knots.nodes)
    for axis in range(gdim):
        order = np.lexsort((~knots.held[:, axis], knots.labels))
        _, start = np.unique(knots.labels[order], return_index=True)
        roots = order[start][knots.labels] if size else order
        hosting = ~knots.held[:, axis] & (roots != np.arange(size))
        hosting &= (knots.nodes >= first) & (knots.nodes < last)
        host, root = knots.nodes[hosting], knots.nodes[roots[hosting]]
        direction = np.tile(np.eye(gdim)[axis], (len(host), 1))
        every = np.arange(len(host))
        parts.append(
            make_constraints(
                V,
                (host - first).astype(np.int32),
                np.zeros(len(host)),
                direction,
                np.zeros(len(host), dtype=np.int32),
                [(every, host, direction), (every, root, -direction)],
            )
        )
    return stacked(V, parts)


CURVED = "normals on curved contact surfaces are averages, or belong to a curved obstacle"

ENTERS = "the mechanism enters contact between nodes"

IN_MEAN = "surfaces whose nodes do not match are kept apart only in the mean"


def entering_between_nodes(problem: Problem, velocity: fem.Function) -> list[str]:
    """Return reasons why bodies may penetrate each other; an empty list if they do not.

    Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
    """
    if problem.constraints.in_mean or problem.given.ties:
        return [IN_MEAN]
    share = entered_share(problem, velocity)
    if share is None:
        return [CURVED]
    return [ENTERS] if share > UNSEEN else []


def entered_share(
    problem: Problem, velocity: fem.Function, *, rubbing: bool = False
) -> float | None:
    """Return the largest penetration, relative to the velocities on both facets of a pair.

    Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
        rubbing: Whether too little separation during slip with Coulomb's friction counts as
            penetration.

    Returns:
        The ratio; None for curved surfaces with friction, with obstacles, or with facets that do
        not match.
    """
    if not problem.num_pairs:
        return 0.0
    faces, comm = flat_faces(problem), problem.comm
    if faces is None or not _are_flat(problem, contact_facets(problem), faces):
        matched = None if problem.given.obstacles else matched_facets(problem, velocity)
        if matched is None or problem.friction.count:
            return None
        mine = max((facets.entered() for facets in matched), default=0.0)
    else:
        strengths = [strength_of(source) for source in problem.constraints.sources]
        shares = (
            face.entered(strengths[face.source].friction if rubbing else 0.0)
            for face in face_jumps(problem, velocity)
        )
        mine = max(shares, default=0.0)
    return float(comm.allreduce(mine, MPI.MAX))


def _are_flat(problem: Problem, facets: ContactFacets, faces: Floats) -> bool:
    """Return whether all nodes of each facet have pairs with the same normal. Collective.

    Nodes without a pair count if supports hold them along this normal.
    """
    nodes = facets.nodes
    none, paired = np.zeros(len(problem.constraints.host)), has_pair(problem)
    seen = ~paired[nodes].any(axis=1)
    for face in faces:
        _, known = at_nodes(problem, none, rows_of(problem, face))
        kept = ~paired & (problem.fixed | (np.abs(face[1:]) <= SAME)).all(axis=1)
        seen |= known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
    return bool(problem.comm.allreduce(bool(seen.all()), MPI.LAND))


def without_entering(problem: Problem) -> Problem | None:
    """Return the problem with contact constraints on the Bernstein coefficients of jumps.

    The Bernstein coefficients replace the values at midside nodes. On a straight mesh, mechanisms
    then do not penetrate between the nodes, and friction acts on the coefficients of slip.
    Collective.

    Args:
        problem: The bodies and their contact.

    Returns:
        A problem that differs from the given problem only in contact; the given problem itself
        without contact, and with linear elements on flat surfaces. None if nodes do not match, if
        surfaces are tied, or if :func:`with_facet_contact` does not support the curved surfaces.
    """
    if problem.constraints.in_mean or problem.given.ties:
        return None
    if not problem.num_pairs:
        return problem
    faces, facets = flat_faces(problem), contact_facets(problem)
    if faces is None or not _are_flat(problem, facets, faces):
        return with_facet_contact(problem)
    if problem.degree == 1:
        return problem
    constraints = problem.constraints
    first = constraints.B.getOwnershipRange()[0]
    count = len(constraints.host)
    numbers = np.arange(first, first + count, dtype=np.float64)
    nodes, areas = facets.nodes, facets.areas
    area = np.zeros(count)
    combine = PETSc.Mat().createAIJ(((count, None), (count, None)), nnz=4, comm=problem.comm)
    combine.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    diagonal = combine.createVecRight()
    diagonal.set(1.0)
    diagonal.assemble()
    for face in faces:
        chosen = rows_of(problem, face)
        row, known = at_nodes(problem, numbers, chosen)
        here = known[nodes].any(axis=1)
        share = np.repeat(areas[here] / nodes.shape[1], nodes.shape[1])
        sums = la.vector(problem.V.dofmap.index_map, 1)
        np.add.at(sums.array, nodes[here].ravel(), share)
        sums.scatter_reverse(la.InsertMode.add)
        area[chosen] = sums.array[constraints.host[chosen]]
        edges = facets.edges()
        edges = edges[known[edges[:, 0]]]
        middle = np.rint(row[edges[:, 0]]).astype(PETSc.IntType)
        diagonal.setValues(middle, np.full(len(middle), 2.0))
        for end in edges[:, 1:].T:
            has = known[end]
            ends = np.rint(row[end[has]]).astype(PETSc.IntType)
            one_each = np.arange(len(ends) + 1, dtype=PETSc.IntType)
            halves = np.full(len(ends), -0.5)
            combine.setValuesIJV(one_each, ends, halves, rowmap=middle[has])
    diagonal.assemble()
    combine.assemble()
    combine.setDiagonal(diagonal)
    touching = replace(
        constraints,
        B=combine.matMult(constraints.B),
        weights=combine.matMult(constraints.weights),
        area=area,
    )
    told, rigid = (problem.given.contacts, problem.given.obstacles), problem.ties
    taken = problem.fixed.copy()
    node, component, _ = guided = problem.guides.held
    others = slice(len(rigid.host) - len(node))
    taken[rigid.host[others], np.argmax(np.abs(rigid.normal[others]), axis=1)] = True
    taken[node, component] = True
    sliding, friction = tangential_rows(problem.V, touching, *told, [], taken, guided)
    for thing in (combine, diagonal):
        thing.destroy()
    rows = stacked(problem.V, [touching, sliding, rigid])
    basis = make_basis(problem.V, rows, problem.fixed, len(rigid.host), len(sliding.host))
    return variant(
        problem,
        rows=(touching, sliding),
        basis=basis,
        friction=friction.at(basis.sliding),
    )


def with_strict_contact(problem: Problem) -> Problem:
    """Return the problem in which mechanisms of upper bounds are sought. Collective.

    Mechanisms of the new problem do not penetrate between nodes if contact permits this
    formulation. Slip with Coulomb's friction is associated.

    Args:
        problem: The bodies and their contact.
    """
    return with_associated_slip(without_entering(problem) or problem)


def with_associated_slip(problem: Problem) -> Problem:
    """Return the problem with associated slip on all surfaces with Coulomb friction. Collective.

    Only :func:`discrete_limit.interior_point` accepts this problem, because its unknowns differ
    from displacements.

    Args:
        problem: The bodies and their contact; the problem of
            :func:`~perfplast_fenicsx.limit_analysis.facets.entering.without_entering` if friction
            is to apply to the coefficients of slip.

    Returns:
        A problem without Coulomb friction that shares everything except contact with the given
        problem; the given problem itself if it has no Coulomb friction.
    """
    constraints = problem.constraints
    _, coulomb = constraints.friction_of(np.arange(len(constraints.surface)))
    follows: PairFlags = coulomb > 0
    if not problem.comm.allreduce(bool(follows.any())):
        return problem
    if problem.bodies.gdim == 3:
        return _glued(problem, follows)
    _, of, counts = np.unique(constraints.host, return_inverse=True, return_counts=True)
    rubs = np.bincount(of[follows], minlength=len(counts)) > 0
    return _wedged(_glued(problem, (rubs & (counts > 1))[of]))


def _glued(problem: Problem, rows: PairFlags) -> Problem:
    """Return the problem in which chosen pairs neither separate nor slip. Collective."""
    basis, friction, comm = problem.basis, problem.friction, problem.comm
    places = ~rows[friction.pair]
    held = np.concatenate([basis.index[rows], friction.unknowns(~places)])
    glued = replace(
        basis.holding(np.concatenate([basis.tied, held]), ~rows),
        sliding=np.setdiff1d(basis.sliding, held),
    )
    names = ("pair", "index", "direction", "area", "coulomb", "adhesion", "bound", "origin")
    kept = {name: getattr(friction, name)[places] for name in names}
    kept["pair"] = (np.cumsum(~rows) - 1)[kept["pair"]].astype(np.int32)
    left = replace(
        friction,
        count=comm.allreduce(int(places.sum())),
        follows_pressure=bool(comm.allreduce(float(kept["coulomb"].sum())) > 0),
        **kept,
    )
    return variant(problem, basis=glued, friction=left)


def _wedged(problem: Problem) -> Problem:
    """Return the 2D problem with the unknowns a and b at places with Coulomb friction.

    Collective.
    """
    basis, friction, comm = problem.basis, problem.friction, problem.comm
    places = np.flatnonzero((friction.coulomb > 0) & (friction.index[:, 0] >= 0))
    normal, along = basis.index[friction.pair[places]], friction.index[places, 0]
    mu = friction.coulomb[places]
    sizes = unknowns(problem.V)
    first = problem.V.dofmap.index_map.local_range[0] * problem.V.dofmap.index_map_bs
    others = np.setdiff1d(np.arange(sizes[0]), np.concatenate([normal, along]))
    same: Entries = (others, others + first, np.ones(len(others)))
    half, one = np.full(len(mu), 0.5), np.ones(len(mu))

    def block(*rows: tuple[Floats, Floats]) -> list[Entries]:
        """Return the entries of 2 × 2 matrices with the given rows for s and w_t."""
        return [
            (row, column + first, value)
            for row, values in zip((normal, along), rows, strict=True)
            for column, value in zip((normal, along), values, strict=True)
        ]

    to_jumps = matrix_of_entries(
        comm, sizes, sizes, [same, *block((half, half), (half / mu, -half / mu))], 2
    )
    from_jumps = matrix_of_entries(comm, sizes, sizes, [same, *block((one, mu), (one, -mu))], 2)
    changed = []
    for product in (basis.T.matMult(to_jumps), from_jumps.matMult(basis.M)):
        changed.append(matrix_of_entries(comm, sizes, sizes, [entries_of(product)], 2))
        product.destroy()
    for matrix in (to_jumps, from_jumps):
        matrix.destroy()
    wedged = replace(
        basis,
        T=changed[0],
        M=changed[1],
        index=np.concatenate([basis.index, along]),
        gap=np.append(basis.gap, np.zeros(len(along))),
        sliding=np.setdiff1d(basis.sliding, along),
    )
    index = np.column_stack([friction.index, np.full(len(friction.index), -1, dtype=np.int32)])
    shares = np.tile([[[1.0, 0.0]]], (len(index), 1, 1))
    index[places] = np.column_stack([normal, along])
    shares[places, 0] = np.column_stack([half / mu, -half / mu])
    slips = replace(
        friction,
        index=index,
        shares=shares,
        coulomb=np.zeros_like(friction.coulomb),
        bound=friction.adhesion,
        follows_pressure=False,
    )
    return variant(problem, basis=wedged, friction=slips)
