"""Test friction with prescribed motions, and step by step in stages."""

from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    Contact,
    Elastic,
    Flow,
    Level,
    LoadingHistory,
    Newton,
    NewtonOptions,
    Plane,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Tie,
    Traction,
    VonMises,
    stage_path,
)
from tests.checks import assert_solved, largest
from tests.contact.blocks_apart import blocks_apart

STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=300.0)
HARD = Elastic(young=2e5, poisson=0.0)
SHARP = NewtonOptions(tolerance=1e-12)


def pushed(gdim: int, material: Any = STEEL, degree: int = 1, **friction: float) -> Problem:
    """Return a block on another block; loads press it down and push it from the left."""
    down, aside = [0.0] * gdim, [0.0] * gdim
    down[-1], aside[0] = -1.0, 1.0
    counts = ((6, 2), (5, 2)) if gdim == 2 else ((3, 3, 1), (2, 2, 1))
    return Problem(
        blocks_apart(MPI.COMM_WORLD, *counts),
        {"lower": material, "upper": material},
        [Support("bottom")],
        [Traction("top", down, name="press"), Traction("upper_x0", aside, name="push")],
        [Contact("lower_top", "upper_bottom", **friction)],
        degree=degree,
    )


def solved(problem: Problem, *stages: Stage) -> list[Level]:
    levels = list(stage_path(Newton(problem, SHARP), LoadingHistory(problem, stages)))
    for level in levels:
        assert_solved(level)
        assert abs(level.report.duality_gap) < 1e-10
        assert level.report.friction_excess < 1e-9
    return levels


def moved(before: Level, after: Level) -> Any:
    """Return the change of the displacement on this rank."""
    return after.state.u.x.array - before.state.u.x.array


@pytest.mark.long(but=["2-1"])
@pytest.mark.parametrize(("gdim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_elastic_bodies_unload_as_masing_says(comm: MPI.Intracomm, gdim: int, degree: int) -> None:
    """With Tresca friction, −ΔF after loading changes displacements by −2 times those of ΔF/2."""
    problem = pushed(gdim, HARD, degree, tresca=10.0)
    pressed, part, full, back, reversed_ = solved(
        problem,
        Stage({"press": 100.0, "push": 0.0}),
        Stage({"push": 7.2}),
        Stage({"push": 9.6}),
        Stage({"push": 9.6 - 2 * 7.2}),
        Stage({"push": -9.6}),
    )
    assert 0 < part.report.slipping <= full.report.slipping < problem.friction.count
    scale = largest(comm, moved(pressed, full))
    off = 1e-9 if gdim == 2 else 2e-3  # in 3D slip does not reverse exactly everywhere
    assert largest(comm, moved(full, back) + 2 * moved(pressed, part)) < off * scale
    assert largest(comm, moved(full, reversed_) + 2 * moved(pressed, full)) < off * scale
    assert largest(comm, moved(pressed, back)) > 1e-2 * scale


@pytest.mark.long(but=["friction0"])
@pytest.mark.parametrize("friction", [{"tresca": 20.0}, {"coulomb": 0.2}])
def test_many_small_steps_remember_slip(comm: MPI.Intracomm, friction: dict[str, float]) -> None:
    """Under a constant push no slip reverses, and the last stage changes nothing."""
    problem = pushed(2, Flow(STEEL), **friction)
    levels = solved(
        problem, Stage({"press": 100.0, "push": 0.0}), Stage({"push": 16.0}, 3), Stage({}, 2)
    )
    pushed_, rested = levels[3], levels[-1]
    assert 0 < pushed_.report.slipping
    if "tresca" in friction:
        assert rested.report.slipping == 0
    scale = largest(comm, pushed_.state.u.x.array)
    assert largest(comm, moved(pushed_, rested)) < 1e-9 * scale


def test_a_coulomb_block_is_pressed_then_pushed() -> None:
    """The block sticks below μ times the pressure, and slides above it."""
    problem = pushed(2, HARD, coulomb=0.3)
    press = Stage({"press": 100.0, "push": 0.0})
    last = solved(problem, press, Stage({"push": 27.0}))[-1]
    assert last.report.rounds > 1
    away = list(
        stage_path(Newton(problem), LoadingHistory(problem, [press, Stage({"push": 33.0})]))
    )
    assert not away[-1].report.converged


def dragged(mesh: TaggedMesh, by: str, distance: float, tresca: float) -> Problem:
    """Return two tied blocks, pressed on a rough floor; either is moved along the other."""
    move = (distance, 0.0) if by == "floor" else ()
    value = -distance if by == "support" else 0.0
    return Problem(
        mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("top", "x", value=value, constant=False)],
        [Traction("top", (0.0, -50.0), constant=True)],
        obstacles=[Plane("bottom", (0.0, 0.0), (0.0, 1.0), move=move, tresca=tresca, name="floor")],
        contacts=[Tie("lower_top", "upper_bottom")],
    )


@pytest.mark.long(but=["0.05-False"])
@pytest.mark.parametrize(("zeta", "slides"), [(0.05, False), (1.0, True)])
def test_floor_and_support_drag_alike(comm: MPI.Intracomm, zeta: float, slides: bool) -> None:
    """For either motion the stress is the same, and finally the floor exerts τ̄A."""
    found = {}
    mesh = blocks_apart(comm, (3, 3), (3, 3))  # one, as parts may differ
    for by in ("floor", "support"):
        problem = dragged(mesh, by, 1e-3, 5.0)
        level = Newton(problem, SHARP).solve(zeta)
        assert_solved(level)
        report = level.report
        assert abs(report.duality_gap) < 1e-11
        assert report.balance < 1e-10
        assert (report.slipping == problem.friction.count) == slides
        found[by] = (report.reactions["obstacle floor"][0], level.stress.x.array.copy())
    assert found["floor"][0] == pytest.approx(found["support"][0], rel=1e-9)
    if slides:
        assert found["floor"][0] == pytest.approx(5.0)
    else:
        assert 0 < found["floor"][0] < 5.0
    assert largest(comm, found["floor"][1] - found["support"][1]) < 1e-8
