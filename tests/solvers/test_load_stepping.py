"""Steps of the work that are chosen: growth, halving, extrapolation."""

import logging
from itertools import islice

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Level
from perfplast_fenicsx.solvers.load_stepping import extrapolate, work_path
from perfplast_fenicsx.solvers.work_newton import WorkNewton
from tests.models import punch_problem, two_blocks_problem
from tests.solvers.levels import TIGHT, Timid, converged, curve, points


@pytest.mark.mpi3
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
