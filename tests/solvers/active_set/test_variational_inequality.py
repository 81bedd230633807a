"""Test that SNES-VI uses exactly the sets of the primal–dual active set strategy."""

import gc
import weakref
from contextlib import ExitStack

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import Newton, NewtonOptions, WorkNewton
from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers import AugmentedLagrangian, BorderedNewton, LevelSolver
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    QuadraticModel,
    Solution,
)
from perfplast_fenicsx.solvers.active_set.variational_inequality import VariationalInequality
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.linear.petsc_options import default
from tests.models import two_blocks_problem


class Case:
    """One contact QP of two blocks, with open and closed pairs."""

    def __init__(self, work: float | None) -> None:
        self.problem: Problem = two_blocks_problem(3)
        iterate = Iterate(self.problem)
        start = WorkNewton(self.problem, NewtonOptions(tolerance=1e-10)).solve(0.05).state
        self.active = iterate.begin(start)
        self.linear = LinearSolver(self.problem)
        self.program = EqualityProgram(self.problem, self.linear)
        self.program.set_operator(iterate.operator(1e-6))
        r = iterate.gradient(start.zeta if work else 2 * start.zeta)
        self.model = QuadraticModel(r.copy(), iterate.room(), work, 1e-11)

    def search(self, held: PairFlags) -> Solution:
        """Compute the sets of the primal–dual strategy directly, as the reference."""
        program, model, comm = self.program, self.model, self.problem.comm
        force = self.problem.create_vector()
        solution = program.minimise(model, held, self.problem.create_vector())
        while True:
            program.gradient(solution, force)
            opening = force.array_r[program.index] > solution.force_tolerance
            excess = solution.delta.array_r[program.index] - model.jumps
            closing = excess > 1e-12 * solution.delta.norm(PETSc.NormType.NORM_INFINITY)
            wrong = np.where(solution.held, opening, closing)
            if not comm.allreduce(int(wrong.sum())):
                return solution
            solution = program.correct(solution, solution.held ^ wrong)

    def made(self, **options: str) -> VariationalInequality:
        """Return SNES-VI with a user's options."""
        with ExitStack() as stack:
            for name, value in options.items():
                stack.enter_context(default(f"perfplast_vi_{name}", value))
            return VariationalInequality(self.problem, self.program)

    def wrong_start(self) -> PairFlags:
        """Return a set after which several others follow."""
        return np.ones_like(self.active)


@pytest.fixture(params=[None, 0.05], ids=["load", "work"])
def case(request: pytest.FixtureRequest) -> Case:
    return Case(request.param)


@pytest.mark.mpi3("work")
def test_its_sets_are_those_of_the_primal_dual_strategy(case: Case) -> None:
    """The number of sets agrees, from the right set and from a wrong one; one SNES serves all."""
    inequality = case.made()
    for start in (case.wrong_start(), case.active):
        expected = case.search(start)
        before = inequality.iterations
        found = inequality.solve(case.model, start)
        assert found.settled
        assert inequality.iterations - before == found.solution.solves == expected.solves
        assert (found.solution.held == expected.held).all()
        assert found.solution.multiplier == pytest.approx(expected.multiplier, rel=1e-9)
        jumps = found.delta.array_r[case.program.index]
        assert (jumps <= case.model.jumps).all(), "the solution should be feasible to the last bit"
        difference = found.delta - expected.delta
        assert difference.norm() < 1e-10 * expected.delta.norm()
    assert case.search(case.wrong_start()).solves > 2


def test_a_set_that_is_right_is_found_in_one_iteration(case: Case) -> None:
    right = case.search(case.active).held
    inequality, solves = case.made(), case.linear.solves
    found = inequality.solve(case.model, right)
    assert found.settled
    assert inequality.iterations == found.solution.solves == 1
    systems = 1 if case.model.work is None else 2
    assert case.linear.solves - solves <= systems


def test_what_fails_inside_is_raised_outside(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    inequality, start = case.made(), case.wrong_start()

    def fail(*_: object, **__: object) -> None:
        raise LinearFailure("no solution")

    with monkeypatch.context() as patch:
        patch.setattr(case.linear, "solve", fail)
        with pytest.raises(LinearFailure, match="no solution"):
            inequality.solve(case.model, start)
    assert inequality.solve(case.model, start).settled, "a failure should leave nothing behind"


def test_options_are_obeyed(case: Case, capfd: pytest.CaptureFixture[str]) -> None:
    start = case.wrong_start()
    exact = case.search(start).solves
    watched = {"snes_monitor": "", "snes_converged_reason": "", "snes_max_it": "2"}
    found = case.made(**watched).solve(case.model, start)
    assert (found.solution.solves, found.settled, found.circling) == (2, False, None)
    shown = case.problem.comm.bcast(capfd.readouterr().out)
    assert shown.count("SNES Function norm") == 3
    assert "DIVERGED_MAX_IT iterations 2" in shown
    few = case.made(snes_max_it="40").solve(case.model, start, most_sets=1)
    assert few.solution.solves == 1
    loose = case.made(snes_rtol="0.9").solve(case.model, start)
    assert loose.solution.solves < exact
    assert not loose.settled, "a tolerance should end the iteration, not decide on pairs"


@pytest.mark.parametrize(
    ("work", "options"),
    [
        (None, {"snes_linesearch_damping": "0.5"}),
        (0.05, {"snes_linesearch_damping": "0.5"}),
        (None, {"snes_linesearch_type": "bt"}),
    ],
)
def test_other_line_searches_find_the_same(work: float | None, options: dict[str, str]) -> None:
    case = Case(work)
    expected = case.search(case.active)
    found = case.made(**options).solve(case.model, case.active)
    assert found.settled
    assert (found.solution.held == expected.held).all()
    difference = found.delta - expected.delta
    assert difference.norm() < 1e-7 * expected.delta.norm()


@pytest.mark.parametrize("option", [("snes_type", "vinewtonssls"), ("pc_type", "jacobi")])
def test_another_solver_is_refused(option: tuple[str, str]) -> None:
    problem = two_blocks_problem(2)
    with (
        default(f"perfplast_vi_{option[0]}", option[1]),
        pytest.raises(InputError, match=f"'-perfplast_vi_{option[0]} {option[1]}' cannot be used"),
    ):
        Newton(problem)


@pytest.mark.mpi3("frictionless-Newton", "tresca-WorkNewton")
@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton])
@pytest.mark.parametrize("friction", [{}, {"tresca": 20.0}], ids=["frictionless", "tresca"])
def test_all_algorithms_take_their_steps_by_it(
    method: type[LevelSolver], friction: dict[str, float]
) -> None:
    problem = two_blocks_problem(2, **friction)
    level = method(problem).solve(0.02 if method.prescribes is Prescribed.WORK else 60.0)
    report = level.report
    assert report.converged
    assert report.newton_iterations > 1
    assert report.contact_programs >= report.newton_iterations
    assert report.snes_vi_programs == report.contact_programs
    assert report.snes_vi_iterations == report.active_set_iterations > 1


def test_what_it_belongs_to_can_be_let_go() -> None:
    """PETSc stores the SNES's functions, and would thereby keep a whole solver alive."""
    newton = Newton(two_blocks_problem(2))
    assert newton.solve(60.0).report.snes_vi_iterations > 0
    kept = weakref.ref(newton.program)
    del newton
    gc.collect()
    assert kept() is None
