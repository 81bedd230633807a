"""Test the policy: selection of a method, renewal, and replacement."""

from collections.abc import Iterator

from petsc4py import PETSc

import pytest

from perfplast_fenicsx import Newton, Problem
from perfplast_fenicsx.solvers.linear import factorisation, linear_solver
from perfplast_fenicsx.solvers.linear.factorisation import Factorisation, Price
from perfplast_fenicsx.solvers.linear.linear_solver import (
    LinearFailure,
    LinearSolver,
    SetUp,
    chosen_solver,
)
from perfplast_fenicsx.solvers.linear.multigrid import Multigrid
from perfplast_fenicsx.solvers.linear.outcome import Outcome
from perfplast_fenicsx.solvers.linear.petsc_options import default
from tests.models import stack_problem, two_blocks_problem
from tests.solvers.linear.systems import elastic_operator, loads


def test_a_small_problem_is_solved_by_multigrid_too() -> None:
    options = PETSc.Options()
    options["perfplast_pc_type"] = "mg"
    try:
        level = Newton(two_blocks_problem(2)).solve(60.0)
    finally:
        options.delValue("perfplast_pc_type")
    assert level.report.converged


def test_a_set_up_serves_corrections_too(multigrid: None) -> None:
    """The first solve may be a correction, whose cost per digit is not representative."""
    problem = two_blocks_problem(4)
    index = problem.basis.index
    solver = LinearSolver(problem)
    solver.set_operator(elastic_operator(problem))
    b, x = loads(problem), problem.create_vector()
    for held in (index, index[1:], index):
        solver.hold(held)
        solver.solve(b, x, 1e-3, correction=True)
    assert (solver.solves, solver.setups) == (3, 1)


@pytest.fixture
def problem() -> Problem:
    return two_blocks_problem(4)


@pytest.fixture
def solver(problem: Problem, multigrid: None) -> LinearSolver:
    """Return a multigrid solver, with all pairs held and one solved system."""
    solver = LinearSolver(problem)
    solver.set_operator(elastic_operator(problem))
    solver.hold(problem.basis.index)
    solver.solve(loads(problem), problem.create_vector(), 1e-8)
    assert (solver.solves, solver.setups, solver.direct) == (1, 1, False)
    return solver


