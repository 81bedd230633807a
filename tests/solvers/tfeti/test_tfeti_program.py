"""Test Total FETI against active sets, and its messages without a solution."""

import dataclasses
from collections.abc import Callable
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    WorkNewton,
)
from perfplast_fenicsx.solvers.tfeti.tfeti_program import TfetiProgram, TornProgram
from tests.checks import assert_refused
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL, punch_problem, stack_problem, touching_blocks, two_blocks_problem
from tests.solvers.levels import stress_distance
from tests.solvers.linear.systems import corner_problem, quadratic_problem

SHARP = NewtonOptions(tolerance=1e-10)
APART = {2: ((5, 3), (4, 2)), 3: ((2, 2, 1), (3, 3, 1))}


def tfeti(subdomains: int | None = None, **changes: Any) -> NewtonOptions:
    changes = {"contact_solver": "tfeti", "subdomains": subdomains} | changes
    return dataclasses.replace(SHARP, **changes)


def blocks(gdim: int, degree: int, **joint: Any) -> Problem:
    """Return two blocks with separate meshes, in contact or glued, on rollers."""
    vertical = "xyz"[gdim - 1]
    sides = [f"{body}{axis}0" for axis in "xyz"[: gdim - 1] for body in ("", "upper_")]
    return Problem(
        blocks_apart(MPI.COMM_WORLD, *APART[gdim]),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", vertical), *(Support(side, side[-2]) for side in sides)],
        [Pressure("top", 1.0)],
        degree=degree,
        **joint,
    )


MORTAR = [Contact("lower_top", "upper_bottom", formulation="mortar")]
TIED = [Tie("lower_top", "upper_bottom")]
CASES: dict[str, tuple[Callable[[], Problem], float]] = {
    "space": (lambda: two_blocks_problem(2), 200.0),
    "gap": (lambda: two_blocks_problem(2, gap=0.02), 100.0),
    "held by contact": (lambda: stack_problem(2, gap=0.01), 100.0),
    "punch": (lambda: punch_problem(2), 300.0),
    "obstacles, edges": (corner_problem, 100.0),
    "quadratic": (quadratic_problem, 50.0),
    "mortar, plane": (lambda: blocks(2, 2, contacts=MORTAR), 200.0),
    "mortar, space": (lambda: blocks(3, 1, contacts=MORTAR), 200.0),
    "tied": (lambda: blocks(2, 2, contacts=TIED), 200.0),
}


@pytest.mark.long(but=["space"])
@pytest.mark.mpi2("space")
@pytest.mark.parametrize(("make", "zeta"), CASES.values(), ids=CASES.keys())
def test_as_with_active_sets(make: Callable[[], Problem], zeta: float) -> None:
    problem = make()
    one, other = (Newton(problem, options).solve(zeta) for options in (SHARP, tfeti(12)))
    assert other.report.converged, other.report.reason
    assert other.state.alpha == pytest.approx(one.state.alpha, rel=1e-8)
    assert stress_distance(problem, one.state, other.state) < 1e-8
    change, size = (
        problem.comm.allreduce(float(forces @ forces)) ** 0.5
        for forces in (one.contact_forces - other.contact_forces, one.contact_forces)
    )
    assert change <= 1e-8 * size
    assert other.report.equilibrium < 1e-8
    assert abs(other.report.duality_gap) < 1e-8
    assert other.report.max_penetration < 1e-12


def test_optimality_of_the_dual() -> None:
    """SMALBE alone satisfies bounds and all rows to 1e-10; contact forces are not negative."""
    problem = two_blocks_problem(2)
    solver = Newton(problem, tfeti(8))
    program = solver.program
    assert isinstance(program, TfetiProgram)
    active = solver.iterate.begin(None)
    program.set_operator(solver.iterate.operator(1.0))
    gradient, room = solver.iterate.gradient(10.0), solver.iterate.room()
    asked = program._ask(gradient, room, active, 1e-11, None, 0.0)
    dual = program._dual
    search: TornProgram = program._search(asked)
    assert search.run(1e-11, 3000)
    multipliers = search.multipliers()
    contact = multipliers[dual.contact]
    assert (contact >= 0).all()
    closed = problem.comm.allreduce(int((contact > 0).sum()))
    assert 0 < closed < problem.num_pairs

    def norm(values: np.ndarray) -> float:
        return float(problem.comm.allreduce(float(values @ values))) ** 0.5

    coarse = dual.coarse
    off = coarse.balance(multipliers) - coarse.resultants(asked.f)
    assert np.linalg.norm(off) <= 1e-10 * np.linalg.norm(coarse.resultants(asked.f))
    slack = -dual.rows(search.displacement(multipliers))
    slack[dual.contact] += room / program._length
    size = norm(dual.rows(dual.stiffness.solve(asked.f)))
    free = np.ones(len(slack), dtype=bool)
    free[dual.contact] = contact > 0
    assert norm(slack[free]) <= 1e-10 * size
    assert slack[dual.contact].min(initial=0) >= -1e-10 * size


@pytest.mark.mpi2
def test_prescribed_work() -> None:
    problem = two_blocks_problem(2)
    levels = []
    for options in (SHARP, tfeti(8)):
        solver = WorkNewton(problem, options)
        near = solver.near_yield()
        levels.append(solver.solve(3 * near.alpha, near))
    one, other = levels
    assert other.report.converged, other.report.reason
    assert other.state.zeta == pytest.approx(one.state.zeta, rel=1e-8)
    assert stress_distance(problem, one.state, other.state) < 1e-8


def test_bodies_that_lose_all_contact() -> None:
    problem = touching_blocks(
        loads=[Traction("top", (0.0, 0.0, 1.0))],
    )
    level = Newton(problem, tfeti(4)).solve(1.0)
    assert not level.report.converged
    assert "push the body 'upper' away" in level.report.reason


def test_above_the_limit() -> None:
    level = Newton(stack_problem(1), tfeti(4)).solve(305.0)
    assert not level.report.converged
    assert "above the limit load" in level.report.reason


def test_a_tangent_that_is_singular() -> None:
    """Without regularisation, a body that flows as a whole has no stiffness to factorise.

    A first step, which is solved to 1e-3, must not exceed the limit load of 300 for loads below it.
    """
    options = tfeti(4, regularisation=0.0)
    level = Newton(stack_problem(1), options).solve(290.0)
    again = Newton(stack_problem(1), options).solve(305.0)
    assert level.report.converged
    assert not again.report.converged
    assert again.report.reason


def test_refusals() -> None:
    problem = two_blocks_problem(2)
    assert_refused(lambda: Newton(problem, tfeti(1)), ["subdomains = 1", "parts of bodies"])
    assert_refused(lambda: NewtonOptions(subdomains=4), ["subdomains = 4", "contact_solver"])
    assert_refused(lambda: tfeti(0), ["subdomains = 0", "less than 1"])
    rubbing = touching_blocks(contacts=[Contact("lower_top", "upper_bottom", tresca=1.0)])
    assert_refused(lambda: Newton(rubbing, tfeti(4)), ["tfeti", "friction"])
