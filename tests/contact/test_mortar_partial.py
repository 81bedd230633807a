"""Test surfaces that overlap in part, not along facet edges: patch tests, and retired nodes."""

from itertools import product
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx import Contact, Newton, Pressure, Problem, Support, VonMises
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.surfaces.surface_facets import surface_facets
from perfplast_fenicsx.problem import LoadCase
from tests.checks import assert_solved, largest
from tests.contact.blocks_apart import blocks_apart

SOFT = VonMises(young=1e5, poisson=0.3, yield_stress=1e4)
HARD = VonMises(young=3e5, poisson=0.0, yield_stress=1e4)
SPAN = (0.22, 0.77)
ANGLE = 0.35


def clipped(polygon: Floats, by: Floats) -> Floats:
    """Return the part of a polygon inside a convex anticlockwise polygon, by Sutherland–Hodgman."""
    for a, b in zip(by, np.roll(by, -1, axis=0), strict=True):
        inside = [np.linalg.det([b - a, point - a]) for point in polygon]
        kept = []
        for i, point in enumerate(polygon):
            j = (i + 1) % len(polygon)
            if inside[i] >= 0:
                kept.append(point)
            if inside[i] * inside[j] < 0:
                kept.append(point + inside[i] / (inside[i] - inside[j]) * (polygon[j] - point))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def simplices(facet: Floats, span: Floats) -> list[Floats]:
    """Return the part of a facet that lies in the span, in horizontal coordinates."""
    if facet.shape[1] == 1:
        low, high = max(facet.min(), span.min()), min(facet.max(), span.max())
        return [np.array([[low], [high]])] if high > low else []
    turned = facet if np.linalg.det(facet[1:] - facet[0]) > 0 else facet[::-1]
    polygon = clipped(turned, span)
    return [polygon[[0, i, i + 1]] for i in range(1, len(polygon) - 1)]


def pushed(problem: Problem, surface: str, span: Floats, slope: float = 0.0) -> fem.Function:
    """Return vertical nodal forces ∫(1 + slope x)N over a surface's part in a span. Collective."""
    V, gdim = problem.V, problem.bodies.gdim
    facets = surface_facets(V, problem.tagged_mesh, surface)
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    points, weights = basix.make_quadrature(kind, 4)
    element = basix.create_element(
        basix.ElementFamily.P, kind, problem.degree, basix.LagrangeVariant.equispaced
    )
    force = fem.Function(V)
    for nodes, x in zip(facets.nodes, facets.x[:, :, :-1], strict=True):
        for part in simplices(x, span):
            edges = part[1:] - part[0]
            at = part[0] + points @ edges
            local = np.linalg.solve((x[1:] - x[0]).T, (at - x[0]).T).T
            values = element.tabulate(0, local)[0, :, :, 0]
            size = abs(np.linalg.det(edges))
            force.x.array[nodes * gdim + gdim - 1] += (
                size * (weights * (1 + slope * at[:, 0])) @ values
            )
    force.x.petsc_vec.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return force


def partly_covered(gdim: int, degree: int, **contact: Any) -> Problem:
    """Return a rotated narrow block on a wide block; ζ = 1 is a vertical stress of 1 in both."""
    counts = {2: ((7, 2), (5, 2)), 3: ((6, 6, 1), (4, 4, 1))}[gdim]
    angle = ANGLE if gdim == 3 else 0.0
    axes = "xyz"[: gdim - 1]
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, *counts, span=SPAN, angle=angle),
        {"lower": SOFT, "upper": HARD},
        [
            Support("bottom", "xyz"[gdim - 1]),
            *(Support(f"{axis}0", axis) for axis in axes),
            Support("top", axes),
        ],
        [Pressure("top", 1.0)],
        [Contact("upper_bottom", "lower_top", **contact)],
        degree=degree,
    )
    if gdim == 2:
        span = np.array(SPAN)[:, None]
    else:
        low, high = SPAN
        square = np.array([[low, low], [high, low], [high, high], [low, high]])
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        span = (square - sum(SPAN) / 2) @ turn.T + sum(SPAN) / 2
    v = ufl.TestFunction(problem.V)
    work = -v[gdim - 1].dx(gdim - 1) * ufl.dx(domain=problem.tagged_mesh.mesh)
    live = fem_petsc.assemble_vector(fem.form(work))
    live.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    for sign, surface in ((1.0, "lower_top"), (-1.0, "upper_bottom")):
        force = pushed(problem, surface, span)
        live.axpy(sign, force.x.petsc_vec)
    fem_petsc.set_bc(live, problem.bcs)
    problem.loads = LoadCase(problem.loads.dead, live)
    return problem


