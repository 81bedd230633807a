"""Test ALG3 and ALG4: the program they solve, and the properties of the curve ζ(α)."""

import itertools
import math

from mpi4py import MPI

import numpy as np
import pytest
import ufl

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    InputError,
    Newton,
    NewtonOptions,
    PorePressure,
    Pressure,
    Problem,
    Support,
    load_path,
)
from perfplast_fenicsx.problem import Load
from perfplast_fenicsx.problem.assembled.spaces import Integral
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.newton import BorderedNewton, WorkNewton
from tests.contact.blocks_apart import blocks_apart
from tests.models import (
    PUNCH_LIMIT,
    STACK_HEIGHTS,
    STACK_YOUNG,
    STEEL,
    punch_problem,
    stack_problem,
    two_blocks_problem,
)
from tests.solvers.levels import TIGHT, TWO_BLOCKS_LIMIT, converged, curve, energy, points


def test_energy_criterion_of_the_work_methods_is_the_change_of_the_energy() -> None:
    options = NewtonOptions(stopping="energy", tolerance=1e-12)
    level = WorkNewton(punch_problem(4), options).solve(1e-3)
    assert level.report.converged
    for before, step in itertools.pairwise(level.iterations):
        energies = [record.energy + record.zeta * record.alpha for record in (before, step)]
        change = abs(energies[1] - energies[0]) / sum(energies)
        load_change = abs(step.zeta - before.zeta) / step.zeta
        assert step.increment == pytest.approx(max(change, load_change), rel=1e-6, abs=1e-12)
    known = WorkNewton(punch_problem(4), TIGHT).solve(1e-3)
    assert level.state.zeta == pytest.approx(known.state.zeta, rel=1e-10)


@pytest.mark.parametrize("method", [WorkNewton, BorderedNewton])
def test_a_block_held_by_contact_alone(method: type[WorkNewton]) -> None:
    compliance = sum(h / e for h, e in zip(STACK_HEIGHTS, STACK_YOUNG, strict=True))
    [level] = converged([method(stack_problem(2), TIGHT).solve(200.0 * compliance)])
    assert level.state.zeta == pytest.approx(200.0, rel=1e-9)


