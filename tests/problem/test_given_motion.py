"""Test supports and obstacles that ζ moves: known forces, the same force as a load, refusals."""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BodyForce,
    InputError,
    Level,
    Newton,
    Plane,
    Pressure,
    Problem,
    Support,
    VonMises,
    WorkNewton,
    load_path,
)
from tests.models import PUNCH_LIMIT, PUNCH_SUPPORTS, STACK_HEIGHTS, punch_problem
from tests.problem.test_prescribed_displacement import HEIGHT, ROLLERS, YIELD, YOUNG, blocks
from tests.solvers.levels import TIGHT

DOWN = (0.0, 0.0, -1.0)


def plane(height: float = HEIGHT, move: Sequence[float] = DOWN) -> Plane:
    """A plane above the blocks."""
    return Plane("top", (0.0, 0.0, height), (0.0, 0.0, -1.0), move)


def moved(*supports: Support, gap: float = 0.0, degree: int = 1, weight: float = 0.0) -> Problem:
    """Return two glued blocks on rollers, under a plane or a support that moves down."""
    material = VonMises(YOUNG, 0.3, YIELD)
    return Problem(
        blocks(),
        {"lower": material, "upper": material},
        [*ROLLERS, Support("upper_bottom"), *supports],
        [BodyForce("upper", (0.0, 0.0, -weight), constant=True)] if weight else [],
        obstacles=[] if supports else [plane(HEIGHT + gap)],
        degree=degree,
    )


UPPER = STACK_HEIGHTS[1]


def check(levels: Sequence[Level]) -> None:
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-9
        assert level.report.equilibrium < 1e-9
        assert level.report.balance < 1e-10


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("by", ["plane", "support"])
def test_a_block_with_free_sides(by: str, degree: int) -> None:
    """R/A = min(E ζ/H, σ_y) under a plane or a support; the gap closes without force."""
    gap = 0.0 if by == "support" else 1e-3
    supports = [Support("top", "z", value=-1.0, constant=False)] if by == "support" else []
    material = VonMises(YOUNG, 0.3, YIELD)
    problem = Problem(
        blocks(),
        {"lower": material, "upper": material},
        [*ROLLERS, Support("upper_bottom", "z"), *supports],
        obstacles=[plane(HEIGHT + gap)] if by == "plane" else [],
        degree=degree,
    )
    strokes = (5e-4, 1e-3, 2e-3, 2.5e-3, 6e-3)
    levels = list(load_path(Newton(problem, TIGHT), strokes))
    check(levels)
    for stroke, level in zip(strokes, levels, strict=True):
        expected = min(YOUNG * max(stroke - gap, 0.0) / UPPER, YIELD)
        report = level.report
        assert report.driving_force == pytest.approx(expected, rel=1e-9, abs=1e-9)
        mover = report.reactions[f"{'obstacle' if by == 'plane' else 'support'} top"]
        assert mover == pytest.approx((0, 0, -expected), rel=1e-9, abs=1e-9)
        assert report.reactions["support upper_bottom"][2] == pytest.approx(-mover[2], abs=1e-9)
        assert report.zeta == stroke  # the prescribed value, not a computed one


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_a_punch_by_its_stroke_and_by_its_load(method: type) -> None:
    """A pressure moves the top; the smooth top needs this force for the same displacement."""
    by_load = punch_problem(2)
    loaded = Newton(by_load, TIGHT).solve(0.8 * PUNCH_LIMIT)
    force = 0.8 * PUNCH_LIMIT / 4
    material = VonMises(young=2e5, poisson=0.3, yield_stress=PUNCH_LIMIT)
    by_stroke = Problem(
        by_load.tagged_mesh,
        {"base": material, "punch": material},
        PUNCH_SUPPORTS,
        contacts=by_load.given.contacts,
        obstacles=[Plane("top", (0, 0, 1.5), DOWN, move=DOWN)],
    )
    solver = method(by_stroke)
    stroke = loaded.state.alpha * 4  # the mean displacement of the top
    near = [solver.solve(factor * stroke) for factor in (0.9, 1.0, 1.1)]
    forces = [level.report.driving_force for level in near]
    assert all(level.report.converged for level in near)
    assert forces[0] < forces[1] < forces[2]
    # Of all loads with this mean displacement, the rigid one has the largest energy, because it is
    # an additional constraint; for elastic punches the difference is small.
    assert forces[1] == pytest.approx(force, rel=0.02)
    assert near[1].report.active_contacts == by_stroke.num_pairs


@pytest.mark.mpi2
def test_energy_and_force() -> None:
    """E'(ζ) is the driving force, also with constant loads and constant motions of supports."""
    problem = moved(degree=2, weight=50.0)
    solver = Newton(problem, TIGHT)
    strokes = np.array([1.5e-3, 1.51e-3, 1.52e-3])
    levels = [solver.solve(stroke) for stroke in strokes]
    check(levels)
    energies = [level.iterations[-1].energy for level in levels]
    slope = (energies[2] - energies[0]) / (strokes[2] - strokes[0])
    assert slope == pytest.approx(levels[1].report.driving_force, rel=1e-4)
    assert 0 < levels[1].report.plastic_fraction < 1


def test_a_weight_stays(comm: MPI.Intracomm) -> None:
    """ζ = 0 is the first level, which shows an excessive weight."""
    levels = list(load_path(Newton(moved(weight=50.0)), (1e-4, 1e-3)))
    assert [level.state.zeta for level in levels] == pytest.approx([0.0, 1e-4, 1e-3])
    weight = 50.0 * UPPER
    loads = levels[-1].report.reactions["loads"]
    assert loads == pytest.approx([0.0, 0.0, -weight], abs=1e-10)
    columns = Problem(
        blocks(),
        {"lower": VonMises(YOUNG, 0.3, YIELD), "upper": VonMises(YOUNG, 0.3, 1e-2)},
        [*ROLLERS, Support("upper_bottom", "z")],
        [Pressure("top", 1.0, constant=True)],
        obstacles=[Plane("top", (0, 0, HEIGHT + 1), DOWN, move=DOWN)],
    )
    (level,) = load_path(Newton(columns), (1e-3,))
    assert "the constant loads alone" in level.report.reason


def test_what_does_not_go_with_motions() -> None:
    with pytest.raises(InputError, match="all loads are constant"):
        WorkNewton(moved())
    with pytest.raises(InputError, match=r"move = \[0.0, 1.0\] of the plane at 'top'"):
        Problem(
            blocks(),
            {"lower": VonMises(YOUNG, 0.3, YIELD), "upper": VonMises(YOUNG, 0.3, YIELD)},
            [*ROLLERS, Support("upper_bottom")],
            obstacles=[plane(move=(0.0, 1.0))],
        )
    with pytest.raises(InputError, match="contact surface 'top', and these nodes"):
        Problem(
            blocks(),
            {"lower": VonMises(YOUNG, 0.3, YIELD), "upper": VonMises(YOUNG, 0.3, YIELD)},
            [*ROLLERS, Support("upper_bottom"), Support("top")],
            obstacles=[plane()],
        )
    with pytest.raises(InputError, match=r"by 0\.5 times ζ along z"):
        moved(Support("top", "z", -1.0, constant=False), Support("top", "z", 0.5, constant=False))
