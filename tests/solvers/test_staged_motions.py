"""Test stages that move supports, rigid surfaces and obstacles: known cycles, contact opening."""

from dataclasses import replace

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    Contact,
    Hardening,
    InputError,
    LoadingHistory,
    Newton,
    Plane,
    Pressure,
    RigidSurface,
    Stage,
    Support,
    Temperature,
    VonMises,
    WorkNewton,
    load_path,
    stage_path,
)
from perfplast_fenicsx.arrays import Floats
from tests.solvers.test_stages import (
    EXPANSION,
    HARD,
    ISOTROPIC,
    KINEMATIC,
    ROLLERS,
    SHARP,
    STEEL,
    YIELD,
    YOUNG,
    bar,
    solved,
)

AT_YIELD = YIELD / YOUNG
DOWN = (0.0, 0.0, -1.0)
PRESS = Support("top", "z", -1.0, constant=False, name="press")
PUNCH = Plane("top", (0.0, 0.0, 2.0), DOWN, move=DOWN, name="punch")


def strained(body: VonMises | Hardening, strains: Floats) -> Floats:
    """Return the stress of a bar at a sequence of strains."""
    isotropic, kinematic = getattr(body, "isotropic", 0.0), getattr(body, "kinematic", 0.0)
    plastic = accumulated = 0.0
    found = []
    for strain in strains:
        trial = body.young * (strain - plastic) - kinematic * plastic
        beyond = max(0.0, abs(trial) - body.yield_stress - isotropic * accumulated)
        flow = beyond / (body.young + isotropic + kinematic)
        plastic, accumulated = plastic + flow * np.sign(trial), accumulated + flow
        found.append(body.young * (strain - plastic))
    return np.array(found)


def halves(tops: list[float]) -> Floats:
    """Return the values, each preceded by the middle of its step."""
    return np.column_stack([np.convolve([0.0, *tops], [0.5, 0.5], "valid"), tops]).ravel()


@pytest.mark.mpi2("body0")
@pytest.mark.parametrize("body", [STEEL, ISOTROPIC, KINEMATIC])
def test_a_given_strain_goes_forth_and_back(body: VonMises | Hardening) -> None:
    """A support imposes ±2ε_y; its force is on file by its name."""
    supports = [*ROLLERS, Support("top", "z", -2.0, constant=False, name="press")]
    problem = bar(body, supports=supports, loads=[])
    tops = [2.0, -2.0, 2.0, 0.0]
    levels = solved(problem, [Stage({"press": top * AT_YIELD}, 2) for top in tops])
    strains = halves(tops) * AT_YIELD
    for level, strain, stress in zip(levels, strains, strained(body, strains), strict=True):
        report = level.report
        assert report.factors["press"] == pytest.approx(strain, rel=1e-12, abs=1e-15)
        assert report.driving_forces["press"] == pytest.approx(2 * stress, abs=1e-9 * YIELD)
        assert report.reactions["support press"] == pytest.approx([0, 0, -stress], abs=1e-6)
        assert report.reactions["support bottom"] == pytest.approx([0, 0, stress], abs=1e-6)


def test_a_punch_is_withdrawn_and_comes_back() -> None:
    """Contact opens when the punch is withdrawn, and closes again where the bar remained short."""
    contacts = [Contact("lower_top", "upper_bottom")]
    problem = bar(ISOTROPIC, loads=[], contacts=contacts, obstacles=[PUNCH])
    strokes = [3.0, 1.0, 2.0, 2.8, 4.0]
    stages = [Stage({"punch": stroke * 2 * AT_YIELD}, 2) for stroke in strokes]
    plastic, apart = 0.0, []
    for level, stroke in zip(solved(problem, stages), halves(strokes), strict=True):
        room = YIELD + HARD * plastic
        stress = max(0.0, YOUNG * (stroke * AT_YIELD - plastic))
        if stress > room:
            flow = (stress - room) / (YOUNG + HARD)
            plastic, stress = plastic + flow, stress - YOUNG * flow
        report = level.report
        assert report.driving_forces["punch"] == pytest.approx(stress, abs=1e-9 * YIELD)
        assert report.reactions["obstacle punch"] == pytest.approx([0, 0, -stress], abs=1e-6)
        if stress == 0:
            apart.append(stroke)
        else:
            assert report.active_contacts == problem.num_pairs
    assert apart == pytest.approx([1.0, 1.5])


def test_an_overlap_grows_and_shrinks() -> None:
    """Blocks between planes are compressed by the factor, yield, and separate again."""
    fit = Contact("lower_top", "upper_bottom", -1.0, True, constant=False, name="fit")
    supports = [*ROLLERS, Support("top", "z")]
    problem = bar(ISOTROPIC, supports=supports, loads=[], contacts=[fit])
    tops = [2.0, 1.5, 0.5]
    levels = solved(problem, [Stage({"fit": 2 * top * AT_YIELD}, 2) for top in tops])
    stresses = np.maximum(strained(ISOTROPIC, halves(tops) * AT_YIELD), 0.0)
    for level, stress in zip(levels, stresses, strict=True):
        assert level.report.driving_forces["fit"] == pytest.approx(stress, abs=1e-9 * YIELD)
        assert level.report.reactions["support bottom"] == pytest.approx([0, 0, stress], abs=1e-6)