@pytest.mark.mpi2
def test_both_work_methods_solve_the_same_program_with_contact() -> None:
    """Compare KKT conditions of ALG3, and both solves of ALG4, with dense linear algebra."""
    problem = two_blocks_problem(2, comm=MPI.COMM_SELF)
    [start] = converged([WorkNewton(problem, TIGHT).solve(0.05)])
    iterate = Iterate(problem)
    program = ContactProgram(problem, LinearSolver(problem))
    active, zeta = iterate.begin(start.state), start.state.zeta
    operator = iterate.operator(1e-6)
    program.set_operator(operator)
    missing = 0.1 - iterate.work()
    r, room = iterate.gradient(zeta).array.copy(), iterate.room()
    step = program.solve(iterate.gradient(zeta), room, active, rtol=1e-12, work=missing)
    assert step.settled
    assert step.iterations > 1, "the active set should change, or little is tested"

    operator.hold(np.zeros(0, dtype=np.int32))
    A = operator.matrix.convert("dense").getDenseArray().copy()
    index, load = problem.basis.index, problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, load)
    border, delta = load.array.copy(), step.delta.array.copy()
    force = A @ delta + r - step.multiplier * border
    noise = 1e-9 * np.abs(border).max() * zeta
    free = np.ones(len(r), dtype=bool)
    free[index[step.active]] = False
    fixed = problem.fixed[: len(r) // 3].ravel()
    assert np.abs(force[free]).max() < noise
    assert force[index[step.active]].max() < noise
    rounding = 1e-14 * np.abs(delta).max()
    assert np.abs(delta[index] - room)[step.active].max() <= rounding
    assert (delta[index] <= room + rounding).all()
    assert border @ delta == pytest.approx(missing, rel=1e-10)

    # ALG4 on this active set, with given δ
    free &= ~fixed
    given = np.zeros(len(r))
    given[index[step.active]] = room[step.active]
    v, w = given.copy(), np.zeros(len(r))
    K = A[np.ix_(free, free)]
    v[free] = np.linalg.solve(K, -(r + A @ given)[free])
    w[free] = np.linalg.solve(K, border[free])
    change = (missing - border @ v) / (border @ w)
    assert step.multiplier == pytest.approx(change, rel=1e-8)
    assert np.abs(delta - (v + change * w)).max() < 1e-9 * np.abs(delta).max()


def test_bordered_newton_takes_the_undamped_steps_of_work_newton() -> None:
    problem = two_blocks_problem(2)
    undamped = NewtonOptions(tolerance=1e-10, damping=False)
    start = WorkNewton(problem).first_yield()
    one, other = (
        solver.solve(2 * start.alpha, start)
        for solver in (WorkNewton(problem, undamped), BorderedNewton(problem, TIGHT))
    )
    converged([one, other])
    assert len(one.iterations) == len(other.iterations) > 2
    for a, b in zip(one.iterations, other.iterations, strict=True):
        assert a.zeta == pytest.approx(b.zeta, rel=1e-9)
        assert a.alpha == pytest.approx(b.alpha, rel=1e-9)
        assert a.energy == pytest.approx(b.energy, rel=1e-9)
        assert b.beta == 1
    assert np.allclose(one.state.u.x.array, other.state.u.x.array, rtol=0, atol=1e-11)


def test_load_rises_with_the_work_and_stays_below_its_limit() -> None:
    _, _, levels = curve()
    _, zetas = points(levels)
    assert (np.diff(zetas) > 0).all()
    assert zetas[-1] < TWO_BLOCKS_LIMIT[2]
    assert zetas[-1] > 0.999 * TWO_BLOCKS_LIMIT[2]


def test_load_is_proportional_to_the_work_up_to_first_yield() -> None:
    _, first, levels = curve()
    alphas, zetas = points(levels)
    elastic = alphas <= first.alpha
    slope = first.zeta / first.alpha
    assert elastic.sum() >= 5
    assert zetas[elastic] == pytest.approx(slope * alphas[elastic], rel=1e-9)
    assert [level.report.plastic_cells == 0 for level in levels] == elastic.tolist()
    assert (zetas[~elastic] < slope * alphas[~elastic]).all()


def test_curve_is_continuous() -> None:
    """No secant is steeper than the elastic branch."""
    _, first, levels = curve()
    alphas, zetas = points(levels)
    slopes = np.diff(zetas) / np.diff(alphas)
    assert slopes.max() < (1 + 1e-7) * first.zeta / first.alpha


def test_energy_is_convex_and_the_load_its_derivative() -> None:
    _, _, levels = curve()
    alphas, zetas = points(levels)
    secants = np.diff([energy(level) for level in levels]) / np.diff(alphas)
    assert (np.diff(secants) > 0).all()
    assert (zetas[:-1] < secants).all()
    assert (secants < zetas[1:]).all()


@pytest.mark.parametrize("i", [3, 12, 18, 25])
def test_energy_differences_are_the_load(i: int) -> None:
    problem, _, levels = curve()
    solver, level, h = WorkNewton(problem, TIGHT), levels[i], 1e-5
    alpha = level.state.alpha
    low, high = (converged([solver.solve(alpha * s, level.state)])[0] for s in (1 - h, 1 + h))
    difference = (energy(high) - energy(low)) / (2 * h * alpha)
    assert difference == pytest.approx(level.state.zeta, rel=1e-6)


def test_load_is_the_power_of_the_stress() -> None:
    problem, _, levels = curve()
    fields = QuadratureFields(problem)
    power = Integral(problem.comm, ufl.dot(fields.stress, fields.e) * problem.dx)
    for level in levels:
        fields.u.x.array[:] = level.state.u.x.array
        fields.update()
        zeta = power() / level.state.alpha
        assert zeta == pytest.approx(level.state.zeta, rel=1e-8)


def test_a_gap_closes_first_and_bends_the_curve() -> None:
    """Elastic, but not proportional: the upper block bends alone at first."""
    problem = two_blocks_problem(2, gap=1e-4)
    solver = WorkNewton(problem, TIGHT)
    works = np.geomspace(1e-6, 3e-2, 20)
    levels = converged(list(load_path(solver, works)))
    _, zetas = points(levels)
    assert (np.diff(zetas) > 0).all()
    elastic = [level for level in levels if level.report.plastic_cells == 0]
    assert elastic[0].report.active_contacts == 0 < elastic[-1].report.active_contacts
    stiffness = np.array([level.state.zeta / level.state.alpha for level in elastic])
    assert stiffness[1] == pytest.approx(stiffness[0], rel=1e-8)
    assert stiffness[-1] > 1.2 * stiffness[0]
    newton = load_path(Newton(problem, TIGHT), zetas)
    for known, level in zip(levels, newton, strict=True):
        converged([level])
        assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-7)


def test_no_work_is_no_displacement() -> None:
    for method in (WorkNewton, BorderedNewton):
        level = method(punch_problem(2)).solve(0.0)
        assert level.report.converged
        assert level.state.zeta == pytest.approx(0, abs=1e-12 * PUNCH_LIMIT)
        assert level.state.alpha == pytest.approx(0, abs=1e-18)


@pytest.mark.parametrize(
    ("alpha", "words"),
    [(-1.0, "is negative; give a value >= 0"), (math.nan, "not finite"), (math.inf, "not finite")],
)
@pytest.mark.parametrize("method", [WorkNewton, BorderedNewton])
def test_impossible_work_is_refused(method: type[WorkNewton], alpha: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        method(punch_problem(2)).solve(alpha)


@pytest.mark.parametrize(
    "constant",
    [
        [],
        [BodyForce("upper", (0.0, -10.0), constant=True)],
        [PorePressure("upper", 5.0, constant=True)],
    ],
)
def test_alg4_far_beyond_first_yield(constant: list[Load]) -> None:
    """Undamped steps from there diverge; damped steps then agree with ALG3."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, [4, 4], [4, 4], moved_by=0.0),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("x0", "x"), Support("upper_x0", "x")],
        [Pressure("top", 1.0), *constant],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    damped, mended = converged(
        [method(problem).solve(0.02) for method in (WorkNewton, BorderedNewton)]
    )
    assert mended.report.zeta == pytest.approx(damped.report.zeta, rel=1e-6)
    assert mended.iterations[1].beta == pytest.approx(1.0)
