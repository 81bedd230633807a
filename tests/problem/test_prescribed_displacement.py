"""Test moving supports: known stresses, reactions in the duality gap, gaps that close."""

from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    BorderedNewton,
    Contact,
    InputError,
    Level,
    Newton,
    Plane,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    WorkNewton,
    limit_load,
    stacked_blocks,
)
from perfplast_fenicsx.problem import Prescribed, certify
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from tests.models import STACK_HEIGHTS
from tests.solvers.levels import TIGHT

YOUNG, YIELD = 2e5, 300.0
HEIGHT = sum(STACK_HEIGHTS)
ROLLERS = (Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"))
METHODS = [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton]


@cache
def blocks() -> TaggedMesh:
    return stacked_blocks(MPI.COMM_WORLD, 2, heights=STACK_HEIGHTS)


def stack(*supports: Support, gap: float = 0.0, degree: int = 1) -> Problem:
    """Return two stacked blocks on rollers; ζ pulls the upper block sideways."""
    material = VonMises(YOUNG, 0.3, YIELD)
    return Problem(
        blocks(),
        {"lower": material, "upper": material},
        [*ROLLERS, *supports],
        [BodyForce("upper", (1.0, 0.0, 0.0))],
        [Contact("lower_top", "upper_bottom", gap)],
        degree=degree,
    )


def stresses(problem: Problem, level: Level, body: str) -> np.ndarray:
    """Return Mandel vectors at the points of a body on this rank."""
    points = problem.S.dofmap.list[problem.tagged_mesh.cells(body)].ravel()
    return level.stress.x.array.reshape(-1, problem.S.dofmap.index_map_bs)[points]


def solve(problem: Problem, method: type, zeta: float) -> Level:
    """Return the level for a load factor, or for the work that ALG1 finds there."""
    value = zeta
    if method.prescribes is Prescribed.WORK:  # type: ignore[attr-defined]
        value = Newton(problem, TIGHT).solve(zeta).state.alpha
    options = (
        AugmentedLagrangianOptions(tolerance=1e-10) if method is AugmentedLagrangian else TIGHT
    )
    level: Level = method(problem, options).solve(value)
    assert level.report.converged, level.report.reason
    assert abs(level.report.duality_gap) < 1e-8
    assert level.report.equilibrium < 1e-6
    assert level.state.zeta == pytest.approx(zeta, abs=1e-6)
    return level


@pytest.mark.mpi2("-0.001-Newton")
@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
@pytest.mark.parametrize("strain", [-1e-3, -1.4e-3, -4e-3])
def test_a_block_that_is_compressed(method: type, strain: float) -> None:
    """The uniaxial stress is E ε, and at most the yield stress."""
    problem = stack(Support("top", "z", value=strain * HEIGHT))
    level = solve(problem, method, 0.0)
    uniform = np.array([0.0, 0.0, max(YOUNG * strain, -YIELD), 0.0, 0.0, 0.0])
    for body in ("lower", "upper"):
        assert np.abs(stresses(problem, level, body) - uniform).max(initial=0) < 1e-5 * YIELD
    top = problem.fixed[:, 2] & (problem.V.tabulate_dof_coordinates()[:, 2] > HEIGHT - 1e-9)
    u = level.state.u.x.array.reshape(-1, 3)
    assert u[top, 2] == pytest.approx(strain * HEIGHT, rel=1e-12)
    force = problem.comm.allreduce(level.contact_forces.sum())
    assert force == pytest.approx(-uniform[2], rel=1e-6)
    if strain * YOUNG > -YIELD:
        assert level.report.plastic_cells == 0
        wide = YOUNG * strain * -0.3 / YOUNG / 2 * STACK_HEIGHTS[1]
        assert level.state.alpha == pytest.approx(wide, rel=1e-8)


@pytest.mark.parametrize(("method", "degree"), [*zip(METHODS, (2, 1, 1, 2), strict=True)])
def test_supports_that_move_and_a_load_at_once(method: type, degree: int) -> None:
    """No exact solution is known; the duality gap shows that the level is a solution."""
    problem = stack(Support("top", "z", value=-4e-3), Support("top", "y"), degree=degree)
    level = solve(problem, method, 100.0)
    assert 0 < level.report.plastic_fraction < 1
    at_rest = Newton(problem, TIGHT).solve(0.0)
    again = Newton(problem, TIGHT).solve(100.0, at_rest.state)
    assert again.state.alpha == pytest.approx(level.state.alpha, rel=1e-6)


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
@pytest.mark.parametrize("gap", [0.0, 3e-4])
def test_a_contact_surface_that_moves_closes_the_gap(method: type, gap: float) -> None:
    """The guests of the contact move; the lower block gets the remaining displacement."""
    problem = stack(Support("upper_bottom", "z", value=-8e-4), gap=gap)
    level = solve(problem, method, 0.0)
    strain = -(8e-4 - gap) / STACK_HEIGHTS[0]
    uniform = np.array([0.0, 0.0, YOUNG * strain, 0.0, 0.0, 0.0])
    assert np.abs(stresses(problem, level, "lower") - uniform).max(initial=0) < 1e-6 * YIELD
    assert np.abs(stresses(problem, level, "upper")).max(initial=0) < 1e-6 * YIELD
    force = problem.comm.allreduce(level.contact_forces.sum())
    assert force == pytest.approx(-YOUNG * strain, rel=1e-8)
    assert level.report.max_penetration < 1e-12


def test_a_state_of_other_supports_is_no_solution() -> None:
    problem = stack(Support("top", "z", value=-1e-3))
    right = solve(problem, Newton, 0.0)
    wrong = stack(Support("top", "z", value=-1.2e-3))
    fields = QuadratureFields(wrong)
    fields.u.x.array[:] = right.state.u.x.array
    moved = wrong.fixed & (wrong.prescribed != 0)
    fields.u.x.array[moved.ravel()] = wrong.prescribed[moved]
    fields.update()
    assert abs(certify(wrong, fields, 0.0).duality_gap) > 1e-3


@pytest.mark.parametrize(
    ("supports", "words"),
    [
        ([Support("top", "z", value=np.nan)], "value = nan"),
        ([Support("top", "z", 1e-3), Support("top", "xz")], "another support moves them by 0.001"),
        ([Support("top", "z"), Support("top", "z", 1e-3)], "another support moves them by 0"),
        (
            [Support("lower_top", "z"), Support("upper_bottom", "z", -1e-3)],
            "contact cannot prevent an overlap",
        ),
    ],
)
def test_what_cannot_move_is_refused(supports: list[Support], words: str) -> None:
    with pytest.raises(InputError, match=words) as refusal:
        stack(*supports)
    assert len(set(MPI.COMM_WORLD.allgather(str(refusal.value)))) == 1


def test_nodes_at_an_obstacle_that_cannot_give_way_are_refused() -> None:
    def problem(value: float) -> Problem:
        return Problem(
            stacked_blocks(MPI.COMM_WORLD, 1, heights=STACK_HEIGHTS),
            {"lower": VonMises(YOUNG, 0.3, YIELD), "upper": VonMises(YOUNG, 0.3, YIELD)},
            [*ROLLERS, Support("top", "z", value=value)],
            [BodyForce("upper", (1.0, 0.0, 0.0))],
            [Contact("lower_top", "upper_bottom")],
            [Plane("top", point=(0.0, 0.0, HEIGHT + 1e-3), normal=(0.0, 0.0, -1.0))],
        )

    problem(0.0)
    with pytest.raises(InputError, match="nodes of the contact surface 'top'"):
        problem(2e-3)


def test_the_interior_point_method_ignores_motions_that_stay() -> None:
    """Constant motions do no work at collapse; growing motions are refused."""
    still, moved = (
        limit_load(stack(Support("top", "z", value=value)), method="interior-point")
        for value in (0.0, -1e-3)
    )
    assert moved.lower == pytest.approx(still.lower, rel=1e-6)
    assert moved.upper == pytest.approx(still.upper, rel=1e-6)
    growing = stack(Support("top", "z", value=-1e-3, constant=False))
    with pytest.raises(InputError, match="moves supports"):
        limit_load(growing, method="interior-point")
