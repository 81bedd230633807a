"""Results around an axis by v = ru, expressed in the displacements of the given problem."""

from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.facets.ring_flux import nodal_velocity
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class VelocityOf:
    """A velocity, and the problem whose displacements are like it.

    Attributes:
        problem: The problem.
        velocity: Its velocity.
    """

    problem: Problem
    velocity: fem.Function


def of_displacements(
    problem: Problem, flow: VelocityOf, mesh: LimitLoad
) -> tuple[fem.Function, LimitLoad]:
    """The velocity u, and a limit load with it and with the forces that do work on u. Collective.

    Args:
        problem: Whose displacements u are.
        flow: By v = ru.
        mesh: Found by it.
    """
    velocity, forces = nodal_velocity(problem, flow.velocity), mesh.contact_forces
    rows = flow.problem.constraints
    if forces is not None and len(forces) == len(rows.host):  # of pairs
        told = problem.constraints
        ours, theirs = (
            it.host.astype(np.int64) * len(told.sources) + it.surface for it in (told, rows)
        )
        _, here, there = np.intersect1d(ours, theirs, return_indices=True)
        pushed = np.zeros(len(ours))  # nothing on the axis, where v is held
        pushed[here] = problem.V.tabulate_dof_coordinates()[told.host[here], 0] * forces[there]
        forces = pushed
    return velocity, replace(mesh, mechanism=velocity, contact_forces=forces)
