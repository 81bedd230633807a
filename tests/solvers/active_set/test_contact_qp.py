"""Test the contact QP: its optimality conditions, and cycling pairs."""

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import Problem
from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.active_set.variational_inequality import VariationalInequality
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from tests.models import l_plate_problem, two_blocks_problem

RTOL = 1e-10


class Case:
    """The first contact QP of a problem, at ζ = 60 or with a prescribed work."""

    def __init__(self, problem: Problem, work: float | None) -> None:
        self.problem, self.work = problem, work
        self.iterate, self.linear = Iterate(problem), LinearSolver(problem)
        self.program = ContactProgram(problem, self.linear)
        self.first = self.iterate.begin(None)
        self.operator = self.iterate.operator(1.0)
        self.program.set_operator(self.operator)
        self.r = self.iterate.gradient(0.0 if work else 60.0).copy()
        self.room = self.iterate.room()


@pytest.fixture(params=[None, 0.02], ids=["load", "work"])
def case(request: pytest.FixtureRequest) -> Case:
    return Case(two_blocks_problem(3), request.param)


@pytest.mark.mpi2("load")
def test_the_conditions_of_optimality_hold(case: Case) -> None:
    problem, index = case.problem, case.problem.basis.index
    step = case.program.solve(case.r, case.room, case.first, RTOL, work=case.work)
    assert step.settled
    assert step.iterations > 1
    border, force = problem.create_vector(), problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, border)
    case.operator.mult_add(step.delta, case.r, force)
    force.axpy(-step.multiplier, border)
    largest = np.abs(problem.comm.allgather(np.abs(force.array_r).max(initial=0))).max()
    jumps, f = step.delta.array_r[index], force.array_r[index]
    rounding = 1e-14 * step.delta.norm(PETSc.NormType.NORM_INFINITY)
    assert (jumps <= case.room + rounding).all()
    assert jumps[step.active] == pytest.approx(case.room[step.active], rel=0, abs=rounding)
    assert (f[step.active] < 1e-6 * largest).all()
    assert np.abs(f[~step.active]).max(initial=0) < 1e-6 * largest
    if case.work is None:
        assert step.multiplier == 0  # never computed
    else:
        assert border.dot(step.delta) == pytest.approx(case.work, rel=1e-9)


def test_one_set_is_solved_with_unless_it_must_be_exact(case: Case) -> None:
    program, active, iterations = case.program, case.first, 0
    while True:
        step = program.solve(case.r, case.room, active, RTOL, most_sets=1, work=case.work)
        assert step.iterations == 1
        rounding = 1e-14 * step.delta.norm(PETSc.NormType.NORM_INFINITY)
        assert (step.delta.array_r[case.problem.basis.index] <= case.room + rounding).all()
        iterations += 1
        if step.settled:
            break
        active = step.active
    exact = program.solve(case.r, case.room, case.first, RTOL, work=case.work)
    assert iterations == exact.iterations
    assert (step.active == exact.active).all()


def test_sets_are_tried_until_there_have_been_enough(case: Case) -> None:
    program, few = case.program, 2
    exact = program.solve(case.r, case.room, case.first, RTOL, work=case.work)
    assert exact.iterations > few
    step = program.solve(case.r, case.room, case.first, RTOL, most_sets=few, work=case.work)
    assert (step.iterations, step.settled) == (few, False)
    rounding = 1e-14 * step.delta.norm(PETSc.NormType.NORM_INFINITY)
    assert (step.delta.array_r[case.problem.basis.index] <= case.room + rounding).all()
    enough = exact.iterations
    step = program.solve(case.r, case.room, case.first, RTOL, most_sets=enough, work=case.work)
    assert step.settled
    assert (step.active == exact.active).all()


def test_pairs_that_go_in_circles_are_condensed(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SNES-VI is stopped at the first set, as if this set belonged to a cycle."""
    expected = case.program.solve(case.r, case.room, case.first, RTOL, work=case.work)
    delta, multiplier = expected.delta.copy(), expected.multiplier
    assert case.program.counts() == (1, 1, expected.iterations)

    def repeats(self: VariationalInequality, held: PairFlags) -> bool:
        self._circling = self._wrong
        return True

    monkeypatch.setattr(VariationalInequality, "_repeats", repeats)
    step = case.program.solve(case.r, case.room, case.first, RTOL, work=case.work)
    assert step.settled
    assert (step.active == expected.active).all()
    assert step.multiplier == pytest.approx(multiplier, rel=1e-7)
    delta.axpy(-1.0, step.delta)
    assert delta.norm() < 1e-7 * step.delta.norm()
    assert step.iterations > expected.iterations
    assert case.program.counts()[:2] == (2, 1), "the condensed program chose the set"


def test_without_contact_there_is_one_system() -> None:
    case = Case(l_plate_problem(1), None)
    step = case.program.solve(case.r, case.room, case.first, RTOL)
    assert step.settled
    assert (step.iterations, case.linear.solves) == (1, 1)
    assert step.active.shape == (0,)
