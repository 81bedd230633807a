"""Compute the forces of loads, supports, obstacles and contacts at the limit load."""

import math
from dataclasses import dataclass, replace

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.mesh.ring_polynomials import polynomials
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.judged.certificate import forces_between
from perfplast_fenicsx.problem.judged.resultants import resultants
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class LimitForces:
    """Forces in balance with a stress.

    Attributes:
        zeta: Load factor that the stress carries.
        strict: Whether ``zeta`` is the strict lower bound of the body. Otherwise it is an estimate:
            the static side of the limit load of the mesh, or the load factor of the last level of a
            path to the limit load.
        reactions: Reactions as for a level (:class:`resultants.Resultants`). If supports or
            contacts can share a force in several ways, the forces are one of the possible
            distributions.
        moments: Moments of the loads and the supports about the origin.
        balance: Relative imbalance of the forces and moments, as for a level.
    """

    zeta: float
    strict: bool
    reactions: dict[str, list[float]]
    moments: dict[str, list[float]]
    balance: float


def limit_forces(
    problem: Problem, limit: LimitLoad, body: BodyBounds | None = None
) -> LimitForces | None:
    """Return the forces from the stress of a strict lower bound, or else of the limit load.

    Collective.

    Args:
        problem: Problem on whose mesh the limit load was found.
        limit: Limit load with its stress.
        body: Bounds with the lower bound, which may be on another mesh.

    Returns:
        The forces; None if there is no stress, or if its load factor is 0 or not finite. In
        axisymmetry also None if the bounds contain no strict lower bound. In this case the limit
        load of the mesh belongs to velocities v = ru (:mod:`ring_flux`), and its stress is not in
        balance with the nodal forces of displacements.
    """
    if body is not None and (found := _of_bound(body)) is not None:
        return found
    if body is not None and body.by_flux is not None:
        return None
    stress, zeta = limit.stress, limit.lower
    if stress is None and limit.theorem and limit.levels:  # the last level of a path
        stress, zeta = limit.levels[-1].stress, limit.levels[-1].state.zeta
    if stress is None or zeta == 0 or not math.isfinite(zeta):
        return None
    return _forces(problem, problem.internal_form(stress), zeta)


def _of_bound(body: BodyBounds) -> LimitForces | None:
    """Return the forces of a strict lower bound, if nodal forces balance its stress. Collective."""
    problem, value = body.problem, body.lower.strict_value
    if body.stress is None or not value:
        return None
    if body.question is not Question.LIMIT:
        return None
    around_axis = problem.tagged_mesh.axisymmetric
    form = (_form_of_rings if around_axis else _form_of_cells)(problem, body.stress)
    found = _forces(problem, form, float(value))
    # Forces with a larger relative residual are not reported. Surfaces whose facets do not match
    # transfer tractions that nodal forces do not represent.
    balanced = 1e-9
    return replace(found, strict=True) if found.balance <= balanced else None


def _form_of_cells(problem: Problem, stress: Floats) -> ufl.Form:
    """Return the form ⟨σ, ε(v)⟩ of a stress that is linear in each cell. Collective.

    Args:
        problem: Problem with the displacements v.
        stress: Mandel vectors at the vertices of the cells, shape (num_cells, d + 1, m).
    """
    space = fem.functionspace(problem.tagged_mesh.mesh, ("DG", 1, stress.shape[2:]))
    return problem.internal_form(_filled(space, stress))


def _form_of_rings(problem: Problem, stress: Floats) -> ufl.Form:
    """Return the form ⟨σ, ε(u)⟩ of a stress in axisymmetry. Collective.

    The product 2πrσ:ε(u) of quadratic rσ and u is cubic, with σ_θ linear (:mod:`stress_cells`).
    A quadrature rule for cubic functions is therefore exact.

    Args:
        problem: Problem with the displacements u.
        stress: Bernstein coefficients of rσ, shape (num_cells, 6, 4).
    """
    mesh, cubic = problem.tagged_mesh.mesh, 3
    element = basix.ufl.quadrature_element(
        mesh.topology.cell_name(), value_shape=stress.shape[2:], degree=cubic
    )
    space = fem.functionspace(mesh, element)
    at = interpolation_points(space.element)
    shares = np.hstack([1 - at.sum(axis=1, keepdims=True), at])
    vertices, places = corners(mesh)
    radii = places[vertices[: len(stress)], 0] @ shares.T
    values = np.einsum("pi,cim->cpm", polynomials(shares), stress) / radii[..., None]
    metadata = {"quadrature_degree": cubic, "quadrature_scheme": "default"}
    strain = problem.kinematics.strain(ufl.TestFunction(problem.V))
    dx = problem.kinematics.measure(ufl.Measure("dx", domain=mesh, metadata=metadata))
    return ufl.dot(_filled(space, values), strain) * dx


def _filled(space: fem.FunctionSpace, values: Floats) -> fem.Function:
    """Return a function with the values of each owned cell, shape (num_cells, n, m). Collective."""
    found = fem.Function(space)
    rows = found.x.array.reshape(-1, values.shape[2])
    rows[space.dofmap.list[: len(values)]] = values
    found.x.scatter_forward()
    return found


def _forces(problem: Problem, form: ufl.Form, zeta: float) -> LimitForces:
    """Return the forces of a stress at a load factor. Collective.

    Args:
        problem: The bodies and their loads.
        form: Linear form of the internal virtual work of the stress.
        zeta: The load factor.
    """
    internal = problem.create_vector()
    assemble_force(internal, fem.form(form), [])
    pushed, rubbed = forces_between(problem, internal, zeta)
    found = resultants(problem, internal, pushed, rubbed, zeta)
    internal.destroy()
    return LimitForces(zeta, False, dict(found.forces), dict(found.moments), found.balance)
