"""Test limit loads against exact ones, and searches without a result."""

import logging
import math

from mpi4py import MPI

import pytest
import ufl

import perfplast_fenicsx.limit_analysis.discrete.limit_load as choice
from meshes.thick_sphere import write_thick_sphere
from perfplast_fenicsx import (
    Contact,
    Elastic,
    Flow,
    Hardening,
    InputError,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    VonMises,
    limit_bounds,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.limit_load import method_for
from perfplast_fenicsx.limit_analysis.limit_search import limit_load
from perfplast_fenicsx.limit_analysis.path.limit_judge import Judge, Search, extrapolated_limit
from perfplast_fenicsx.problem import Level
from perfplast_fenicsx.problem.assembled.spaces import Integral
from perfplast_fenicsx.solvers.linear import factorisation
from perfplast_fenicsx.solvers.load_stepping import MOST_HALVINGS
from perfplast_fenicsx.solvers.newton import BorderedNewton
from tests.models import PUNCH_LIMIT, Read, l_plate_problem, punch_problem, stack_problem
from tests.solvers.levels import PLATE_LIMIT, SERIAL, Timid


def test_loading_ends_where_no_step_is_short_enough(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Timid, "boldest", 1.0)
    with caplog.at_level(logging.INFO, logger="perfplast_fenicsx.solvers.load_stepping"):
        problem = punch_problem(4)
        limit = limit_load(problem, 1e-3, Timid(problem))
    assert caplog.text.count("half the step") == MOST_HALVINGS
    assert not limit.levelled_off
    assert "too far; the bounds are still" in limit.reason
    assert limit.lower == pytest.approx(limit.levels[0].state.zeta)
    assert limit.upper is not None
    assert limit.upper > PUNCH_LIMIT * (1 - 1e-9)
    assert limit.estimate == pytest.approx((limit.lower + limit.upper) / 2)


@pytest.mark.parametrize("n", [1, 2])
def test_limit_load_of_a_plate(n: int) -> None:
    limit = limit_load(l_plate_problem(n), 1e-4, method="path")
    assert limit.levelled_off
    assert PLATE_LIMIT * (1 - 1e-4) < limit.lower < PLATE_LIMIT
    assert limit.estimate == pytest.approx(PLATE_LIMIT, rel=1e-4)
    assert limit.upper is not None
    assert limit.upper >= PLATE_LIMIT * (1 - 1e-9)
    assert limit.linear_solves < 250


@SERIAL
@pytest.mark.long
def test_limit_load_of_a_fine_plate_in_few_solves() -> None:
    limit = limit_load(l_plate_problem(4), 5e-3, method="path")
    assert limit.levelled_off
    assert limit.lower == pytest.approx(PLATE_LIMIT, rel=1e-3)
    assert limit.estimate == pytest.approx(PLATE_LIMIT, rel=1e-3)
    assert limit.upper is not None
    assert limit.lower < PLATE_LIMIT <= limit.upper <= limit.lower * (1 + 5e-3)
    assert limit.linear_solves <= 170


@pytest.mark.mpi2
def test_limit_load_of_a_punch() -> None:
    limit = limit_load(punch_problem(8), 1e-4, method="path")
    assert limit.levelled_off
    assert limit.lower < PUNCH_LIMIT < limit.lower * (1 + 1e-4)
    assert limit.estimate == pytest.approx(PUNCH_LIMIT, rel=1e-4)
    assert limit.upper is None or limit.upper >= PUNCH_LIMIT * (1 - 1e-9)
    assert limit.alpha == limit.levels[-1].state.alpha


def test_limit_load_of_a_punch_by_bordered_newton() -> None:
    problem = punch_problem(4)
    solver = BorderedNewton(problem, NewtonOptions(stopping="stress", tolerance=1e-4))
    limit = limit_load(problem, 1e-4, solver)
    assert limit.lower == pytest.approx(PUNCH_LIMIT, rel=1e-4)


def test_limit_load_of_a_block_held_by_contact_alone() -> None:
    limit = limit_load(stack_problem(3), 1e-6, method="path")
    assert limit.lower == pytest.approx(300.0, rel=1e-10)
    assert limit.upper == pytest.approx(300.0, rel=1e-10)


@pytest.mark.long
@pytest.mark.serial
def test_shells_of_two_steels_end_with_a_bracket(read: Read) -> None:
    """ζ increases slowly to the limit load; earlier, a path reported no limit load."""
    problem = Problem(
        read(write_thick_sphere, interface=1.5, size=0.35, order=2),
        {
            "inner_shell": VonMises(210e3, 0.3, 240.0),
            "outer_shell": VonMises(70e3, 0.33, 355.0),
        },
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")],
        [Pressure("inner", 1.0)],
        [Contact("inner_shell_seam", "outer_shell_seam")],
        degree=2,
    )
    limit = limit_load(problem, 1e-4, method="path")
    assert limit.levelled_off, limit.reason
    assert limit.upper is not None
    assert limit.estimate is not None
    assert limit.lower <= limit.estimate <= limit.upper <= limit.lower * (1 + 1e-4)
    exact = 2 * (240 * math.log(1.5) + 355 * math.log(2 / 1.5))
    assert limit.estimate == pytest.approx(exact, rel=1e-2)
    assert limit.linear_solves <= 120


def test_collapse_mechanism_does_unit_work_and_keeps_volume() -> None:
    problem = punch_problem(4)
    v = limit_load(problem, 1e-6, method="path").mechanism
    assert float(problem.loads.live.dot(v.x.petsc_vec)) == pytest.approx(1.0)
    dx = problem.dx
    volume, shape = (
        Integral(problem.comm, form * dx)()
        for form in (ufl.div(v) ** 2, ufl.inner(ufl.sym(ufl.grad(v)), ufl.sym(ufl.grad(v))))
    )
    assert volume < 1e-8 * shape


def test_bodies_that_never_yield_have_no_limit_load() -> None:
    problem = Problem(
        stacked_blocks(MPI.COMM_WORLD, 1),
        {"lower": Elastic(2e5, 0.3), "upper": Elastic(7e4, 0.2)},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
    )
    limit = limit_load(problem, 1e-3, method="path")
    assert not limit.levelled_off
    assert limit.estimate is limit.upper is None
    assert "does not level off" in limit.reason
    assert limit.lower > 1e4


@pytest.mark.mpi2
def test_both_methods_find_the_same() -> None:
    problem = punch_problem(4)
    path, direct = limit_load(problem, 1e-4, method="path"), limit_load(problem, 1e-4)
    assert (path.method, direct.method) == (LimitMethod.PATH, LimitMethod.INTERIOR_POINT)
    assert path.estimate == pytest.approx(direct.estimate, rel=1e-4)
    assert direct.upper is not None
    assert path.lower < direct.upper < direct.lower * (1 + 1e-4)
    assert direct.factorisations is not None
    assert direct.factorisations <= 35
    assert (len(direct.levels), direct.alpha) == (0, None)
    assert problem.loads.alpha(direct.mechanism.x.petsc_vec) == pytest.approx(1)
    assert f"{direct.iterations} steps" in repr(direct)
    assert f"{path.iterations} levels" in repr(path)


def test_what_belongs_to_a_path_gives_one() -> None:
    problem = punch_problem(2)
    levels: list[Level] = []
    limit = limit_load(problem, 1e-2, on_level=lambda level, _: levels.append(level))
    assert limit.method is LimitMethod.PATH
    assert len(levels) == limit.iterations
    with pytest.raises(InputError, match="are arguments of a loading path"):
        limit_load(problem, 1e-2, Timid(problem), method="interior-point")


def test_an_unknown_method_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'path'"):
        limit_load(punch_problem(2), method="pathe")


@pytest.mark.parametrize("remembers", [False, True])
def test_bodies_that_harden_have_no_limit(remembers: bool) -> None:
    body = Hardening(2e5, 0.3, 300.0, kinematic=1e4)
    problem = Problem(
        stacked_blocks(MPI.COMM_WORLD, 1),
        {"lower": VonMises(2e5, 0.3, 300.0), "upper": Flow(body) if remembers else body},
        [Support("bottom"), Support("top", "xy")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    for sought in (
        limit_load,
        limit_bounds,
        lambda problem: limit_load(problem, method="interior-point"),
    ):
        with pytest.raises(InputError, match=r"^the material of 'upper' hardens"):
            sought(problem)


def test_large_problems_are_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    assert method_for(punch_problem(2)) is LimitMethod.INTERIOR_POINT
    monkeypatch.setattr(choice, "MOST_UNKNOWNS", {2: 10, 3: 10})
    assert method_for(punch_problem(2)) is LimitMethod.PATH


def test_a_path_is_followed_where_no_factorisation_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program selects the path itself, or says so if the case selects the other method."""
    problem = stack_problem(1)
    monkeypatch.setattr(factorisation, "has_memory", lambda comm, needed: (False, 2e10, 1e10))
    found = limit_load(problem)
    assert found.method is LimitMethod.PATH
    assert found.estimate == pytest.approx(300.0, rel=1e-3)
    with pytest.raises(InputError, match=r"at least .*limit_method = 'path'"):
        limit_load(problem, method="interior-point")


def test_extrapolation_of_a_power_law_is_exact() -> None:
    for p in (0.2, 0.5, 1.0, 2.0, 5.0):
        found = [(a, 7.0 - 3.0 * a**-p) for a in (1.5, 4.0, 9.0)]
        assert extrapolated_limit(found) == pytest.approx(7.0, rel=1e-9)
    assert extrapolated_limit([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 1.5), (4.0, 2.2)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 1.5)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 3.0), (4.0, 3.0)]) == pytest.approx(3.0)


@pytest.mark.parametrize("rtol", [0.0, -1e-3, 1.0, math.nan])
def test_a_limit_tolerance_out_of_range_is_refused(rtol: float) -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        limit_load(punch_problem(2), rtol)


@SERIAL
@pytest.mark.parametrize(("upper", "known"), [(1.00005, True), (0.99995, True), (0.999, False)])
def test_a_level_above_the_load_of_a_mechanism_is_told(upper: float, known: bool) -> None:
    search = Search(points=[(1.0, 1.0)], upper=upper)
    Judge(punch_problem(2), 1e-4, search)._decide(1.0)
    assert search.ended
    assert search.levelled_off == known
    assert ("above the load of a mechanism" in search.reason) == (not known)
