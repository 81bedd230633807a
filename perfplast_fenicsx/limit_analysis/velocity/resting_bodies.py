"""Bodies that stay where they are while others collapse, whose velocities are rounding."""

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.problem.problem import Problem


def let_rest(problem: Problem, mechanism: fem.Function) -> None:
    """Set velocities of bodies that are rounding to zero, if they enter no more then. Collective.

    What such a body enters of what it touches is rounding beside other bodies, and much beside its
    own velocities, by which it is judged. Where others give way to its rounding, it keeps that.

    Args:
        problem: The bodies.
        mechanism: A velocity, its ghosts up to date; changed.
    """
    bodies, v = problem.bodies, mechanism.x.array.reshape(problem.fixed.shape)
    largest = np.zeros(bodies.count)
    np.maximum.at(largest, bodies.of_node, np.abs(v).max(axis=1, initial=0.0))
    problem.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    # Relative to the largest velocity: some hundred roundings, and a tenth of what may enter.
    rounding = 1e-13
    rests = largest <= rounding * largest.max(initial=0.0)
    if not rests.any():
        return
    entered, moving = _most_entered(problem, mechanism), v.copy()
    v[rests[bodies.of_node]] = 0.0
    # Beside the velocities there: a tenth of what may enter where it is judged.
    nothing = 1e-13
    if _most_entered(problem, mechanism) > max(entered, nothing):
        v[:] = moving


def _most_entered(problem: Problem, velocity: fem.Function) -> float:
    """The largest jump into another body, beside the velocities on both sides. Collective."""
    # Velocities count as so much of the largest at least, as where they are judged.
    slowest = 1e-8
    comm, constraints = problem.comm, problem.constraints
    sizes = np.abs(velocity.x.array.reshape(problem.fixed.shape)).max(axis=1, initial=0.0)
    fastest = comm.allreduce(float(sizes.max(initial=0.0)), MPI.MAX)
    at_nodes, at_pairs = constraints.shares.createVecs()
    at_nodes.array[:] = sizes[: at_nodes.local_size]
    constraints.shares.mult(at_nodes, at_pairs)
    beside = np.maximum(at_pairs.array_r, slowest * fastest)
    jumps = constraints.jumps(velocity.x.petsc_vec)
    share = np.divide(jumps, beside, out=np.zeros_like(jumps), where=beside > 0)
    for vector in (at_nodes, at_pairs):
        vector.destroy()
    return float(comm.allreduce(float(share.max(initial=0.0)), MPI.MAX))