def failing(monkeypatch: pytest.MonkeyPatch, times: int) -> list[str]:
    """Let multigrid fail a number of times, and collect the calls of the methods."""
    asked: list[str] = []
    left = iter(range(times))
    ways = {Multigrid: Multigrid.solve, Factorisation: Factorisation.solve}

    def watched(way: type[Multigrid | Factorisation]) -> None:
        def solve(self: object, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
            asked.append(way.__name__)
            if way is Multigrid and next(left, None) is not None:
                return Outcome(5, "diverged its")
            return ways[way](self, b, x, rtol)

        monkeypatch.setattr(way, "solve", solve)

    for way in ways:
        watched(way)
    return asked


def residual(solver: LinearSolver, b: PETSc.Vec, x: PETSc.Vec) -> float:
    """Return the residual relative to b."""
    image = b.duplicate()
    solver._current.matrix.mult(x, image)
    image.axpy(-1.0, b)
    return float(image.norm() / b.norm())


@pytest.mark.mpi2("0-True-ways0")
@pytest.mark.parametrize(
    ("failures", "kept", "ways"),
    [
        (0, True, ["Multigrid"]),
        (1, True, ["Multigrid", "Multigrid"]),  # renewed
        (2, True, ["Multigrid", "Multigrid", "Factorisation"]),
        (1, False, ["Multigrid", "Factorisation"]),  # nothing to renew
    ],
)
def test_what_fails_is_renewed_and_then_factorised(
    solver: LinearSolver,
    problem: Problem,
    failures: int,
    kept: bool,
    ways: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    index, b, x = problem.basis.index, loads(problem), problem.create_vector()
    if kept:
        assert solver.hold(index[1:])
        assert solver.setups == 1
    asked = failing(monkeypatch, failures)
    before = solver.iterations
    solver.solve(b, x, 1e-8)
    assert asked == ways
    assert residual(solver, b, x) < 1.01e-8
    assert solver.direct == (ways[-1] == "Factorisation")
    assert solver.name == ("MUMPS Cholesky" if solver.direct else "CG + smoothed aggregation")
    assert solver.setups == len(ways)
    assert solver.solves == 2
    assert solver.iterations > before + 5 * failures


def test_too_large_a_problem_is_not_factorised(
    solver: LinearSolver, problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(vars(solver), "_price", Price(1.0, fits=False))
    asked = failing(monkeypatch, 9)
    message = r"\(CG \+ smoothed aggregation: diverged its\)"
    with pytest.raises(LinearFailure, match=message):
        solver.solve(loads(problem), problem.create_vector(), 1e-8)
    assert asked == ["Multigrid"]


@pytest.mark.parametrize("kept", [True, False])
def test_what_is_slow_is_improved_for_the_next_solve(
    solver: LinearSolver, problem: Problem, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(linear_solver, "FEW_ITERATIONS", 1)
    monkeypatch.setitem(vars(solver), "_price", Price(1.0, fits=True))
    asked = failing(monkeypatch, 0)
    if kept:
        solver.hold(problem.basis.index[1:])
    b, x = loads(problem), problem.create_vector()
    solver.solve(b, x, 1e-8)
    assert asked == ["Multigrid"]
    assert residual(solver, b, x) < 1.01e-8
    assert solver.setups == 2
    assert solver.direct != kept
    solver.solve(b, x, 1e-8)
    assert residual(solver, b, x) < 1.01e-8


def test_multigrid_that_ends_too_early_gives_way(problem: Problem, multigrid: None) -> None:
    """PETSc reports this end."""
    with default("perfplast_ksp_max_it", "2"):
        solver = LinearSolver(problem)
    solver.set_operator(elastic_operator(problem))
    solver.hold(problem.basis.index)
    b, x = loads(problem), problem.create_vector()
    solver.solve(b, x, 1e-8)
    assert solver.direct
    assert residual(solver, b, x) < 1e-10
    assert solver.counts() == (1, 2, 3)


def test_a_singular_system_has_a_reason() -> None:
    """The upper block has separated from the lower block, and nothing holds it."""
    problem = stack_problem(2)
    solver = LinearSolver(problem)
    solver.set_operator(elastic_operator(problem))
    solver.hold(problem.basis.index[:0])
    b = problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, b)
    with pytest.raises(LinearFailure, match=r"MUMPS Cholesky: .*singular"):
        solver.solve(b, problem.create_vector(), 1e-8)


def test_a_set_up_is_kept_until_it_has_cost_more_than_another(
    solver: LinearSolver, problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    index = problem.basis.index
    assert solver.hold(index[1:])
    assert not solver.hold(index[1:])
    assert solver.setups == 1
    solver.solve(loads(problem), problem.create_vector(), 1e-8)
    monkeypatch.setattr(solver._method, "worth", -100)
    assert solver.hold(index)
    assert solver.setups == 2


def test_factors_are_kept_while_few_unknowns_change(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_blocks_problem(4)
    index, b, x = problem.basis.index, loads(problem), problem.create_vector()
    operator, solver = elastic_operator(problem), LinearSolver(problem)
    monkeypatch.setattr(Factorisation, "worth", 60)
    for new, fewer, setups in ((True, 0, 1), (False, 3, 1), (True, 3, 1), (False, len(index), 2)):
        if new:  # with the same values
            solver.set_operator(operator)
        solver.hold(index[fewer:])
        solver.solve(b, x, 1e-8)
        assert residual(solver, b, x) < 1.01e-8
        assert solver.setups == setups
    operator.stiffness.scale(1.001)
    solver.set_operator(operator)
    solver.hold(index)
    assert solver.setups == 3
    monkeypatch.setattr(Factorisation, "worth", 4)  # so CG has too few iterations
    solver.solve(b, x, 1e-8)
    solver.hold(index[1:])
    before = solver.iterations
    solver.solve(b, x, 1e-8)
    assert residual(solver, b, x) < 1.01e-8
    assert solver.setups == 4 or solver.iterations - before <= 4


def test_a_factorisation_has_a_price(solver: LinearSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    """The analysis of the matrix gives a square root of operations per entry of some tens."""
    assert solver._price.fits
    assert 1 < solver._price.iterations < 100
    monkeypatch.setattr(factorisation, "spare_memory", lambda comm: 0.0)
    del vars(solver)["_price"]
    assert not solver._price.fits


def test_the_cost_of_a_set_up_is_counted_against_its_first_full_solve() -> None:
    setup = SetUp()
    setup.note(16, 1e-8)
    assert setup.rate == pytest.approx(2.0)
    assert setup.excess == pytest.approx(0.0, abs=1e-12)
    setup.note(11, 1e-3)
    assert setup.rate == pytest.approx(2.0)
    assert setup.excess == pytest.approx(5.0)


def test_corrections_wear_a_set_up_where_it_is_known_what_is_usual() -> None:
    setup = SetUp()
    setup.note_correction(51, 2e-4)
    assert setup.excess == pytest.approx(0.0)
    setup = SetUp(usual=3.0)
    setup.note_correction(51, 1e-4)
    assert setup.excess == pytest.approx(39.0)
    assert setup.rate == pytest.approx(0.0)


def test_a_set_up_that_only_corrections_saw_new_is_measured_by_the_one_before() -> None:
    setup = SetUp(usual=3.0, kept=True)
    setup.note(34, 1e-3)
    assert setup.rate == pytest.approx(3.0)
    assert setup.excess == pytest.approx(25.0)


@pytest.fixture
def asked(request: pytest.FixtureRequest) -> Iterator[dict[str, str]]:
    options = PETSc.Options()
    for key, value in request.param.items():
        options["perfplast_" + key] = value
    yield request.param
    for key in request.param:
        options.delValue("perfplast_" + key)


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ({}, "MUMPS Cholesky"),
        ({"pc_type": "mg"}, "CG + smoothed aggregation"),
        ({"ksp_type": "cg", "pc_type": "jacobi"}, "cg + jacobi"),
        ({"pc_type": "lu"}, "preonly + lu"),
    ],
    indirect=["asked"],
)
def test_users_choose(problem: Problem, asked: dict[str, str], name: str) -> None:
    solver = LinearSolver(problem)
    assert solver.name == name == chosen_solver(problem)
    assert solver.direct == (name in ("MUMPS Cholesky", "preonly + lu"))
    solver.set_operator(elastic_operator(problem))
    solver.hold(problem.basis.index)
    b, x = loads(problem), problem.create_vector()
    solver.solve(b, x, 1e-8)
    assert residual(solver, b, x) < 1e-7  # CG may use another norm
