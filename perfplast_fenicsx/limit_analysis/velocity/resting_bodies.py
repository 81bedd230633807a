"""Bodies that stay where they are while others collapse, whose velocities are rounding."""

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.problem.problem import Problem


def let_rest(problem: Problem, mechanism: fem.Function) -> None:
    """Set velocities of bodies that are rounding to zero. Collective.

    What such a body enters of what it touches is rounding beside other bodies, and much beside its
    own velocities, by which it is judged.

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
    v[rests[bodies.of_node]] = 0.0
