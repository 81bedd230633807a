"""All four algorithms against each other, the theory's properties, and limit loads."""

import dataclasses
import itertools
import logging
import math
from collections.abc import Callable, Sequence
from functools import cache
from itertools import islice

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from perfplast_fenicsx import (
    Contact,
    Elastic,
    InputError,
    Level,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    State,
    Support,
    load_path,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis.limit_search import extrapolated_limit, limit_load
from perfplast_fenicsx.problem.quadrature_fields import Integral, QuadratureFields
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.augmented_lagrangian import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
)
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.load_stepping import MOST_HALVINGS, extrapolate, work_path
from perfplast_fenicsx.solvers.newton_options import Monitor
from perfplast_fenicsx.solvers.work_newton import BorderedNewton, WorkNewton
from tests.models import (
    PUNCH_LIMIT,
    STACK_HEIGHTS,
    STACK_YOUNG,
    l_plate_problem,
    punch_problem,
    stack_problem,
    two_blocks_problem,
)

TIGHT = NewtonOptions(tolerance=1e-10)
SERIAL = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="counts solves; slow on many ranks")
PLATE_LIMIT = 2 / math.sqrt(3) * 450 * 5 / 2000
TWO_BLOCKS_LIMIT = {2: 328.78, 4: 325.72, 8: 324.58}
"""Where the curves of these meshes level off, by :func:`limit_search`. They are no limits of the
continuum, which collapses near 75: linear tetrahedra lock."""


def stress_function(problem: Problem, state: State) -> fem.Function:
    """Σ(ε(u)), Mandel vectors."""
    fields = QuadratureFields(problem)
    fields.u.x.array[:] = state.u.x.array
    fields.update()
    return fields.stress


def stress_distance(problem: Problem, one: State, other: State) -> float:
    """‖σ₁ − σ₂‖_E/‖σ₁‖_E."""
    a, b = (stress_function(problem, state) for state in (one, other))
    compliance, dx = problem.moduli.compliance, problem.dx
    change, size = (Integral(problem.comm, ufl.dot(compliance(s), s) * dx)() for s in (b - a, a))
    return math.sqrt(change / size)


def converged(levels: Sequence[Level]) -> Sequence[Level]:
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-6
        assert level.report.max_penetration < 1e-12
    return levels


def energy(level: Level) -> float:
    """E(α) = Ψ(ε(u)), as J_ζ = Ψ − ζα."""
    return level.iterations[-1].energy + level.state.zeta * level.state.alpha


# All four agree


@pytest.mark.mpi3
@pytest.mark.parametrize(
    ("build", "zetas"),
    [
        (lambda: punch_problem(8), (450.0,)),
        (lambda: two_blocks_problem(4), TWO_BLOCKS_LIMIT[4] * np.arange(0.15, 0.91, 0.15)),
    ],
    ids=["punch", "two_blocks"],
)
def test_all_four_find_the_same_stress(
    build: Callable[[], Problem], zetas: Sequence[float]
) -> None:
    """Undamped, ALG4 gets there by steps alone: at once to 60 % it goes round in circles."""
    problem = build()
    reference = converged(list(load_path(Newton(problem, TIGHT), zetas)))
    alphas = [level.state.alpha for level in reference]
    uzawa = AugmentedLagrangian(problem, AugmentedLagrangianOptions(tolerance=2e-9))
    others: list[tuple[LevelSolver, Sequence[float]]] = [
        (uzawa, zetas),
        (WorkNewton(problem, TIGHT), alphas),
        (BorderedNewton(problem, TIGHT), alphas),
    ]
    for solver, values in others:
        levels = converged(list(load_path(solver, values)))
        for level, known in zip(levels, reference, strict=True):
            assert stress_distance(problem, known.state, level.state) < 1e-6
            assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-7)
            assert level.state.zeta == pytest.approx(known.state.zeta, rel=1e-7)
            assert level.report.smallest_contact_force > -1e-6 * known.state.zeta
    assert uzawa.linear.setups < uzawa.linear.solves / 4


