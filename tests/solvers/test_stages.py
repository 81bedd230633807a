"""Stages: cycles by hand, heating, what is left of load and stress, both hardenings, refusals."""

from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Flow,
    Hardening,
    Level,
    LoadingHistory,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Tie,
    VonMises,
    stacked_blocks,
    stage_path,
)

YOUNG, YIELD, HARD, EXPANSION = 2e5, 300.0, 1e4, 1.2e-5
STEEL = VonMises(YOUNG, 0.3, YIELD, EXPANSION)
ISOTROPIC = Hardening(YOUNG, 0.3, YIELD, isotropic=HARD)
KINEMATIC = Hardening(YOUNG, 0.3, YIELD, kinematic=HARD)
ROLLERS = (Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"))
SHARP = NewtonOptions(tolerance=1e-12)


@cache
def blocks() -> TaggedMesh:
    return stacked_blocks(MPI.COMM_WORLD, 1)


def bar(body: VonMises | Hardening, degree: int = 1, **more: object) -> Problem:
    """Two blocks glued on each other, together 2 high, pushed at the top."""
    arguments: dict[str, object] = {
        "supports": ROLLERS,
        "loads": [Pressure("top", 1.0, name="push")],
        "ties": [Tie("lower_top", "upper_bottom")],
        "degree": degree,
    }
    materials = {"lower": Flow(body), "upper": Flow(body)}
    return Problem(blocks(), materials, **(arguments | more))  # type: ignore[arg-type]


def solved(problem: Problem, stages: list[Stage]) -> list[Level]:
    levels = list(stage_path(Newton(problem, SHARP), LoadingHistory(problem, stages)))
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-11
        assert level.report.equilibrium < 1e-9
        assert level.report.balance < 1e-9
    return levels


def by_hand(body: Hardening, stresses: list[float]) -> list[float]:
    """Strain of a bar at given stresses, one after the other."""
    plastic = accumulated = 0.0
    found = []
    for stress in stresses:
        back = body.kinematic * plastic
        room = body.yield_stress + body.isotropic * accumulated
        beyond = abs(stress - back) - room
        if beyond > 0:
            flow = beyond / (body.isotropic + body.kinematic)
            plastic += flow * np.sign(stress - back)
            accumulated += flow
        found.append(stress / body.young + plastic)
    return found


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("body", [ISOTROPIC, KINEMATIC, Hardening(YOUNG, 0.3, YIELD, 3e3, 7e3)])
def test_cycles_by_hand(body: Hardening, degree: int) -> None:
    """Pushed and pulled to twice the strain at first yield and back, and to zero."""
    tops = [-400.0, 450.0, -500.0, 520.0, 0.0]
    stages = [Stage({"push": -top}, steps=2) for top in tops]
    levels = solved(bar(body, degree), stages)
    stresses = []
    before = 0.0
    for top in tops:
        stresses += [(before + top) / 2, top]
        before = top
    for level, strain in zip(levels, by_hand(body, stresses), strict=True):
        r = level.report
        print(
            r.zeta,
            r.works,
            -2 * strain,
            r.duality_gap,
            r.equilibrium,
            r.balance,
            r.newton_iterations,
        )
