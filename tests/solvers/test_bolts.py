"""Test tightened bolts: joint diagram, several bolts, limit loads, refusals."""

import math
from functools import cache
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    Bolt,
    BorderedNewton,
    Contact,
    Elastic,
    Newton,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Temperature,
    Tie,
    Traction,
    VonMises,
    WorkNewton,
    limit_load,
    load_path,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import ignored
from perfplast_fenicsx.materials.plastic_flow import Flow
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.solvers.stage_stepping import stage_path
from tests.checks import assert_refused
from tests.solvers.levels import SERIAL, TIGHT, converged

YOUNG, STIFFER, YIELD, LENGTH = 2e5, 6e5, 400.0, 3.0
PRELOAD, AREA = 100.0, 1.0
BOLT = Bolt("bolt", PRELOAD, (0.0, 0.0, 2.0), (0.5, 2.5))
SHARE = YOUNG / (YOUNG + STIFFER)
"""Φ: fraction of a load that the bolt carries while the joint is closed."""
APART = PRELOAD / (1 - SHARE)
"""The load at which the joint opens."""


@cache
def joint() -> TaggedMesh:
    """Return a bolt and a sleeve between the ground and a head; half of it, mirrored in x = 0."""
    return structured_mesh(
        MPI.COMM_WORLD,
        [
            Box("bolt", (0.0, 0.0, 0.0), (1.0, 1.0, 3.0), (2, 2, 4)),
            Box("sleeve", (2.0, 0.0, 0.0), (3.0, 1.0, 3.0), (2, 2, 3)),
            Box("head", (0.0, 0.0, 3.0), (3.0, 1.0, 4.0), (6, 2, 1)),
        ],
        [
            Surface("x0", ("bolt", "head"), lambda x: x[0] == 0),
            Surface("y0", ("bolt", "sleeve", "head"), lambda x: x[1] == 0),
            Surface("bottom", ("bolt", "sleeve"), lambda x: x[2] == 0),
            Surface("sleeve_side", ("sleeve",), lambda x: x[0] == 3),
            Surface("bolt_top", ("bolt",), lambda x: x[2] == 3),
            Surface("under_head", ("head",), lambda x: (x[2] == 3) & (x[0] <= 1)),
            Surface("sleeve_top", ("sleeve",), lambda x: x[2] == 3),
            Surface("seat", ("head",), lambda x: (x[2] == 3) & (x[0] >= 2)),
            Surface("top", ("head",), lambda x: x[2] == 4),
        ],
    )


