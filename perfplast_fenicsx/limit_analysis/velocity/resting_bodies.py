"""Remove motion by rounding: of bodies at rest while others collapse, and of penetration."""

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.limit_analysis.facets.contact_facets import (
    UNSEEN,
    contact_facets,
    face_jumps,
    jump_vectors,
    rows_of,
)
from perfplast_fenicsx.limit_analysis.facets.entering import entered_share
from perfplast_fenicsx.problem.problem import Problem


def let_rest(problem: Problem, mechanism: fem.Function) -> None:
    """Set velocities of bodies that are rounding to zero, unless that adds penetration. Collective.

    Such a body may penetrate a touching one by rounding of other bodies' velocities. That is much
    compared with its own velocities, by which it is judged. If others move apart because of its
    rounding, it keeps its velocity as long as nothing penetrates. Otherwise the others are moved
    apart from it, and it rests.

    Args:
        problem: The bodies.
        mechanism: Velocity with updated ghosts; changed.
    """
    bodies, v = problem.bodies, mechanism.x.array.reshape(problem.fixed.shape)
    largest = np.zeros(bodies.count)
    np.maximum.at(largest, bodies.of_node, np.abs(v).max(axis=1, initial=0.0))
    problem.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    # Relative to the largest velocity: some hundred rounding units, and a tenth of the allowed
    # penetration.
    rounding = 1e-13
    rests = largest <= rounding * largest.max(initial=0.0)
    if not rests.any():
        return
    entered, moving = _entered(problem, mechanism), v.copy()
    v[rests[bodies.of_node]] = 0.0
    # Relative to the velocities there: a tenth of the allowed penetration.
    nothing = 1e-13
    if _entered(problem, mechanism) <= max(min(entered, UNSEEN), nothing):
        return
    if entered > UNSEEN:
        part(problem, mechanism, ~problem.fixed & ~rests[bodies.of_node][:, None])
        if _entered(problem, mechanism) <= UNSEEN:
            return
    v[:] = moving


def keep_apart(problem: Problem, mechanism: fem.Function) -> None:
    """Open contact by the penetration of slip on faces that are plane except for rounding.

    Points of a file with twelve digits make facets whose normals differ by 1e-11, which count as
    one face. What slips along it enters some of them by as much, which is more than a checker
    leaves. All pairs part by the most that any facet enters; volume changes that come of it count
    as those of rounding do. Nothing is changed where bodies would still enter. Collective.

    Args:
        problem: The bodies.
        mechanism: A velocity, its ghosts up to date; changed.
    """
    least = 1e-9  # share beyond which it is no rounding of points
    if not UNSEEN < _entered(problem, mechanism) <= least:
        return
    before, basis = mechanism.x.array.copy(), problem.basis
    faces = list(face_jumps(problem, mechanism))
    most = max((float(face.along.max(initial=0.0)) for face in faces), default=0.0)
    jumps, moved = basis.T.createVecs()
    jumps.array[basis.index] = -problem.comm.allreduce(most, MPI.MAX)
    basis.T.mult(jumps, moved)
    mechanism.x.array[: moved.getLocalSize()] += moved.array_r
    mechanism.x.scatter_forward()
    for vector in (jumps, moved):
        vector.destroy()
    if not _entered(problem, mechanism) <= UNSEEN:
        mechanism.x.array[:] = before


def part(problem: Problem, mechanism: fem.Function, free: PairFlags) -> None:
    """Remove penetration of contact that is due to rounding. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        mechanism: Velocity with updated ghosts; changed.
        free: Flags of components of local nodes that may change, shape (num_nodes, gdim).
    """
    constraints, gdim = problem.constraints, free.shape[1]
    v, owned = mechanism.x.array.reshape(free.shape), problem.V.dofmap.index_map.size_local
    on_nodes, on_rows = constraints.shares.createVecs()
    room = np.zeros(len(constraints.host))  # |n|² of the components that may change, on both sides
    for axis in range(gdim):
        on_nodes.array[:] = free[:owned, axis]
        constraints.shares.mult(on_nodes, on_rows)
        room += constraints.normal[:, axis] ** 2 * on_rows.array_r
    rounds = 4  # for nodes at edges, where the correction of one pair opens or closes another
    for _ in range(rounds):
        enters = np.divide(
            _entering(problem, mechanism), room, out=np.zeros_like(room), where=room > 0
        )
        for axis in range(gdim):
            on_rows.array[:] = enters * constraints.normal[:, axis]
            constraints.weights.multTranspose(on_rows, on_nodes)
            v[:owned, axis] -= np.where(free[:owned, axis], on_nodes.array_r, 0.0)
        mechanism.x.scatter_forward()
    for vector in (on_nodes, on_rows):
        vector.destroy()


def _entering(problem: Problem, velocity: fem.Function) -> Floats:
    """Return the penetration of each pair, at midsides half its Bernstein coefficient.

    Collective.
    """
    constraints = problem.constraints
    enters = np.einsum("ni,ni->n", jump_vectors(problem, velocity), constraints.normal)
    facets, host = contact_facets(problem), constraints.host
    for face in face_jumps(problem, velocity):
        middle = np.zeros(len(problem.fixed), dtype=bool)
        middle[facets.edges(face.here)[:, 0]] = True
        chosen = rows_of(problem, np.append(face.source, face.normal)) & middle[host]
        enters[chosen] = face.w[host[chosen]] @ face.normal / 2  # 2 w_m − (w_a + w_b)/2
    found: Floats = np.maximum(enters, 0.0)
    return found


def _entered(problem: Problem, velocity: fem.Function) -> float:
    """Return the interpenetration relative to velocities there; 0 if unknown. Collective."""
    if problem.constraints.in_mean or problem.given.ties:
        return 0.0
    return entered_share(problem, velocity, rubbing=True) or 0.0
