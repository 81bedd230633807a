"""Test the data of a conic program: solutions satisfy them, and Clarabel agrees."""

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from benchmarks import frozen_bodies
from perfplast_fenicsx import InputError, Problem
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.conic.cone_program import ConeProgram
from perfplast_fenicsx.limit_analysis.conic.conic_program import (
    ConicProgram,
    Start,
)
from perfplast_fenicsx.limit_analysis.conic.conic_solver import conic_solver
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, Unknowns
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict, choose_units, iterate
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point, limit_program
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_form import static_form
from perfplast_fenicsx.limit_analysis.stress.static_program import static_program

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="matrices are made on one rank")

RTOL = 1e-7
BODIES: dict[str, Any] = {
    "contact": lambda: frozen_bodies.stamped(frozen_bodies.STEEL, frozen_bodies.STRONG),
    "friction, principal stresses": lambda: frozen_bodies.stamped(
        frozen_bodies.CLAY, frozen_bodies.STRONG, tresca=5.0
    ),
    "associated": lambda: frozen_bodies.pressed(2, 2, coulomb=0.3, associated=True),
    "ring": lambda: frozen_bodies.disc(frozen_bodies.STEEL),
    "weight, tension cut off": lambda: frozen_bodies.bank(frozen_bodies.CUT),
}


def solved(program: ConicProgram) -> InteriorIteration:
    """Solve a program by the interior point method."""
    assert choose_units(program, Start.within(RTOL))
    iteration = InteriorIteration(program)
    verdict, reason = iterate(iteration, 1e-4, [], None)
    assert verdict is Verdict.FOUND, reason
    return iteration


def entries(data: ConeProgram, now: Unknowns) -> Floats:
    """Return an iterate as the unknowns of the data."""
    x = np.zeros(len(data.c))
    at = data.columns[0]
    x[at.pressure], x[at.deviator] = now.stress
    x[at.forces] = now.forces
    x[data.factors] = [now.load, now.aside][: len(data.factors)]
    for columns, members in zip(data.columns, now.members, strict=True):
        x[columns.own] = members.own
    return x


@pytest.mark.parametrize("kind", ["velocities", "stresses"])
@pytest.mark.parametrize("name", BODIES)
def test_a_solution_fulfils_the_data(name: str, kind: str) -> None:
    """Equilibrium holds to rounding, and static members lie in the cones."""
    problem = BODIES[name]()
    if kind == "velocities":
        program = limit_program(problem, Question.LIMIT, RTOL)
    else:
        program = static_program(static_form(problem), Question.LIMIT, RTOL).program
    iteration = solved(program)
    data, now = ConeProgram.of(program), iteration.now
    x = entries(data, now)
    left = np.abs(data.A @ x - data.b - iteration.balance().array_r)
    terms = np.abs(data.A) @ np.abs(x) + np.abs(data.b)
    assert left.max() < 1e-12 * terms.max()
    for number, (block, members) in enumerate(zip(program.blocks, now.members, strict=True)):
        factors, right = data.members(number)
        rows = (right + factors @ x).reshape(data.cones[number].right.shape)
        again = data.blocks[number].from_rows(rows, rows, members.own).static
        assert again == pytest.approx(block.static(now.borne, members.own), rel=1e-12, abs=1e-9)


def by_both(name: str, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Solve a rigid–plastic body with both solvers, to :data:`RTOL`."""

    def strict(problem: Problem) -> dict[str, Any]:
        found = limit_bounds(problem, RTOL)
        assert found.mesh is not None
        mesh = found.mesh.estimate
        return {"lower": found.lower.value, "upper": found.upper.value, "mesh": mesh}

    def of_mesh(problem: Problem) -> dict[str, Any]:
        found = interior_point(problem, RTOL)
        return {"lower": found.lower, "upper": found.upper}

    monkeypatch.setattr(frozen_bodies, "strict", strict)
    monkeypatch.setattr(frozen_bodies, "of_mesh", of_mesh)
    found = []
    for solver in ("interior-point", "clarabel"):
        with conic_solver(solver):
            found.append(frozen_bodies.BODIES[name]())
    return found


OF_BOUNDS = [
    name
    for name in frozen_bodies.BODIES
    if name.split(":")[0] not in ("factor", "envelope", "shakedown")
]


@pytest.mark.parametrize("name", OF_BOUNDS)
def test_clarabel_finds_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The solvers agree to 1e-6; if one solver lacks a bound, the other lacks it too."""
    pytest.importorskip("clarabel", reason="the conic solver Clarabel is not installed")
    ours, theirs = by_both(name, monkeypatch)
    both = [key for key in ours if ours[key] is not None and theirs[key] is not None]
    assert len(both) >= len(ours) - 1
    for key in both:
        # with constant loads and no cohesion, the reserve changes strengths by 1e-6
        near = 2e-6 if "no cohesion" in name else 1e-6
        assert theirs[key] == pytest.approx(ours[key], rel=near, abs=0), (key, ours, theirs)


def test_the_solver_has_a_name_that_is_known() -> None:
    with (
        pytest.raises(InputError, match="conic = 'clarabell' is unknown"),
        conic_solver("clarabell"),
    ):
        pass
