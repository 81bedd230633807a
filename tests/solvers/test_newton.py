"""Test ALG1 against exact solutions, numbers of other programs, and its own variants."""

import math

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from perfplast_fenicsx import (
    Iteration,
    Level,
    Newton,
    NewtonOptions,
    Problem,
    WorkNewton,
    load_path,
)
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from tests.models import (
    PUNCH_LIMIT,
    STACK_HEIGHTS,
    STACK_YOUNG,
    l_plate_problem,
    punch_problem,
    stack_problem,
    two_blocks_problem,
)
from tests.solvers.levels import PLATE_LIMIT


def solve(problem: Problem, *values: float, **options: object) -> list[Level]:
    levels = list(load_path(Newton(problem, NewtonOptions(**options)), values))
    assert len(levels) == len(values)
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-6
        assert level.report.max_penetration < 1e-12
    return levels


def largest_component(problem: Problem, level: Level, body: str) -> float:
    nodes = np.unique(problem.V.dofmap.list[problem.tagged_mesh.cells(body)])
    values = level.state.u.x.array.reshape(-1, 3)[nodes]
    return problem.comm.allreduce(float(np.abs(values).max(initial=0)), MPI.MAX)


@pytest.mark.long(but=["1-83.228979667-167", "2-111.49381284-1810"])
@pytest.mark.parametrize(
    ("n", "alpha", "plastic_cells"),
    [(1, 83.228979667, 167), (2, 111.49381284, 1810), (4, 144.04255883, 16578)],
)
def test_plate_as_other_programs_have_it(n: int, alpha: float, plastic_cells: int) -> None:
    [level] = solve(l_plate_problem(n), 1.0)
    assert level.state.alpha == pytest.approx(alpha, rel=1e-8)
    assert level.report.plastic_cells == plastic_cells
    assert level.report.newton_iterations <= 12


@pytest.mark.long(but=["8-0.00057498083896-25-0.00134236"])
@pytest.mark.parametrize(
    ("n", "sinking", "pairs", "largest"),
    [(8, 5.7498083896e-4, 25, 1.34236e-3), (16, 5.8728525143e-4, 81, 1.38758e-3)],
)
def test_punch_as_other_programs_have_it(
    n: int, sinking: float, pairs: int, largest: float
) -> None:
    problem = punch_problem(n)
    [level] = solve(problem, 450.0)
    assert level.state.alpha == pytest.approx(sinking, rel=1e-9)
    assert level.report.contact_pairs == level.report.active_contacts == pairs
    assert largest_component(problem, level, "base") == pytest.approx(largest, rel=1e-5)


def test_punch_converges_below_its_limit_and_refuses_above() -> None:
    solver = Newton(punch_problem(8))
    good, bad = load_path(solver, [0.99979 * PUNCH_LIMIT, 490.5, 495.0])
    assert good.state.zeta == pytest.approx(489.8, abs=0.01)
    assert good.report.converged
    assert not bad.report.converged
    assert "above the limit load" in bad.report.reason
    assert bad.iterations[-1].energy < bad.iterations[0].energy
    assert bad.iterations[-1].alpha > 10 * good.state.alpha


@pytest.mark.mpi2("exact")
@pytest.mark.parametrize("active_set", ["exact", "once"])
def test_block_held_by_contact_alone(active_set: str) -> None:
    """Uniform uniaxial stress is exact for P1; contact patch test and semicoercive problem."""
    problem = stack_problem(3)
    compliance = sum(h / e for h, e in zip(STACK_HEIGHTS, STACK_YOUNG, strict=True))
    for level in solve(problem, 100.0, 290.0, active_set=active_set):
        assert level.state.alpha == pytest.approx(level.state.zeta * compliance, rel=1e-10)
        assert level.report.plastic_cells == 0
        assert level.report.active_contacts == level.report.contact_pairs == 16
        stress = OutputFields(problem).update(level)["stress"].x.array.reshape(-1, 9)
        uniform = np.diag([0.0, 0.0, -level.state.zeta]).ravel()
        assert np.abs(stress - uniform).max() < 1e-8 * level.state.zeta
    [bad] = load_path(Newton(problem), [305.0])
    assert "above the limit load" in bad.report.reason


def test_contact_pressure_is_the_applied_one() -> None:
    problem = stack_problem(2)
    [level] = solve(problem, 120.0)
    pressure = OutputFields(problem).update(level)["contact_pressure"]
    ds = ufl.Measure("ds", problem.tagged_mesh.mesh, subdomain_data=problem.tagged_mesh.facet_tags)
    for surface in ("lower_top", "upper_bottom"):
        form = fem.form(pressure * ds(problem.tagged_mesh.surfaces[surface]))
        force = problem.comm.allreduce(fem.assemble_scalar(form))
        assert force == pytest.approx(120.0, rel=1e-9)


