"""Test QPs with held pairs: a correction for other pairs replaces a solution, and is cheaper."""

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import Problem
from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram, QuadraticModel
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.linear.petsc_options import default
from tests.models import stack_problem, two_blocks_problem
from tests.solvers.linear.systems import elastic_operator

RTOL = 1e-6


def loads(problem: Problem) -> PETSc.Vec:
    """Return loads in the jump basis."""
    border = problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, border)
    return border


@pytest.mark.long(but=["mg-None"])
@pytest.mark.parametrize("work", [None, 0.02])
@pytest.mark.parametrize("kind", ["mg", "cholesky"])
def test_a_correction_is_as_good_as_a_solution(kind: str, work: float | None) -> None:
    """The pair in one corner is released."""
    problem = two_blocks_problem(4)
    operator = elastic_operator(problem)
    with (
        default("perfplast_pc_type", kind),
        default("perfplast_coarse_pc_gamg_coarse_eq_limit", "60"),
    ):
        linear = LinearSolver(problem)
        program = EqualityProgram(problem, linear)
        program.set_operator(operator)
    index = problem.basis.index
    before = np.ones(len(index), dtype=bool)
    x = problem.V.tabulate_dof_coordinates()[index // 3]
    after = (x[:, 0] < 2.9) | (x[:, 1] < 0.9)
    r = loads(problem)
    r.scale(-100.0)
    model = QuadraticModel(r, np.zeros(len(index)), work, RTOL)
    gradient = problem.create_vector()

    afresh = program.minimise(model, after, problem.create_vector())
    dear = linear.iterations
    program.set_operator(operator)
    first = program.minimise(model, before, problem.create_vector())
    linear.iterations = 0
    corrected = program.correct(first, after)
    if kind == "mg":
        assert 0 < linear.iterations < dear
    assert corrected.multiplier == pytest.approx(afresh.multiplier, rel=1e-5)
    if work is not None:
        assert loads(problem).dot(corrected.delta) == pytest.approx(work, rel=1e-12)
    program.gradient(corrected, gradient)
    gradient.array[index[after]] = 0
    allowed = RTOL * r.norm() * (1 if work is None else 3)
    assert gradient.norm() <= 1.1 * allowed
    rounding = 1e-14 * corrected.delta.norm(PETSc.NormType.NORM_INFINITY)
    assert np.abs(corrected.delta.array_r[index[after]]).max(initial=0) <= rounding
    difference = corrected.delta - afresh.delta
    assert difference.norm() < 1e-4 * afresh.delta.norm()


def test_a_correction_keeps_what_its_solution_was_allowed() -> None:
    problem = two_blocks_problem(2)
    program = EqualityProgram(problem, LinearSolver(problem))
    program.set_operator(elastic_operator(problem))
    held = np.ones(len(problem.basis.index), dtype=bool)
    model = QuadraticModel(loads(problem), np.zeros(held.size), None, RTOL)
    delta = problem.create_vector()
    first = program.minimise(model, held, delta)
    corrected = program.correct(first, ~held)
    assert (first.solves, corrected.solves) == (1, 2)
    assert corrected.delta is first.delta is delta
    assert first.held.all()
    assert not corrected.held.any()
    assert corrected.accuracy == first.accuracy > 0
    assert corrected.force_tolerance == first.force_tolerance > 0
    held[:] = False
    assert first.held.all(), "a solution should keep its flags, whatever becomes of the array"


def test_what_is_right_already_is_left_alone() -> None:
    problem = two_blocks_problem(2)
    linear = LinearSolver(problem)
    program = EqualityProgram(problem, linear)
    program.set_operator(elastic_operator(problem))
    held = np.ones(len(problem.basis.index), dtype=bool)
    model = QuadraticModel(loads(problem), np.zeros(held.size), None, RTOL)
    solution = program.minimise(model, held, problem.create_vector())
    before = solution.delta.copy()
    again = program.correct(solution, held)
    assert linear.solves == 1
    assert again.solves == 2
    largest = before.norm(PETSc.NormType.NORM_INFINITY)
    before.axpy(-1.0, again.delta)
    assert before.norm(PETSc.NormType.NORM_INFINITY) <= 1e-14 * largest


@pytest.mark.mpi3
def test_held_pairs_have_the_jumps_they_are_given() -> None:
    problem = two_blocks_problem(2)
    program = EqualityProgram(problem, LinearSolver(problem))
    program.set_operator(elastic_operator(problem))
    index = problem.basis.index
    jumps = -1e-3 * (1.0 + np.arange(len(index)))
    held = np.ones(len(index), dtype=bool)
    held[::2] = False
    model = QuadraticModel(loads(problem), jumps, None, RTOL)
    solution = program.minimise(model, held, problem.create_vector())
    given = solution.delta.array_r[index[held]]
    np.testing.assert_allclose(given, jumps[held], rtol=1e-14)


def test_no_solution_without_any_held_pair() -> None:
    """Only contact with the lower block holds the upper block of the stack."""
    problem = stack_problem(2)
    program = EqualityProgram(problem, LinearSolver(problem))
    program.set_operator(elastic_operator(problem))
    none = np.zeros(len(problem.basis.index), dtype=bool)
    model = QuadraticModel(loads(problem), np.zeros(none.size), None, RTOL)
    with pytest.raises(LinearFailure, match=r"MUMPS Cholesky: .*singular"):
        program.minimise(model, none, problem.create_vector())
