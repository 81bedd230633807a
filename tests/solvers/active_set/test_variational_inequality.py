"""SNES-VI in the full space: from any active set to the solution's, and out where it fails."""

import numpy as np
import pytest

from perfplast_fenicsx import NewtonOptions, WorkNewton
from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    QuadraticModel,
    Solution,
)
from perfplast_fenicsx.solvers.active_set.variational_inequality import VariationalInequality
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from tests.models import two_blocks_problem


class Case:
    """One contact QP of two blocks, with open and closed pairs, and its solution."""

    def __init__(self, work: float | None) -> None:
        self.problem: Problem = two_blocks_problem(3)
        iterate = Iterate(self.problem)
        solver = WorkNewton(self.problem, NewtonOptions(tolerance=1e-10))
        self.start = solver.solve(0.05).state
        self.active = iterate.begin(self.start)
        self.linear = LinearSolver(self.problem)
        self.program = EqualityProgram(self.problem, self.linear)
        self.program.set_operator(iterate.operator(1e-6))
        r = iterate.gradient(self.start.zeta if work else 2 * self.start.zeta)
        self.model = QuadraticModel(r.copy(), iterate.room(), work, 1e-11)
        contact = ContactProgram(self.problem, self.linear)
        contact.set_operator(self.program.operator)
        step = contact.solve(r, self.model.jumps, self.active, 1e-11, work=work)
        assert step.settled
        self.expected = step.active
        self.delta, self.multiplier = step.delta.copy(), step.multiplier
        self.program.set_operator(self.program.operator)

    def solved_with(self, held: PairFlags) -> Solution:
        """A feasible start with these pairs held."""
        solution = self.program.minimise(self.model, held, self.problem.create_vector())
        delta, index = solution.delta, self.program.index
        delta.array[index] = np.minimum(delta.array_r[index], self.model.jumps)
        return solution


@pytest.fixture(params=[None, 0.05], ids=["load", "work"])
def case(request: pytest.FixtureRequest) -> Case:
    return Case(request.param)


def test_a_solution_is_left_as_it_is(case: Case) -> None:
    start = case.solved_with(case.expected)
    before = start.delta.copy()
    solution, converged = VariationalInequality(case.problem, case.program).solve(start)
    assert converged
    assert solution.solves == start.solves
    assert solution.delta is start.delta
    before.axpy(-1.0, solution.delta)
    assert before.norm() < 1e-14 * solution.delta.norm()


@pytest.mark.mpi2("load")
def test_it_goes_on_from_a_wrong_set(case: Case) -> None:
    wrong = ~case.expected if case.expected.any() else np.ones_like(case.expected)
    start = case.solved_with(wrong | case.active)
    solution, converged = VariationalInequality(case.problem, case.program).solve(start)
    assert converged
    assert solution.solves > start.solves
    assert (solution.held == case.expected).all()
    assert solution.multiplier == pytest.approx(case.multiplier, rel=1e-7)
    difference = solution.delta - case.delta
    assert difference.norm() < 1e-7 * case.delta.norm()


def test_what_fails_inside_is_raised_outside(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    start = case.solved_with(~case.expected | case.active)
    inequality = VariationalInequality(case.problem, case.program)

    def fail(*_: object, **__: object) -> None:
        raise LinearFailure("no solution")

    with monkeypatch.context() as patch:
        patch.setattr(case.linear, "solve", fail)
        with pytest.raises(LinearFailure, match="no solution"):
            inequality.solve(start)
    _, converged = inequality.solve(case.solved_with(~case.expected | case.active))
    assert converged, "a failure should leave nothing behind"
