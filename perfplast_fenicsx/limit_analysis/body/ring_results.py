"""Convert axisymmetric results in v = ru to the displacements of the given problem."""

from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.ring_strains import has_coefficients
from perfplast_fenicsx.limit_analysis.facets.ring_flux import nodal_velocity
from perfplast_fenicsx.mesh.ring_polynomials import coefficients_of_radius, polynomials
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class VelocityOf:
    """A velocity, and the problem in whose displacement space it is.

    Attributes:
        problem: The problem.
        velocity: Its velocity.
    """

    problem: Problem
    velocity: fem.Function


def of_displacements(
    problem: Problem, flow: VelocityOf, mesh: LimitLoad
) -> tuple[fem.Function, LimitLoad]:
    """Return the velocity u, and a limit load with it and with the forces conjugate to u.

    Collective.

    Args:
        problem: Problem of the displacements u.
        flow: Flow problem of v = ru.
        mesh: Limit load of the flow problem.
    """
    velocity, forces = nodal_velocity(problem, flow.velocity), mesh.contact_forces
    rows = flow.problem.constraints
    if forces is not None and len(forces) == len(rows.host):  # forces of pairs
        told = problem.constraints
        ours, theirs = (
            it.host.astype(np.int64) * len(told.sources) + it.surface for it in (told, rows)
        )
        _, here, there = np.intersect1d(ours, theirs, return_indices=True)
        pushed = np.zeros(len(ours))  # zero on the axis, where v is held
        pushed[here] = problem.V.tabulate_dof_coordinates()[told.host[here], 0] * forces[there]
        forces = pushed
    stress = mesh.stress
    if stress is not None and has_coefficients(flow.problem):
        stress = _at_points(problem, flow.problem, stress)
    return velocity, replace(mesh, mechanism=velocity, contact_forces=forces, stress=stress)


def _at_points(problem: Problem, flow: Problem, stress: fem.Function) -> fem.Function:
    """Return a stress at the points, from coefficients of rσ. Collective.

    Args:
        problem: Problem with the points.
        flow: Flow problem on the same cells, with coefficients at its points.
        stress: σ_i = S_i/ρ_i of each coefficient S_i of S = rσ, Mandel vectors.
    """
    vertices, places = corners(problem.tagged_mesh.mesh)
    x, size = places[vertices], problem.S.dofmap.index_map_bs
    at = interpolation_points(problem.S.element)
    shares = np.hstack([1 - at.sum(axis=1, keepdims=True), at])
    given = stress.x.array.reshape(-1, size)[flow.Q.dofmap.list[: len(x)]]
    given = coefficients_of_radius(x)[..., None] * given
    found = fem.Function(problem.S, name=stress.name)
    values = np.einsum("pi,cim->cpm", polynomials(shares), given)
    values /= (x[..., 0] @ shares.T)[..., None]
    found.x.array.reshape(-1, size)[problem.Q.dofmap.list[: len(x)]] = values
    found.x.scatter_forward()
    return found