@pytest.mark.parametrize("active_set", ["exact", "once"])
def test_gap_closes_before_the_lower_block_is_loaded(active_set: str) -> None:
    """The upper cantilever bends freely until it touches the lower one."""
    free = Newton(two_blocks_problem(2, gap=1.0)).solve(5.0)
    assert free.report.active_contacts == 0
    touching = solve(two_blocks_problem(2, gap=1e-3), 5.0, 30.0, active_set=active_set)
    assert 0 < touching[-1].report.active_contacts < touching[-1].report.contact_pairs
    assert touching[-1].report.smallest_contact_force > -1e-9
    assert abs(touching[-1].report.complementarity) < 1e-8
    stiffer = solve(two_blocks_problem(2), 5.0)
    assert stiffer[0].state.alpha < free.state.alpha


def test_exact_and_single_active_set_updates_agree() -> None:
    exact, once = (
        solve(two_blocks_problem(4), 40.0, 80.0, active_set=choice) for choice in ("exact", "once")
    )
    for a, b in zip(exact, once, strict=True):
        assert a.state.alpha == pytest.approx(b.state.alpha, rel=1e-8)
        assert a.report.active_contacts == b.report.active_contacts
    assert sum(b.report.active_set_iterations for b in once) < sum(
        a.report.active_set_iterations for a in exact
    )


def test_naming_the_surfaces_the_other_way_round_changes_nothing() -> None:
    straight, swapped = (solve(punch_problem(4, swapped=s), 470.0)[0] for s in (False, True))
    assert straight.state.alpha == pytest.approx(swapped.state.alpha, rel=1e-10)


@pytest.mark.parametrize("stopping", ["displacement", "stress", "energy"])
def test_stopping_criteria_lead_to_the_same_state(stopping: str) -> None:
    [level] = solve(punch_problem(4), 480.0, stopping=stopping, tolerance=1e-12)
    [reference] = solve(punch_problem(4), 480.0)
    assert level.state.alpha == pytest.approx(reference.state.alpha, rel=1e-9)
    assert stopping in level.report.reason


def test_last_steps_converge_quadratically() -> None:
    """Σ is strongly semismooth: with ρ = 0 the last increment is about the previous one squared."""
    [level] = solve(l_plate_problem(2), 1.0, regularisation=0.0, tolerance=1e-12)
    last = np.log([step.increment for step in level.iterations])[-4:]
    orders = np.diff(last)[1:] / np.diff(last)[:-1]
    assert orders.max() > 1.6
    [regular] = solve(l_plate_problem(2), 1.0, regularisation=1e-2)
    assert regular.report.newton_iterations > level.report.newton_iterations
    assert regular.state.alpha == pytest.approx(level.state.alpha, rel=1e-7)


def test_energy_falls_in_every_damped_step() -> None:
    """From near the limit load to nearly its opposite, full steps would go too far."""
    history: list[Iteration] = []
    solver = Newton(l_plate_problem(1), NewtonOptions(regularisation=0.0))
    loaded = solver.solve(0.99 * PLATE_LIMIT)
    level = solver.solve(-0.9 * PLATE_LIMIT, loaded.state, history.append)
    assert level.report.converged
    assert level.report.damping_min < 0.5
    assert history == level.iterations
    energies = np.array([step.energy for step in history])
    assert (np.diff(energies) <= 1e-12 * abs(energies[-1])).all()


def test_nearly_incompressible_bodies() -> None:
    [level] = solve(stack_problem(2, poisson=0.499), 200.0)
    compliance = sum(h / e for h, e in zip(STACK_HEIGHTS, STACK_YOUNG, strict=True))
    assert level.state.alpha == pytest.approx(200.0 * compliance, rel=1e-9)


def test_no_load_gives_no_displacement() -> None:
    [level] = solve(punch_problem(2), 0.0)
    assert level.state.alpha == pytest.approx(0, abs=1e-18)
    assert math.isfinite(level.report.duality_gap)


def test_a_body_pulled_off_is_a_result_with_a_reason() -> None:
    problem = stack_problem(2)
    level = Newton(problem).solve(-10.0)
    assert not level.report.converged
    assert level.report.reason


@pytest.mark.mpi2("0-Newton")
@pytest.mark.parametrize("solver", [Newton, WorkNewton])
@pytest.mark.parametrize("good", [0, 1, 2, 3])
def test_a_linear_system_without_solution_is_a_result(
    monkeypatch: pytest.MonkeyPatch, solver: type[Newton | WorkNewton], good: int
) -> None:
    """An unsolvable system may occur anywhere, also inside SNES-VI."""
    method = solver(two_blocks_problem(2), NewtonOptions(active_set="exact"))
    solve_well, count = LinearSolver.solve, 0

    def solve(self: LinearSolver, *system: object, correction: bool) -> None:
        nonlocal count
        count += 1
        if count > good:
            raise LinearFailure("the linear system could not be solved")
        solve_well(self, *system, correction=correction)

    monkeypatch.setattr(LinearSolver, "solve", solve)
    level = method.solve(200.0 if solver is Newton else 1.0)
    assert not level.report.converged
    assert level.report.reason == "the linear system could not be solved"
    assert count == good + 1
    monkeypatch.undo()
    assert Newton(method.problem).solve(80.0).report.converged
