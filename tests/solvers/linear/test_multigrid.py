"""Test multigrid against a factorisation, on finer meshes, and with plastic flow."""

from collections.abc import Callable

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import Newton, NewtonOptions, Problem
from perfplast_fenicsx.solvers.linear import linear_solver, smoothed_aggregation
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.linear.multigrid import Multigrid
from perfplast_fenicsx.solvers.load_stepping import load_path
from tests.models import l_plate_problem, punch_problem, stack_problem, two_blocks_problem
from tests.solvers.linear.systems import (
    corner_problem,
    elastic_operator,
    loads,
    quadratic_problem,
)

TIGHT = NewtonOptions(tolerance=1e-10)


@pytest.mark.mpi2("two blocks")
@pytest.mark.long(but=["two blocks"])
@pytest.mark.parametrize(
    ("make", "levels", "most"),
    [
        (lambda: two_blocks_problem(4), (60.0, 120.0), 20),
        (lambda: two_blocks_problem(4, gap="0.001 + 0.002*x"), (60.0,), 20),
        (lambda: punch_problem(4), (450.0,), 25),
        (lambda: stack_problem(4), (200.0,), 20),
        (lambda: l_plate_problem(1), (0.9,), 45),
        (corner_problem, (200.0, 400.0), 30),
        (quadratic_problem, (60.0, 80.0), 45),
    ],
    ids=["two blocks", "gap", "punch", "held by contact", "plate", "two normals", "quadratic"],
)
def test_multigrid_gives_what_a_factorisation_gives(
    multigrid: None, make: Callable[[], Problem], levels: tuple[float, ...], most: int
) -> None:
    problem = make()
    iterative = Newton(problem, TIGHT)
    assert iterative.linear.name == "CG + smoothed aggregation"
    PETSc.Options().delValue("perfplast_pc_type")
    direct = Newton(problem, TIGHT)
    assert direct.linear.name == "MUMPS Cholesky"
    for one, other in zip(load_path(iterative, levels), load_path(direct, levels), strict=True):
        assert one.report.converged
        assert other.report.converged
        assert one.state.alpha == pytest.approx(other.state.alpha, rel=1e-9)
        difference = one.state.u.x.petsc_vec - other.state.u.x.petsc_vec
        assert difference.norm() < 1e-8 * other.state.u.x.petsc_vec.norm()
        assert abs(one.report.duality_gap) < 1e-8
    solves, _, iterations = iterative.linear.counts()
    assert iterations / solves < most


def test_iterations_hardly_grow_as_the_mesh_is_refined(multigrid: None) -> None:
    """All contact is closed, bodies are elastic, and the relative residual is 1e-8."""
    counts = []
    for n in (4, 8):
        problem = two_blocks_problem(n)
        operator = elastic_operator(problem)
        solver = LinearSolver(problem)
        solver.set_operator(operator)
        solver.hold(problem.basis.index)
        b, x = loads(problem), problem.create_vector()
        solver.solve(b, x, 1e-8)
        operator.matrix.mult(x, b)
        counts.append(solver.iterations)
    assert counts[0] <= 16
    assert counts[1] <= 20


@pytest.mark.long
def test_flow_makes_fewer_iterations_where_coarse_spaces_follow_it(
    multigrid: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reduction is about a sixth, and depends on the partition."""
    counts, alphas = [], []
    for worth in (np.inf, 1.0):
        monkeypatch.setattr(linear_solver, "WORTH_A_MOTION", worth)
        solver = Newton(two_blocks_problem(8), TIGHT)
        levels = list(load_path(solver, (100.0, 150.0)))
        assert all(level.report.converged for level in levels)
        alphas.append(levels[-1].report.alpha)
        counts.append(solver.linear.iterations)
    assert alphas[1] == pytest.approx(alphas[0], rel=1e-9)
    assert counts[1] < counts[0]  # by 5 to 17 %, depending on the partition


@pytest.mark.mpi3
def test_a_system_is_solved_to_its_tolerance(multigrid: None) -> None:
    problem = two_blocks_problem(4)
    operator, b, held = elastic_operator(problem), loads(problem), problem.basis.index
    method = Multigrid(problem)
    assert method.prepare(operator)
    operator.hold(held)
    method.set_matrix(operator, held)
    method.renew(None)
    x, residual = problem.create_vector(), problem.create_vector()
    iterations = []
    for rtol in (1e-2, 1e-8):
        outcome = method.solve(b, x, rtol)
        assert outcome.solved
        iterations.append(outcome.iterations)
        operator.matrix.mult(x, residual)
        residual.axpy(-1.0, b)
        assert residual.norm() <= 1.01 * rtol * b.norm()
    assert 0 < iterations[0] < iterations[1]
    method.destroy()


def test_a_problem_without_aggregates_is_factorised(
    multigrid: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(smoothed_aggregation, "aggregate", lambda *_: [])
    problem = two_blocks_problem(2)
    operator = elastic_operator(problem)
    assert not Multigrid(problem).prepare(operator)
    solver = LinearSolver(problem)
    assert not solver.direct
    solver.set_operator(operator)
    assert solver.direct
