"""Test adaptive steps of the work: growth, halving, extrapolation."""

import logging
from itertools import islice

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Level, Newton, load_path
from perfplast_fenicsx.solvers.load_stepping import extrapolate, work_path
from perfplast_fenicsx.solvers.newton import WorkNewton
from tests.models import punch_problem, two_blocks_problem
from tests.solvers.levels import TIGHT, Timid, converged, curve, points


@pytest.mark.mpi2
def test_one_rank_finds_the_curve_of_several() -> None:
    def levels(comm: MPI.Intracomm) -> list[Level]:
        solver = WorkNewton(two_blocks_problem(2, comm=comm), TIGHT)
        return list(islice(work_path(solver), 6))

    together, alone = (points(converged(levels(c))) for c in (MPI.COMM_WORLD, MPI.COMM_SELF))
    for a, b in zip(together, alone, strict=True):
        assert a == pytest.approx(b, rel=1e-8)


def test_a_step_that_fails_is_halved(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="perfplast_fenicsx.solvers.load_stepping"):
        levels = converged(list(islice(work_path(Timid(punch_problem(4), TIGHT)), 4)))
    assert "too far" in caplog.text
    assert "half the step" in caplog.text
    alphas, _ = points(levels)
    assert alphas[1] == pytest.approx(2 * alphas[0], rel=1e-9)
    assert (alphas[1:] <= 2.1 * alphas[:-1]).all()


def test_extrapolation_is_linear_in_the_work() -> None:
    problem, first, levels = curve()
    one, two = levels[0].state, levels[2].state
    between = extrapolate(problem, one, two, 2 * two.alpha)
    assert between is not None
    work = float(problem.loads.live.dot(between.u.x.petsc_vec))
    assert work == pytest.approx(between.alpha, rel=1e-9)
    assert extrapolate(problem, None, None, 1.0) is None
    assert first.alpha > 0


def test_a_multiple_of_an_elastic_level_takes_one_step() -> None:
    problem = two_blocks_problem(2)
    for solver, values in ((Newton(problem), (10.0, 40.0)), (WorkNewton(problem), (1e-3, 3e-3))):
        first, second = converged(list(load_path(solver, values)))
        assert first.report.newton_iterations > 1
        assert second.report.newton_iterations == 1
        scale = values[1] / values[0]
        assert second.state.zeta == pytest.approx(scale * first.state.zeta, rel=1e-9)
        assert second.state.alpha == pytest.approx(scale * first.state.alpha, rel=1e-9)


def test_a_path_goes_on_as_if_it_had_not_been_ended() -> None:
    solver = Newton(punch_problem(2), TIGHT)
    values = (200.0, 350.0, 400.0)
    whole = converged(list(load_path(solver, values)))
    one, two = (level.state for level in whole[:2])
    [last] = load_path(solver, values[2:], start=two, before=one)
    assert last.report.newton_iterations == whole[2].report.newton_iterations
    assert last.state.alpha == pytest.approx(whole[2].state.alpha, rel=1e-12)


def test_a_line_is_not_followed_far() -> None:
    problem, _, levels = curve()
    one, two = levels[0].state, levels[1].state
    far = extrapolate(problem, one, two, 100 * two.alpha, longest=1.0)
    assert far is not None
    assert far.alpha == pytest.approx(2 * two.alpha - one.alpha, rel=1e-12)
    assert extrapolate(problem, two, two, 1.0) is two


def test_the_first_level_counts_what_led_to_it() -> None:
    """This is the state near first yield, whose work has two digits."""
    solver = WorkNewton(two_blocks_problem(2), TIGHT)
    near, exact = solver.near_yield(), solver.first_yield()
    assert near.alpha == pytest.approx(exact.alpha, rel=0.06)
    assert near.alpha == pytest.approx(float(f"{near.alpha:.1e}"), rel=1e-12)
    work = float(solver.problem.loads.live.dot(near.u.x.petsc_vec))
    assert work == pytest.approx(near.alpha, rel=1e-9)
    before = solver.linear.solves
    level = next(work_path(solver))
    assert level.report.linear_solves == solver.linear.solves - before
    assert level.report.linear_solves > level.report.newton_iterations
    assert level.report.seconds > level.iterations[-1].seconds