def bolted(*initial: Any, **changes: Any) -> Problem:
    """Return the problem in which ζ is a tensile force at the head."""
    given: dict[str, Any] = {
        "materials": {
            "bolt": VonMises(YOUNG, 0.0, YIELD, 1e-5),
            "sleeve": Elastic(STIFFER, 0.0),
            "head": Elastic(1e5 * YOUNG, 0.0),
        },
        "supports": [
            *(Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")),
            Support("sleeve_side", "x"),
        ],
        "loads": [Traction("top", (0.0, 0.0, 1 / 3))],
        "contacts": [Contact("seat", "sleeve_top"), Tie("under_head", "bolt_top")],
    }
    return Problem(joint(), **(given | {"initial": initial or (BOLT,)} | changes))


def theory(load: float) -> float:
    """Return the force of the bolt from the joint diagram."""
    return PRELOAD + SHARE * load if load < APART else load


def test_force_follows_diagram_of_joint() -> None:
    """The force is preload + Φ load until the joint opens, and then the load."""
    loads = [0.5 * APART, 0.95 * APART, 1.05 * APART, 1.5 * APART]
    levels = converged(list(load_path(Newton(bolted(), TIGHT), loads)))
    assert [level.state.zeta for level in levels] == [0.0, *loads]
    for level in levels:
        found = level.report.bolts["bolt"]
        assert found == pytest.approx(theory(level.state.zeta), rel=1e-4)
        held = level.report.reactions["contact seat sleeve_top"][2]
        assert held == pytest.approx(max(found - level.state.zeta, 0), abs=1e-3 * PRELOAD)


@pytest.mark.mpi2("AugmentedLagrangian")
@SERIAL
@pytest.mark.parametrize("method", [AugmentedLagrangian, WorkNewton, BorderedNewton])
def test_algorithms_agree(method: Any) -> None:
    """All algorithms tighten bolts first, and find the same force."""
    problem = bolted()
    level = Newton(problem, TIGHT).solve(0.6 * APART)
    assert problem.shanks.shortening is not None
    loose = method is AugmentedLagrangian
    options = AugmentedLagrangianOptions(tolerance=1e-10) if loose else TIGHT
    value = 0.6 * APART if loose else level.state.alpha
    other = method(bolted(), options).solve(value)
    assert other.report.converged, other.report.reason
    assert other.report.bolts["bolt"] == pytest.approx(level.report.bolts["bolt"], rel=1e-5)


def test_shortening_is_that_of_springs_in_series() -> None:
    """Bolt and sleeve deform together: s = P (L/E_b + L/E_s)/A."""
    problem = bolted()
    Newton(problem, TIGHT).solve(0.0)
    assert problem.shanks.shortening is not None
    by_hand = PRELOAD * LENGTH * (1 / YOUNG + 1 / STIFFER) / AREA
    assert problem.shanks.shortening == pytest.approx(by_hand, rel=1e-4)


@SERIAL
def test_constant_loads_and_heat_after_tightening() -> None:
    """A constant tension does not act while the bolt is tightened; heat does."""
    pulled = bolted(loads=[Traction("top", (0.0, 0.0, APART / 6), constant=True)])
    assert Newton(pulled, TIGHT).solve(0.0).report.bolts["bolt"] == pytest.approx(
        theory(APART / 2), rel=1e-4
    )
    hot = bolted(BOLT, Temperature("bolt", 10.0))
    assert Newton(hot, TIGHT).solve(0.0).report.bolts["bolt"] == pytest.approx(PRELOAD, rel=1e-5)


def test_two_bolts_at_once() -> None:
    """The sleeve is a second bolt, balanced by other bodies: both have their preloads."""
    tied = [Tie("under_head", "bolt_top"), Tie("seat", "sleeve_top")]
    soft = {"bolt": Elastic(YOUNG, 0.0), "sleeve": Elastic(STIFFER, 0.0), "head": Elastic(YOUNG, 0)}
    other = Bolt("sleeve", 3.0, (0.0, 0.0, 1.0), name="second")
    held = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"), Support("top", "z")]
    problem = bolted(BOLT, other, materials=soft, contacts=tied, loads=(), supports=held)
    level = Newton(problem, TIGHT).solve(0.0)
    assert dict(level.report.bolts) == pytest.approx({"bolt": PRELOAD, "second": 3.0}, rel=1e-5)


def test_stages_keep_what_is_tightened() -> None:
    """The force is the preload, follows the diagram under load, and returns to the preload."""
    problem = bolted(
        loads=[Traction("top", (0.0, 0.0, 1 / 3), name="pull")],
        materials={
            "bolt": Flow(VonMises(YOUNG, 0.0, YIELD)),
            "sleeve": Elastic(STIFFER, 0.0),
            "head": Elastic(1e5 * YOUNG, 0.0),
        },
    )
    stages = [Stage({"pull": 1.5 * APART}), Stage({"pull": 0.0})]
    levels = list(stage_path(Newton(problem, TIGHT), LoadingHistory(problem, stages)))
    forces = [level.report.bolts["bolt"] for level in converged(levels)]
    assert forces == pytest.approx([PRELOAD, 1.5 * APART, PRELOAD], rel=1e-4)


def in_stages(*stages: Stage, **changes: Any) -> list[Level]:
    """Return the levels of a bolt that can yield, under tension at the head."""
    materials = {
        "bolt": Flow(VonMises(YOUNG, 0.0, YIELD)),
        "sleeve": Elastic(STIFFER, 0.0),
        "head": Elastic(1e5 * YOUNG, 0.0),
    }
    pull = [Traction("top", (0.0, 0.0, 1 / 3), name="pull")]
    problem = bolted(**({"loads": pull, "materials": materials} | changes))
    history = LoadingHistory(problem, stages)
    (told,) = problem.shanks.in_words()
    assert told.count("tighten again (bolt)") == any("bolt" in a.factors for a in stages)
    return list(stage_path(Newton(problem, TIGHT), history))


def test_stages_tighten_anew() -> None:
    """Tighten under load in two levels; without load the new preload remains, by the diagram."""
    load, more = 0.5 * APART, 1.5
    left = more * PRELOAD - SHARE * load
    apart = left / (1 - SHARE)
    levels = in_stages(
        Stage({"pull": load}),
        Stage({"bolt": more}, steps=2),
        Stage({"pull": 0.0}),
        Stage({"pull": 0.95 * apart}),
        Stage({"pull": 1.05 * apart, "bolt": 1.05 * apart / PRELOAD}),
        Stage({"bolt": 0.5, "pull": 0.0}),
    )
    forces = [level.report.bolts["bolt"] for level in converged(levels)]
    expected = [PRELOAD, theory(load), 1.25 * PRELOAD, more * PRELOAD, left]
    expected += [left + SHARE * 0.95 * apart, 1.05 * apart, 0.5 * PRELOAD]
    assert forces == pytest.approx(expected, rel=1e-4)
    assert [level.report.factors["bolt"] for level in levels[:4]] == [1.0, 1.0, 1.25, 1.5]


@SERIAL
def test_limit_load_of_a_bolt_that_is_tightened_anew() -> None:
    """The limit load equals that without preload, to 1e-4 on both sides."""
    steel, hard = VonMises(YOUNG, 0.0, YIELD), VonMises(STIFFER, 0.0, 10 * YIELD)
    about = {"bolt": steel, "sleeve": hard, "head": hard}
    full = limit_load(bolted(initial=(), materials=about), 1e-6).lower
    flowing = {"materials": {name: Flow(law) for name, law in about.items()}}
    anew = [Stage({"pull": 0.5 * APART}), Stage({"bolt": 2.0})]
    converged(in_stages(*anew, Stage({"pull": (1 - 1e-4) * full}), **flowing))
    above = in_stages(*anew, Stage({"pull": (1 + 1e-4) * full}), **flowing)[-1]
    assert not above.report.converged


@SERIAL
def test_force_that_a_shank_does_not_reach() -> None:
    """The message names the stage, and the force of the shank."""
    level = in_stages(Stage({"pull": 1.0}), Stage({"bolt": 2 * YIELD / PRELOAD}))[-1]
    assert not level.report.converged
    assert "in 'stage 2', at" in level.report.reason
    assert (
        "the bolt 'bolt' could not be tightened to the force 800; it reached only"
        in level.report.reason
    )


@SERIAL
def test_limit_load_is_that_without_preload() -> None:
    """The interior point method and a path from the preload agree; runs say so."""
    steel, hard = VonMises(YOUNG, 0.0, YIELD), VonMises(STIFFER, 0.0, 10 * YIELD)
    about = {"materials": {"bolt": steel, "sleeve": hard, "head": hard}}
    plain = limit_load(bolted(initial=(), **about), 1e-6)
    assert plain.levelled_off
    expected, tight = plain.lower, bolted(**about)
    assert limit_load(tight, 1e-6).lower == pytest.approx(expected, rel=1e-6)
    (told,) = ignored(tight)
    assert told.startswith("preloads of bolts remain")
    path = limit_load(bolted(**about), 1e-4, method="path")
    assert path.lower == pytest.approx(expected, rel=1e-4)


@SERIAL
def test_bolt_that_yields_is_told() -> None:
    """No level has a preload beyond the yield force, and the bolts are loose again."""
    problem = bolted(Bolt("bolt", 2 * YIELD * AREA, (0.0, 0.0, 1.0), (0.5, 2.5)))
    level = Newton(problem, TIGHT).solve(0.0)
    assert not level.report.converged
    assert "the bolt 'bolt' could not be tightened to its preload of 800" in level.report.reason
    assert problem.shanks.loose


@pytest.mark.parametrize(
    ("bolts", "words"),
    [
        ([Bolt("screw", 1.0, (0, 0, 1))], ["'screw' is not a volume", "bolt, head"]),
        ([Bolt("bolt", 1.0, (0, 1))], ["'bolt'", "[0, 1]", "3 numbers"]),
        ([Bolt("bolt", 1.0, (0, 0, 1), (1.0, 4.0))], ["from 1 to 4", "from 0 to 3"]),
        ([BOLT, Bolt("bolt", 1.0, (0, 0, 1), name="b")], ["two bolts", "'b'"]),
        (
            [Bolt("bolt", 1.0, (0, 0, 1), name="b"), Bolt("head", 1.0, (0, 0, 1), name="b")],
            ["'bolt' and 'head' are both called 'b'"],
        ),
    ],
)
def test_bolts_that_do_not_fit_are_refused(bolts: list[Bolt], words: list[str]) -> None:
    assert_refused(lambda: bolted(*bolts), words)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"preload": 0.0}, ["preload = 0.0", "above 0"]),
        ({"preload": -5.0}, ["preload = -5.0"]),
        ({"preload": math.nan}, ["preload = nan"]),
        ({"axis": (0.0, 0.0, 0.0)}, ["axis = [0.0, 0.0, 0.0]"]),
        ({"axis": (0.0, math.inf, 0.0)}, ["axis = [0.0, inf, 0.0]"]),
        ({"shank": (2.0, 1.0)}, ["[2.0, 1.0]", "smaller one first"]),
        ({"shank": (2.0,)}, ["[2.0]"]),
    ],
)
def test_bolts_that_are_none_are_refused(given: dict[str, Any], words: list[str]) -> None:
    plain: dict[str, Any] = {"on": "bolt", "preload": 1.0, "axis": (0.0, 0.0, 1.0)}
    assert_refused(lambda: Bolt(**(plain | given)), words)


@SERIAL
def test_body_force_along_shank_is_its_mean() -> None:
    """With a weight in the shank, the reported force is the mean along the shank."""
    weight = [BodyForce("bolt", (0.0, 0.0, -1.0)), Traction("top", (0.0, 0.0, 1.0))]
    stiff = {"bolt": Elastic(YOUNG, 0.0), "sleeve": Elastic(STIFFER, 0.0)}
    problem = bolted(loads=weight, materials=stiff | {"head": Elastic(1e5 * YOUNG, 0.0)})
    levels = converged(list(load_path(Newton(problem, TIGHT), [3 * APART])))
    ground = -levels[-1].report.reactions["support bottom"][2]
    middle = ground + 3 * APART * LENGTH / 2
    assert levels[-1].report.bolts["bolt"] == pytest.approx(middle, rel=1e-4)