@SERIAL
@pytest.mark.parametrize("share", [0.6, 0.9])
def test_all_four_find_the_same_stress_on_a_finer_mesh(share: float) -> None:
    """ALG2 once stopped 1e-6 away here, at pairs that pulled weakly."""
    problem = two_blocks_problem(8)
    zeta = share * TWO_BLOCKS_LIMIT[8]
    near, known = converged(list(load_path(Newton(problem, TIGHT), [0.97 * zeta, zeta])))
    options = AugmentedLagrangianOptions(tolerance=1e-9)
    others = [AugmentedLagrangian(problem, options).solve(zeta)]
    for method in (WorkNewton, BorderedNewton):
        others.append(method(problem, TIGHT).solve(known.state.alpha, near.state))
    for level in converged(others):
        assert stress_distance(problem, known.state, level.state) < 1e-6
        assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-7)
        assert level.state.zeta == pytest.approx(zeta, rel=1e-7)


@pytest.mark.parametrize("control", ["load", "work"])
def test_a_nearly_incompressible_body(control: str) -> None:
    problem = punch_problem(4, poisson=0.499)
    [known] = converged(list(load_path(Newton(problem, TIGHT), [470.0])))
    if control == "load":
        options = AugmentedLagrangianOptions(tolerance=1e-8)
        [level] = converged([AugmentedLagrangian(problem, options).solve(470.0)])
        assert level.state.alpha == pytest.approx(known.state.alpha, rel=1e-6)
    else:
        [level] = converged([WorkNewton(problem, TIGHT).solve(known.state.alpha)])
        assert level.state.zeta == pytest.approx(470.0, rel=1e-9)


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


# ALG4 is ALG3


def test_both_work_methods_solve_the_same_program_with_contact() -> None:
    """Against dense linear algebra: KKT conditions of ALG3's program, and ALG4's two solves."""
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
    assert np.array_equal(delta[index[step.active]], room[step.active])
    assert (delta[index] <= room + 1e-15).all()
    assert border @ delta == pytest.approx(missing, rel=1e-10)

    # ALG4 on this active set, δ there being given
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


# Properties 1 to 6 along a loading curve with contact


@cache
def curve() -> tuple[Problem, State, list[Level]]:
    """First yield, and levels from the elastic branch to the plateau."""
    problem = two_blocks_problem(2)
    solver = WorkNewton(problem, TIGHT)
    first = solver.first_yield()
    alphas = first.alpha * np.geomspace(0.2, 300.0, 34)
    return problem, first, [*converged(list(load_path(solver, alphas)))]


def points(levels: Sequence[Level]) -> tuple[np.ndarray, np.ndarray]:
    states = [level.state for level in levels]
    return np.array([s.alpha for s in states]), np.array([s.zeta for s in states])


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


@pytest.mark.mpi3
def test_one_rank_finds_the_curve_of_several() -> None:
    def levels(comm: MPI.Intracomm) -> list[Level]:
        solver = WorkNewton(two_blocks_problem(2, comm=comm), TIGHT)
        return list(islice(work_path(solver), 6))

    together, alone = (points(converged(levels(c))) for c in (MPI.COMM_WORLD, MPI.COMM_SELF))
    for a, b in zip(together, alone, strict=True):
        assert a == pytest.approx(b, rel=1e-8)


# Loading by work