@pytest.mark.parametrize(
    ("gdim", "degree", "hosts"), list(product((2, 3), (1, 2), ("primary", "secondary")))
)
def test_constant_pressure_on_part_of_a_surface(
    gdim: int, degree: int, hosts: Any, comm: MPI.Intracomm
) -> None:
    problem = partly_covered(gdim, degree, hosts=hosts)
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    x = problem.V.tabulate_dof_coordinates()[:, :gdim]
    u = level.state.u.x.array.reshape(-1, gdim)
    plane = gdim == 2
    soft, aside = (
        np.array([1 - SOFT.poisson**2, SOFT.poisson * (1 + SOFT.poisson)])
        if plane
        else np.array([1.0, SOFT.poisson])
    ) / SOFT.young
    expected = np.zeros_like(x)
    height = x[:, -1]
    expected[:, -1] = -soft * np.minimum(height, 1) - np.maximum(height - 1, 0) / HARD.young
    assert largest(comm, u[:, -1] - expected[:, -1]) < 1e-12 * soft
    below = height < 1 - 1e-9
    assert largest(comm, (u[:, :-1] - aside * x[:, :-1])[below]) < 1e-12 * soft
    assert largest(comm, problem.constraints.shares.getValuesCSR()[2]) < 10


@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_linear_pressure_between_quadratic_elements(hosts: Any, comm: MPI.Intracomm) -> None:
    """Bending patch test in 2D: σ_yy = −(1 + 0.7x) and quadratic displacements are exact."""
    slope = 0.7
    lower, upper = VonMises(1e5, 0.0, 1e4), VonMises(3e5, 0.0, 1e4)
    problem = Problem(
        blocks_apart(comm, (4, 3), (5, 3)),
        {"lower": lower, "upper": upper},
        [Support("bottom"), Support("upper_bottom", "x")],
        [Pressure("top", 1.0)],
        [Contact("upper_bottom", "lower_top", hosts=hosts)],
        degree=2,
    )
    mesh = problem.tagged_mesh.mesh
    v, x = ufl.TestFunction(problem.V), ufl.SpatialCoordinate(mesh)
    live = fem_petsc.assemble_vector(fem.form(-(1 + slope * x[0]) * v[1].dx(1) * ufl.dx))
    live.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    for sign, surface in ((1.0, "lower_top"), (-1.0, "upper_bottom")):
        force = pushed(problem, surface, np.array([[0.0], [1.0]]), slope)
        live.axpy(sign, force.x.petsc_vec)
    fem_petsc.set_bc(live, problem.bcs)
    problem.loads = LoadCase(problem.loads.dead, live)
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    X, Y = problem.V.tabulate_dof_coordinates()[:, :2].T
    u = level.state.u.x.array.reshape(-1, 2)
    high = np.maximum(Y - 1, 0)
    low = np.minimum(Y, 1)
    vertical = -(1 + slope * X) * (low / lower.young + high / upper.young)
    assert largest(comm, u[:, 1] - vertical) < 1e-11 / lower.young
    aside = slope * (high**2 / upper.young / 2 + high / lower.young)
    assert largest(comm, (u[:, 0] - aside)[Y > 1 + 1e-9]) < 1e-11 / lower.young


@pytest.mark.mpi2("primary")
@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_linear_pressure_in_space(hosts: Any, comm: MPI.Intracomm) -> None:
    """Multipliers on quadratic triangles cannot represent linear pressure.

    The error decreases about as h².
    """
    slope = 0.7
    lower, upper = VonMises(1e5, 0.0, 1e4), VonMises(3e5, 0.0, 1e4)
    errors = []
    for n in (1, 2):
        problem = Problem(
            blocks_apart(comm, (2 * n, 2 * n, 1), (3 * n, 3 * n, 1)),
            {"lower": lower, "upper": upper},
            [Support("bottom"), Support("upper_bottom", "xy")],
            [Pressure("top", f"1 + {slope}*x")],
            [Contact("upper_bottom", "lower_top", hosts=hosts)],
            degree=2,
        )
        level = Newton(problem).solve(1.0)
        assert_solved(level)
        x, _, z = problem.V.tabulate_dof_coordinates().T
        low, high = np.minimum(z, 1) / lower.young, np.maximum(z - 1, 0) / upper.young
        down = level.state.u.x.array.reshape(-1, 3)[:, 2] + (1 + slope * x) * (low + high)
        errors.append(largest(comm, down) * lower.young)
    assert errors[0] < 5e-3
    assert errors[1] < errors[0] / 4
