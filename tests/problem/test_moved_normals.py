"""Test supports that move flat and curved surfaces along their normals, also by formulas."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.thick_tube import INNER, OUTER, write_thick_tube
from perfplast_fenicsx import Elastic, Newton, Pressure, Problem, Support, VonMises, limit_bounds
from tests.checks import assert_refused, assert_solved
from tests.models import Read
from tests.stones import box, stones

COMM = MPI.COMM_WORLD
E, NU = 70000.0, 0.3
ALLOY = Elastic(young=E, poisson=NU)


def lame(moved: float) -> float:
    """Return the pressure on the bore that moves it outwards, in plane strain."""
    a, b = INNER, OUTER
    return moved * E * (b**2 - a**2) / ((1 + NU) * a * ((1 - 2 * NU) * a**2 + b**2))


@pytest.mark.mpi3
def test_a_bore_is_moved_along_its_normals(read: Read) -> None:
    """The normal points out of the body: a negative value widens the bore of a tube."""
    moved = -1e-3
    mesh = read(write_thick_tube, size=0.1)
    supports = [Support("x0", "x"), Support("y0", "y")]
    bore = Support("inner", "normal", moved, constant=False, name="bore")
    problem = Problem(mesh, {"tube": ALLOY}, [*supports, bore], [], degree=2)
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    exact = lame(-moved)
    assert level.report.reactions["support bore"] == pytest.approx([exact, exact], rel=5e-3)
    assert level.report.driving_force == pytest.approx(-exact * moved * np.pi / 2, rel=5e-3)
    u, x = level.state.u.x.array.reshape(-1, 2), problem.V.tabulate_dof_coordinates()[:, :2]
    r = np.linalg.norm(x, axis=1)
    bored = fem.locate_dofs_topological(problem.V, 1, mesh.facets("inner"))
    radial = np.einsum("ni,ni->n", u, x)[bored] / r[bored]
    assert radial == pytest.approx(-moved, rel=2e-3)
    half = Newton(problem).solve(0.5, level.state)
    assert half.state.u.x.array == pytest.approx(level.state.u.x.array / 2, abs=1e-6 * abs(moved))


def squeezed(*supports: Support) -> Problem:
    """Return a unit square on a smooth floor."""
    mesh = stones(COMM, [box([0, 0], [1, 1])], (3, 3))
    materials = {"0": VonMises(young=1e4, poisson=0.3, yield_stress=10.0)}
    held = [Support("0_x0", "x"), Support("0_y0", "y")]
    return Problem(mesh, materials, [*held, *supports], [], degree=2)


def test_a_flat_surface_moves_as_by_letters() -> None:
    levels = [
        Newton(squeezed(Support("0_y1", *how, constant=False))).solve(1.0)
        for how in (("y", -0.01), ("normal", -0.01))
    ]
    for level in levels:
        assert_solved(level)
    one, other = (level.state.u.x.array for level in levels)
    assert other == pytest.approx(one, abs=1e-10)
    assert levels[1].report.driving_force == pytest.approx(levels[0].report.driving_force, rel=1e-7)


@pytest.mark.parametrize("components", ["y", "normal"])
def test_a_formula(components: str) -> None:
    problem = squeezed(Support("0_y1", components, "-0.001*(1 + x)", constant=False))
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    nodes = fem.locate_dofs_topological(problem.V, 1, problem.tagged_mesh.facets("0_y1"))
    x = problem.V.tabulate_dof_coordinates()[nodes, 0]
    moved = level.state.u.x.array.reshape(-1, 2)[nodes, 1]
    assert moved == pytest.approx(-0.001 * (1 + x), rel=1e-9)


def test_refusals(read: Read, shared_tmp_path: Path) -> None:
    mesh = read(write_thick_tube, size=0.2)
    supports = [Support("x0", "x"), Support("y0", "y")]

    def tube(bore: Support) -> Problem:
        alloy = VonMises(E, NU, 250.0)
        return Problem(mesh, {"tube": alloy}, [*supports, bore], [Pressure("outer", 1.0)], degree=2)

    rests = Support("inner", "normal")
    assert_refused(lambda: tube(rests), ["'inner'", "flat surface", "a value"])
    formula = Support("inner", "normal", "sqrt(0.5 - x)")
    assert_refused(lambda: tube(formula), ["value of the support on 'inner'", "finite"])
    moves = tube(Support("inner", "normal", 1e-3))
    assert_refused(lambda: limit_bounds(moves), ["'inner'", "curved", "letters"])
    twice = Support("0_y1", "normal", 0.01), Support("0_x1", "y")
    assert_refused(lambda: squeezed(*twice), ["'0_y1'", "different amount"])