class Timid(WorkNewton):
    """Gives up where the work grows by more than a factor."""

    boldest = 2.1

    def solve(
        self, alpha: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        level = super().solve(alpha, start, monitor)
        last = getattr(self, "last", alpha)
        if alpha > self.boldest * last:
            report = dataclasses.replace(level.report, converged=False, reason="too far")
            return dataclasses.replace(level, report=report)
        self.last = alpha
        return level


def test_a_step_that_fails_is_halved(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="perfplast_fenicsx.solvers.load_stepping"):
        levels = converged(list(islice(work_path(Timid(punch_problem(4), TIGHT)), 4)))
    assert "too far" in caplog.text
    assert "half the step" in caplog.text
    alphas, _ = points(levels)
    assert alphas[1] == pytest.approx(2 * alphas[0], rel=1e-9)
    assert (alphas[1:] <= 2.1 * alphas[:-1]).all()


def test_loading_ends_where_no_step_is_short_enough(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Timid, "boldest", 1.0)
    with caplog.at_level(logging.INFO, logger="perfplast_fenicsx.solvers.load_stepping"):
        problem = punch_problem(4)
        limit = limit_load(problem, 1e-3, Timid(problem))
    assert caplog.text.count("half the step") == MOST_HALVINGS
    assert not limit.levelled_off
    assert limit.estimate is limit.upper is None
    assert "too far" in limit.reason
    assert limit.lower == pytest.approx(limit.levels[0].state.zeta)


def test_extrapolation_is_linear_in_the_work() -> None:
    problem, first, levels = curve()
    one, two = levels[0].state, levels[2].state
    between = extrapolate(problem, one, two, 2 * two.alpha)
    assert between is not None
    work = float(problem.loads.live.dot(between.u.x.petsc_vec))
    assert work == pytest.approx(between.alpha, rel=1e-9)
    assert extrapolate(problem, None, None, 1.0) is None
    assert first.alpha > 0


def test_no_work_is_no_displacement() -> None:
    for method in (WorkNewton, BorderedNewton):
        level = method(punch_problem(2)).solve(0.0)
        assert level.report.converged
        assert level.state.zeta == level.state.alpha == 0


# Limit loads


@pytest.mark.parametrize("n", [1, 2])
def test_limit_load_of_a_plate(n: int) -> None:
    limit = limit_load(l_plate_problem(n), 1e-4)
    assert limit.levelled_off
    assert PLATE_LIMIT * (1 - 1e-4) < limit.lower < PLATE_LIMIT
    assert limit.estimate == pytest.approx(PLATE_LIMIT, rel=1e-4)
    assert limit.upper is not None
    assert limit.upper >= PLATE_LIMIT * (1 - 1e-9)
    assert limit.linear_solves < 250


@SERIAL
def test_limit_load_of_a_fine_plate_in_few_solves() -> None:
    limit = limit_load(l_plate_problem(4), 5e-3)
    assert limit.levelled_off
    assert limit.lower == pytest.approx(PLATE_LIMIT, rel=1e-3)
    assert limit.estimate == pytest.approx(PLATE_LIMIT, rel=1e-3)
    assert limit.lower < PLATE_LIMIT
    assert limit.linear_solves <= 150


@pytest.mark.mpi3
def test_limit_load_of_a_punch() -> None:
    limit = limit_load(punch_problem(8), 1e-4)
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
    limit = limit_load(stack_problem(3), 1e-6)
    assert limit.lower == pytest.approx(300.0, rel=1e-10)
    assert limit.upper == pytest.approx(300.0, rel=1e-10)


def test_collapse_mechanism_does_unit_work_and_keeps_volume() -> None:
    problem = punch_problem(4)
    v = limit_load(problem, 1e-6).mechanism
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
    limit = limit_load(problem, 1e-3)
    assert not limit.levelled_off
    assert limit.estimate is limit.upper is None
    assert "does not level off" in limit.reason
    assert limit.lower > 1e4


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_a_load_above_the_limit_is_refused_with_evidence(
    method: type[Newton | AugmentedLagrangian],
) -> None:
    level = method(punch_problem(4)).solve(1.01 * PUNCH_LIMIT)
    assert not level.report.converged
    assert "above the limit load" in level.report.reason
    assert level.report.newton_iterations <= 100
    assert level.iterations[-1].energy < level.iterations[0].energy
    assert level.iterations[-1].alpha > level.iterations[0].alpha


def test_extrapolation_of_a_power_law_is_exact() -> None:
    for p in (0.2, 0.5, 1.0, 2.0, 5.0):
        found = [(a, 7.0 - 3.0 * a**-p) for a in (1.5, 4.0, 9.0)]
        assert extrapolated_limit(found) == pytest.approx(7.0, rel=1e-9)
    assert extrapolated_limit([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 1.5), (4.0, 2.2)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 1.5)]) is None
    assert extrapolated_limit([(1.0, 1.0), (2.0, 3.0), (4.0, 3.0)]) == 3.0


# ALG2

FIXED = (0.1, 1.0, 10.0)