def test_by_both_algorithms() -> None:
    """Perfectly plastic blocks in contact, pushed and released, with ALG1 and ALG2."""
    found = []
    for method in (Newton, AugmentedLagrangian):
        contacts = [Contact("lower_top", "upper_bottom")]
        problem = bar(STEEL, loads=[], contacts=contacts, obstacles=[PUNCH])
        stages = [Stage({"punch": stroke * 2 * AT_YIELD}) for stroke in (3.0, 1.0, 2.5, 2.2)]
        levels = list(stage_path(method(problem), LoadingHistory(problem, stages)))
        assert all(level.report.converged for level in levels)
        found.append([level.report.driving_forces["punch"] for level in levels])
    assert found[0] == pytest.approx(YIELD * np.array([1.0, 0.0, 0.5, 0.2]), abs=1e-6)
    assert found[1] == pytest.approx(found[0], abs=1e-5 * YIELD)


def test_loads_motions_and_heat_have_factors_of_their_own() -> None:
    """The blocks are independent: one is pushed, the other is heated between planes."""
    heat = AT_YIELD / EXPANSION
    problem = bar(
        STEEL,
        supports=[
            *ROLLERS,
            Support("upper_bottom", "z"),
            Support("lower_top", "z", -1.0, constant=False, name="press"),
        ],
        initial=[Temperature("lower", heat, "heat")],
        contacts=[],
    )
    stages = [
        Stage({"press": 0.5 * AT_YIELD}),
        Stage({"push": 0.6 * YIELD, "heat": 1.0}, 2),
        Stage({"press": 0.0, "heat": 0.25, "push": 0.0}, 2),
    ]
    strains = np.array([0.5, 1.0, 1.5, 0.875, 0.25]) * AT_YIELD
    pushes = np.array([0.0, 0.3, 0.6, 0.3, 0.0]) * YIELD
    levels = solved(problem, stages)
    for level, push, stress in zip(levels, pushes, strained(STEEL, strains), strict=True):
        assert level.report.driving_forces["press"] == pytest.approx(stress, abs=1e-6)
        assert level.report.works["push"] == pytest.approx(push / YOUNG, abs=1e-12)


def test_a_punch_drags_and_drags_back() -> None:
    """Tresca friction resists slip in either direction, measured from the start of the stage."""
    rough = replace(PUNCH, move=(1.0, 0.0, -1.0), tresca=1.0)
    problem = bar(STEEL, loads=[], supports=[Support("bottom")], obstacles=[rough])
    levels = solved(problem, [Stage({"punch": stroke}) for stroke in (1e-3, 0.9e-3, 1e-3)])
    sideways = [level.report.reactions["obstacle punch"][0] for level in levels]
    assert sideways == pytest.approx([1.0, -1.0, 1.0], rel=0.03)  # some slip is along y


def test_a_rigid_end_is_turned_and_turned_back() -> None:
    """The body is elastic: the moment follows the angle, and returns to zero."""
    turned = RigidSurface("top", rotation=(0.0, 0.0, 1.0), constant=False, name="wrench")
    problem = bar(STEEL, loads=[], supports=[Support("bottom"), turned])
    levels = solved(problem, [Stage({"wrench": angle}) for angle in (1e-4, -2e-4, 0.0)])
    moments = [level.report.driving_forces["wrench"] for level in levels]
    assert moments[0] > 0
    assert moments[1:] == pytest.approx([-2 * moments[0], 0.0], abs=1e-9 * moments[0])


def test_loads_and_motions_that_grow_together() -> None:
    """Without stages, ζ multiplies both; the work cannot then be prescribed."""
    supports = [
        *ROLLERS,
        Support("upper_bottom", "z"),
        Support("lower_top", "z", -1.0, constant=False),
    ]
    problem = bar(STEEL, supports=supports, contacts=[], bodies=STEEL)
    for level in load_path(Newton(problem, SHARP), AT_YIELD * np.array([0.5, 0.9])):
        assert level.report.driving_force == pytest.approx(YOUNG * level.report.zeta, rel=1e-9)
        assert level.report.alpha == pytest.approx(level.report.zeta / YOUNG, rel=1e-9)
    with pytest.raises(InputError, match="ζ multiplies motions or overlaps"):
        WorkNewton(problem)


@pytest.mark.parametrize(
    ("supports", "factors", "message"),
    [
        ([PRESS], {"pres": 1.0}, "name; did you mean 'press'"),
        ([PRESS], {}, "'press' is in no stage"),
        ([Support("top", "z", -1.0)], {"top": 1.0}, "'top', which is constant"),
        (
            [PRESS, replace(PRESS, name="other")],
            {"press": 1.0, "other": 1.0},
            "'press' and 'other' hold",
        ),
        (
            [replace(PRESS, name="push")],
            {"push": 1.0},
            "'push', .* of a load .* of a motion",
        ),
    ],
)
def test_names_that_do_not_fit(
    supports: list[Support], factors: dict[str, float], message: str
) -> None:
    side = Pressure("upper_bottom", 1.0, "push", constant="push" not in factors)
    problem = bar(STEEL, supports=[*ROLLERS, *supports], loads=[side])
    with pytest.raises(InputError, match=message):
        LoadingHistory(problem, [Stage(factors)])
