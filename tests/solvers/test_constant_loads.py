"""Test constant loads on a path: the level at ζ = 0, both limits, excessive loads, a search."""

from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BodyForce,
    BorderedNewton,
    InputError,
    LimitLoad,
    Newton,
    PorePressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    WorkNewton,
    l_plate,
    limit_load,
    load_path,
)
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitMethod
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.problem import Load, LoadCase
from perfplast_fenicsx.solvers.load_stepping import work_path
from tests.models import PUNCH_LIMIT, STEEL, punch_problem

PLANES = (Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z"))
PULL = Traction("top", (0.0, 200.0, 0.0))
METHODS = [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton]


@cache
def mesh() -> TaggedMesh:
    return l_plate(MPI.COMM_WORLD, 1)


def plate(*loads: Load, moved: float = 0.0, degree: int = 1) -> Problem:
    supports = [*PLANES[:3], Support("z1", "z", moved)]
    return Problem(mesh(), {"plate": STEEL}, supports, [PULL, *loads], degree=degree)


def pulled(share: float) -> Traction:
    """Return the problem with a constant tension, relative to the limit."""
    return Traction("top", (0.0, share * 200.0 * limit().upper, 0.0), constant=True)


@cache
def limit() -> LimitLoad:
    found = limit_load(plate(), 1e-3)
    assert found.method is LimitMethod.INTERIOR_POINT
    return found


@pytest.mark.mpi2("Newton")
@pytest.mark.parametrize("method", METHODS)
def test_the_state_at_rest_comes_first(method: type) -> None:
    weighed = plate(BodyForce("plate", (0.0, -1.0, 0.0), "weight", constant=True))
    solver = method(weighed)
    works = method in (WorkNewton, BorderedNewton)
    rest, level = load_path(solver, [0.2] if works else [0.3])
    assert rest.report.converged
    assert level.report.converged
    assert rest.state.zeta == pytest.approx(0, abs=1e-12)
    assert rest.state.alpha < 0
    again = list(load_path(solver, [0.2] if works else [0.3], start=rest.state))
    assert len(again) == 1
    assert again[0].state.alpha == pytest.approx(level.state.alpha, rel=1e-6)


def test_a_path_that_names_the_state_at_rest_has_it_once() -> None:
    weighed = plate(BodyForce("plate", (0.0, -1.0, 0.0), constant=True))
    assert [level.state.zeta for level in load_path(Newton(weighed), [0.0, 0.2])] == [0.0, 0.2]


@pytest.mark.parametrize("method", METHODS)
def test_constant_loads_that_nothing_carries(method: type) -> None:
    levels = list(load_path(method(plate(pulled(1.5))), [0.5, 1.0]))
    assert len(levels) == 1
    report = levels[0].report
    assert not report.converged
    assert "the constant loads alone" in report.reason


def test_both_limits_beside_a_constant_load() -> None:
    """Under 0.4 of the limit, the plate carries 0.6 of the limit in addition, and −1.4."""
    known = limit()
    at_once = limit_load(plate(pulled(0.4)), 1e-3)
    assert at_once.method is LimitMethod.INTERIOR_POINT
    found = limit_load(plate(pulled(0.4)), 1e-3, method="path")
    assert found.method is LimitMethod.PATH
    assert at_once.estimate == pytest.approx(found.estimate, rel=4e-3)
    assert found.levelled_off, found.reason
    assert found.lower == pytest.approx(0.6 * known.upper, rel=4e-3)
    assert found.upper >= 0.6 * known.lower - 1e-9
    assert found.upper == pytest.approx(0.6 * known.upper, rel=4e-3)

    solver = WorkNewton(plate(pulled(0.4)))
    rest = solver.at_rest()
    first = solver.first_step(rest.state)
    assert first > 0
    works = [rest.state.alpha - stretch * first for stretch in (1, 4, 20, 100, 1000)]
    levels = list(load_path(solver, works, start=rest.state))
    assert all(level.report.converged for level in levels)
    zetas = [level.state.zeta for level in levels]
    assert (np.diff(zetas) < 0).all()
    assert zetas[-1] == pytest.approx(-1.4 * known.upper, rel=4e-3)
    assert zetas[-1] >= -1.4 * known.upper * (1 + 1e-9)


def test_what_does_no_work_in_the_mechanism_does_not_matter() -> None:
    """Flow preserves volume, so pore water does no work; moving supports do none either."""
    dry = limit_load(plate(degree=2), 1e-3)
    wet = limit_load(plate(PorePressure("plate", "50 + 3*y"), moved=1e-3, degree=2), 1e-3)
    assert wet.levelled_off, wet.reason
    assert dry.upper is not None
    assert dry.lower * (1 - 2e-3) <= wet.lower <= dry.upper
    assert wet.upper == pytest.approx(dry.upper, rel=2e-3)


def test_steps_go_on_from_the_state_at_rest() -> None:
    weighed = plate(pulled(0.2))
    solver = WorkNewton(weighed)
    path = work_path(solver)
    rest, one, two = (next(path) for _ in range(3))
    assert rest.state.zeta == pytest.approx(0.0, abs=1e-300)
    assert rest.state.alpha < one.state.alpha < two.state.alpha
    grown = (two.state.alpha - rest.state.alpha) / (one.state.alpha - rest.state.alpha)
    assert grown == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("gap", [0.0, "0.0004*x**2"])
def test_contact_under_a_constant_load(gap: float | str) -> None:
    """The punch carries the sum of both pressures, for any initial gap."""
    punch = punch_problem(2, gap)
    dead = punch.create_vector()
    dead.axpy(0.5 * PUNCH_LIMIT, punch.loads.live)
    known = limit_load(punch, 1e-3)
    punch.loads = LoadCase(dead, punch.loads.live)
    found = limit_load(punch, 1e-3)
    assert found.levelled_off, found.reason
    assert found.upper is not None
    assert known.lower is not None
    assert known.upper is not None
    rest = 0.5 * PUNCH_LIMIT
    assert found.lower <= known.upper - rest
    assert found.lower >= (known.lower - rest) * (1 - 2e-3)
    assert known.lower - rest <= found.upper <= (known.upper - rest) * (1 + 2e-3)


def test_what_grows_alone_has_a_limit() -> None:
    dead = Problem(mesh(), {"plate": STEEL}, PLANES, [pulled(0.5)])
    assert Newton(dead).solve(0.0).report.converged
    assert limit_load(dead).question is Question.STANDS
    with pytest.raises(InputError, match="all loads are constant"):
        limit_load(dead, method="path")
    with pytest.raises(InputError, match="all loads are constant"):
        WorkNewton(dead)