@SERIAL
@pytest.mark.parametrize("acceleration", ["none", "anderson"])
@pytest.mark.parametrize("name", ["punch", "plate"])
def test_adaptive_penalty_is_nearly_the_best(name: str, acceleration: str) -> None:
    """Never more than twice the iterations of the best fixed r."""
    problem, limit = {
        "punch": lambda: (punch_problem(4), PUNCH_LIMIT),
        "plate": lambda: (l_plate_problem(1), PLATE_LIMIT),
    }[name]()
    most = 1500

    def iterations(penalty: float | str, zeta: float, most: int) -> int:
        options = AugmentedLagrangianOptions(
            penalty=penalty,  # type: ignore[arg-type]
            acceleration=acceleration,  # type: ignore[arg-type]
            tolerance=1e-6,
            max_iterations=most,
        )
        level = AugmentedLagrangian(problem, options).solve(zeta)
        return level.report.newton_iterations if level.report.converged else most + 1

    for share in (0.3, 0.6, 0.9, 0.98):
        adaptive = iterations("adaptive", share * limit, most)
        assert adaptive <= most
        # a fixed r that needs as many needs no longer be followed
        best = min(iterations(r, share * limit, adaptive) for r in FIXED)
        assert adaptive <= 2 * best, (share, adaptive, best)


def test_relaxation_leads_to_the_same_state() -> None:
    problem = two_blocks_problem(2)
    known = Newton(problem, TIGHT).solve(200.0)
    for relaxation in (0.7, 1.6):
        options = AugmentedLagrangianOptions(relaxation=relaxation, tolerance=1e-8)
        [level] = converged([AugmentedLagrangian(problem, options).solve(200.0)])
        assert stress_distance(problem, known.state, level.state) < 1e-6
        last = level.iterations[-1]
        assert max(last.extra["primal"], last.extra["dual"]) == last.increment < 1e-8
        assert last.extra["penalty"] > 0


# Units


def test_contact_does_not_depend_on_the_size_of_the_displacements() -> None:
    """An elastic state is proportional to the load, however small that is."""
    solver = Newton(two_blocks_problem(6), TIGHT)
    large, small = converged([solver.solve(zeta) for zeta in (20.0, 1e-4)])
    assert large.report.plastic_cells == 0
    assert small.state.alpha / 1e-4 == pytest.approx(large.state.alpha / 20.0, rel=1e-10)
    assert small.report.active_contacts == large.report.active_contacts


# What is refused


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"penalty": 0}, "penalty = 0"),
        ({"penalty": -1.0}, "penalty = -1.0"),
        ({"penalty": math.inf}, "penalty = inf"),
        ({"penalty": math.nan}, "penalty = nan"),
        ({"penalty": "auto"}, "'auto'"),
        ({"relaxation": 0.0}, "relaxation = 0.0"),
        ({"relaxation": 2.0}, "relaxation = 2.0"),
        ({"acceleration": "nesterov"}, "none, anderson"),
        ({"tolerance": 0.0}, "tolerance = 0.0"),
        ({"tolerance": 1.0}, "tolerance = 1.0"),
        ({"max_iterations": 0}, "max_iterations = 0"),
    ],
)
def test_options_out_of_range_are_refused(values: dict[str, object], words: str) -> None:
    with pytest.raises(InputError) as refusal:
        AugmentedLagrangianOptions(**values)  # type: ignore[arg-type]
    sentence = str(refusal.value)
    assert words in sentence
    assert "\n" not in sentence
    assert sentence.endswith(".")


@pytest.mark.parametrize(
    ("alpha", "words"),
    [(-1.0, "negative; give zero or more"), (math.nan, "not finite"), (math.inf, "not finite")],
)
@pytest.mark.parametrize("method", [WorkNewton, BorderedNewton])
def test_impossible_work_is_refused(method: type[WorkNewton], alpha: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        method(punch_problem(2)).solve(alpha)


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_a_load_that_is_no_number_is_refused(method: type[Newton]) -> None:
    with pytest.raises(InputError, match="zeta = nan is not finite"):
        method(punch_problem(2)).solve(math.nan)


@pytest.mark.parametrize("rtol", [0.0, -1e-3, 1.0, math.nan])
def test_a_limit_tolerance_out_of_range_is_refused(rtol: float) -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        limit_load(punch_problem(2), rtol)
