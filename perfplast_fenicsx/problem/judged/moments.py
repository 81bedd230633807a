"""Compute moments of nodal forces about the origin."""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.problem import Problem


def moment(problem: Problem, forces: Floats) -> Floats:
    """Return the sum of the moments of nodal forces on this rank. Not collective.

    Args:
        problem: Problem with the nodes.
        forces: Forces of the nodes that this rank owns, shape (num_nodes, gdim).

    Returns:
        Moment about x, y and z in space, shape (3,); about z in the plane per unit of depth, shape
        (1,); empty for bodies of revolution, shape (0,).
    """
    gdim = problem.bodies.gdim
    if problem.tagged_mesh.axisymmetric:
        return np.zeros(0)
    x = problem.V.tabulate_dof_coordinates()[: len(forces)]
    if gdim == 3:
        found: Floats = np.cross(x, forces).sum(axis=0)
        return found
    return np.atleast_1d((x[:, 0] * forces[:, 1] - x[:, 1] * forces[:, 0]).sum())
