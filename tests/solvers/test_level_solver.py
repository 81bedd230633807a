"""Test common behaviour of all algorithms: the loop, the states that they find, refusals."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx import InputError, Iteration, Level, Newton, Problem, State, load_path
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.solvers.augmented_lagrangian import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
)
from perfplast_fenicsx.solvers.level_solver import MOST_DOUBTS, LevelSolver
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.newton import BorderedNewton, WorkNewton
from perfplast_fenicsx.solvers.progress import Step
from tests.models import PUNCH_LIMIT, l_plate_problem, punch_problem, two_blocks_problem
from tests.solvers.levels import SERIAL, TIGHT, TWO_BLOCKS_LIMIT, converged, stress_distance


@pytest.mark.mpi2("punch")
@pytest.mark.long(but=["punch"])
@pytest.mark.parametrize(
    ("build", "zetas"),
    [
        (lambda: punch_problem(8), (450.0,)),
        pytest.param(
            lambda: two_blocks_problem(4),
            TWO_BLOCKS_LIMIT[4] * np.arange(0.15, 0.91, 0.15),
            marks=pytest.mark.serial,
        ),
    ],
    ids=["punch", "two_blocks"],
)
def test_all_four_find_the_same_stress(
    build: Callable[[], Problem], zetas: Sequence[float]
) -> None:
    """Undamped ALG4 converges in several load steps: one step to 60 % cycles."""
    problem = build()
    reference = converged(list(load_path(Newton(problem, TIGHT), zetas)))
    alphas = [level.state.alpha for level in reference]
    uzawa = AugmentedLagrangian(problem, AugmentedLagrangianOptions(tolerance=2e-9))
    others: list[tuple[LevelSolver, Sequence[float]]] = [
        (uzawa, zetas),
        (WorkNewton(problem, TIGHT), alphas),
        (BorderedNewton(problem, TIGHT), alphas),
    ]
    for solver, values in others:
        levels = converged(list(load_path(solver, values)))
        for level, known in zip(levels, reference, strict=True):
            assert stress_distance(problem, known.state, level.state) < 1e-6
            assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-7)
            assert level.state.zeta == pytest.approx(known.state.zeta, rel=1e-7)
            assert level.report.smallest_contact_force > -1e-6 * known.state.zeta
    assert uzawa.linear.setups < uzawa.linear.solves / 4


@pytest.mark.long
@SERIAL
@pytest.mark.parametrize("share", [0.6, 0.9])
def test_all_four_find_the_same_stress_on_a_finer_mesh(share: float) -> None:
    """On this mesh, ALG2 once stopped 1e-6 away, at pairs with weak tension."""
    problem = two_blocks_problem(8)
    zeta = share * TWO_BLOCKS_LIMIT[8]
    near, known = converged(list(load_path(Newton(problem, TIGHT), [0.97 * zeta, zeta])))
    options = AugmentedLagrangianOptions(tolerance=1e-9)
    others = [AugmentedLagrangian(problem, options).solve(zeta)]
    for method in (WorkNewton, BorderedNewton):
        others.append(method(problem, TIGHT).solve(known.state.alpha, near.state))
    for level in converged(others):
        assert stress_distance(problem, known.state, level.state) < 1e-6
        assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-7)
        assert level.state.zeta == pytest.approx(zeta, rel=1e-7)


@pytest.mark.parametrize("control", ["load", "work"])
def test_a_nearly_incompressible_body(control: str) -> None:
    problem = punch_problem(4, poisson=0.499)
    [known] = converged(list(load_path(Newton(problem, TIGHT), [470.0])))
    if control == "load":
        options = AugmentedLagrangianOptions(tolerance=1e-8)
        [level] = converged([AugmentedLagrangian(problem, options).solve(470.0)])
        assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-6)
    else:
        [level] = converged([WorkNewton(problem, TIGHT).solve(known.state.alpha)])
        assert level.state.zeta == pytest.approx(470.0, rel=1e-9)


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_a_load_above_the_limit_is_refused_with_evidence(
    method: type[Newton | AugmentedLagrangian],
) -> None:
    level = method(punch_problem(4)).solve(1.01 * PUNCH_LIMIT)
    assert not level.report.converged
    assert "above the limit load" in level.report.reason
    assert level.report.newton_iterations <= 100
    assert level.iterations[-1].energy < level.iterations[0].energy
    assert level.iterations[-1].alpha > level.iterations[0].alpha


def test_contact_does_not_depend_on_the_size_of_the_displacements() -> None:
    """An elastic state is proportional to the load, even if the load is small."""
    solver = Newton(two_blocks_problem(6), TIGHT)
    large, small = converged([solver.solve(zeta) for zeta in (20.0, 1e-4)])
    assert large.report.plastic_cells == 0
    assert small.state.alpha / 1e-4 == pytest.approx(large.state.alpha / 20.0, rel=1e-10)
    assert small.report.active_contacts == large.report.active_contacts


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_a_load_that_is_no_number_is_refused(method: type[Newton]) -> None:
    with pytest.raises(InputError, match="zeta = nan is not finite"):
        method(punch_problem(2)).solve(math.nan)


# The loop


class Scripted(LevelSolver):
    """Makes steps without changes; given steps fail, finish or end."""

    method, prescribes = "scripted", Prescribed.LOAD_FACTOR

    def __init__(
        self,
        problem: Problem,
        max_iterations: int = 5,
        finished: Sequence[int] = (),
        fails: int = 0,
        ends: int = 0,
        size: float = 1.0,
    ) -> None:
        super().__init__(problem, (1e-8, max_iterations), "small enough")
        self._finished, self._fails, self._ends, self._size = finished, fails, ends, size

    def begin(self, value: float, start: State | None) -> tuple[float, np.ndarray]:
        active = self.iterate.begin(start)
        self.iterate.fields.u.x.array[:] *= self._size
        self.iterate.fields.update()
        return value, active

    def step(
        self, value: float, zeta: float, active: np.ndarray, history: Sequence[Iteration]
    ) -> Step:
        number = len(history) + 1
        if number == self._fails:
            raise LinearFailure("the matrix is singular")
        finished = number in self._finished
        return Step(zeta, 0.1**number, active, 2, finished, beta=0.5, extra={"number": number})

    def ended(self, zeta: float, history: Sequence[Iteration]) -> str | None:
        return "it falls for ever" if len(history) == self._ends else None


@cache
def plate() -> Problem:
    return l_plate_problem(1)


@cache
def solved() -> Level:
    [level] = converged([Newton(plate(), TIGHT).solve(1.0)])
    return level


def test_a_level_ends_where_steps_have_become_small_at_a_solution() -> None:
    told: list[Iteration] = []
    solver = Scripted(plate(), finished=[3])
    level = solver.solve(1.0, solved().state, told.append)
    assert level.report.converged
    assert level.report.reason == "small enough"
    assert told == level.iterations
    assert [step.number for step in told] == [step.extra["number"] for step in told] == [1, 2, 3]
    assert level.report.active_set_iterations == 6
    assert level.report.damping_min == pytest.approx(0.5)
    assert level.state.alpha == pytest.approx(solved().state.alpha, rel=1e-12)


@pytest.mark.mpi2("script0-5-no convergence in 5 Newton steps")
@pytest.mark.parametrize(
    ("script", "steps", "reason"),
    [
        ({}, 5, "no convergence in 5 Newton steps"),
        ({"fails": 3}, 2, "the matrix is singular"),
        ({"ends": 2}, 2, "it falls for ever"),
        ({"finished": [2], "ends": 4, "size": 2.0}, 4, "it falls for ever"),
        ({"finished": [2], "size": 2.0}, 5, "no convergence in 5 Newton steps"),
        ({"finished": [5], "size": 2.0}, 5, "a state that is not a solution"),
    ],
)
def test_a_level_without_solution_tells_why(
    script: dict[str, Any], steps: int, reason: str
) -> None:
    """With size 2, u is twice the solution: small steps there have no meaning."""
    level = Scripted(plate(), **script).solve(1.0, solved().state)
    assert not level.report.converged
    assert reason in level.report.reason
    assert len(level.iterations) == level.report.newton_iterations == steps
    assert level.state.zeta == pytest.approx(1.0)


def test_small_steps_at_no_solution_are_not_looked_at_for_ever() -> None:
    most = 2 * MOST_DOUBTS
    solver = Scripted(plate(), most, finished=range(most), size=2.0)
    level = solver.solve(1.0, solved().state)
    assert len(level.iterations) == MOST_DOUBTS
    assert "a state that is not a solution" in level.report.reason
