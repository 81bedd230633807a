"""Test stages: known cycles with both hardenings, heating, excessive loads, refusals."""

from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BorderedNewton,
    Contact,
    Elastic,
    Flow,
    Hardening,
    InputError,
    Level,
    LoadingHistory,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Temperature,
    Tie,
    VonMises,
    load_path,
    stacked_blocks,
    stage_path,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.materials import DruckerPrager, MohrCoulomb
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh

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
    """Return two glued stacked blocks, together 2 high, pushed at the top."""
    arguments: dict[str, object] = {
        "supports": ROLLERS,
        "loads": [Pressure("top", 1.0, name="push")],
        "contacts": [Tie("lower_top", "upper_bottom")],
        "degree": degree,
    }
    materials = dict.fromkeys(("lower", "upper"), more.pop("bodies", Flow(body)))
    return Problem(blocks(), materials, **(arguments | more))  # type: ignore[arg-type]


def solved(problem: Problem, stages: list[Stage]) -> list[Level]:
    levels = list(stage_path(Newton(problem, SHARP), LoadingHistory(problem, stages)))
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-10
        assert level.report.equilibrium < 1e-9
        assert level.report.balance < 1e-9
    return levels


def by_hand(body: Hardening, stresses: Floats) -> Floats:
    """Return the strain of a bar at a sequence of stresses."""
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
    return np.array(found)


@pytest.mark.mpi2("body0-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("body", [ISOTROPIC, KINEMATIC, Hardening(YOUNG, 0.3, YIELD, 3e3, 7e3)])
def test_cycles_by_hand(body: Hardening, degree: int) -> None:
    """The bar is pushed and pulled beyond twice the strain at first yield, and unloaded."""
    tops = [400.0, -450.0, 500.0, 0.0]
    levels = solved(bar(body, degree), [Stage({"push": top}, 2) for top in tops])
    stresses = np.column_stack([np.convolve([0.0, *tops], [0.5, 0.5], "valid"), tops]).ravel()
    strains = by_hand(body, stresses)
    assert abs(strains).max() > 2 * YIELD / YOUNG
    for level, stress, strain in zip(levels, stresses, strains, strict=True):
        assert level.report.factors["push"] == pytest.approx(stress, rel=1e-12, abs=1e-10)
        assert level.report.works["push"] == pytest.approx(2 * strain, rel=1e-9)
        found = level.stress.x.array.reshape(-1, 6)
        assert np.allclose(found, stress * np.array([0, 0, -1, 0, 0, 0]), rtol=0, atol=1e-7)
    flow = levels[-1].state.history["accumulated_plastic_strain"].x.array
    plastic = strains - stresses / YOUNG
    assert np.allclose(flow, abs(np.diff(plastic, prepend=0.0)).sum(), rtol=1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_restrained_bar_is_heated_and_cooled(degree: int) -> None:
    """The stress is −EaT until yield; cooled to the initial temperature, the bar is in tension."""
    at_yield = YIELD / (YOUNG * EXPANSION)
    stages = [Stage({"lower": 1.5 * at_yield}, 3), Stage({"lower": 0.0}, 3)]
    problem = bar(
        STEEL,
        degree,
        supports=[*ROLLERS, Support("lower_top", "z")],
        initial=[Temperature("lower", 1.0)],
        loads=[],
        contacts=[Contact("upper_bottom", "lower_top")],
    )
    stresses = np.array([-0.5, -1, -1, -0.5, 0, 0.5]) * YIELD
    cells = problem.tagged_mesh.cells("lower")
    points = problem.S.dofmap.list[cells].ravel()
    for level, stress in zip(solved(problem, stages), stresses, strict=True):
        found = level.stress.x.array.reshape(-1, 6)[points]
        assert np.allclose(found, stress * np.array([0, 0, 1, 0, 0, 0]), rtol=0, atol=1e-9 * YIELD)


@pytest.mark.parametrize("body", [Elastic(YOUNG, 0.3), Flow(STEEL)])
def test_nothing_is_left_of_an_elastic_load(body: Elastic | Flow) -> None:
    """Only rounding errors remain, which must not be their own scale."""
    problem = bar(STEEL, bodies=body)
    stages = [Stage({"push": 0.7 * YIELD}), Stage({"push": 0.0}, 3), Stage({"push": 1.0})]
    stresses = 0.7 * YIELD * np.array([1, 2 / 3, 1 / 3, 0, 1 / (0.7 * YIELD)])
    for level, stress in zip(solved(problem, stages), stresses, strict=True):
        found = level.stress.x.array.reshape(-1, 6)
        assert np.allclose(found, stress * np.array([0, 0, -1, 0, 0, 0]), rtol=0, atol=1e-10)


@pytest.mark.long(but=["ground0"])
@pytest.mark.parametrize(
    "ground",
    [DruckerPrager(YOUNG, 0.1, 50.0, 30.0, "compression"), MohrCoulomb(YOUNG, 0.1, 50.0, 30.0)],
)
def test_ground_in_an_oedometer(ground: DruckerPrager | MohrCoulomb) -> None:
    """Compressed between smooth walls it yields, and the walls keep their pressure after unloading.

    Under the pressure q the ground yields when (1 + s)σ_h + (1 − s)q = b. It flows along ((1 +
    s)/2, (1 + s)/2, s − 1) until ε_h is zero.
    """
    sides = [
        Surface(f"{axis}{side}", ("soil",), lambda x, i=i, side=side: x[i] == side)
        for i, axis in enumerate("xyz")
        for side in (0, 1)
    ]
    soil = structured_mesh(MPI.COMM_WORLD, [Box("soil", (0, 0, 0), (1, 1, 1), (2, 1, 1))], sides)
    walls = [Support(f"{axis}{side}", axis) for axis in "xy" for side in (0, 1)]
    held, pushed = [*walls, Support("z0", "z")], [Pressure("z1", 1.0, name="push")]
    problem = Problem(soil, {"soil": Flow(ground)}, held, pushed)
    stages = [Stage({"push": 600.0}, 2), Stage({"push": 200.0}), Stage({"push": 600.0})]
    levels = solved(problem, stages)
    sine, nu = 0.5, ground.poisson
    bound = 2 * ground.cohesion * np.cos(np.pi / 6)
    for level, push in zip(levels, (300.0, 600.0, 200.0, 600.0), strict=True):
        most = max(push, 300.0 if level is levels[0] else 600.0)
        across = (bound - (1 - sine) * most) / (1 + sine)
        assert across < -nu / (1 - nu) * most
        flow = -2 / (1 + sine) * (across * (1 - nu) + nu * most) / YOUNG
        down = (-most - 2 * nu * across) / YOUNG - (1 - sine) * flow
        relieved = most - push
        across += nu / (1 - nu) * relieved
        down += relieved * (1 - 2 * nu**2 / (1 - nu)) / YOUNG
        found = level.stress.x.array.reshape(-1, 6)
        expected = np.array([across, across, -push, 0, 0, 0])
        assert np.allclose(found, expected, rtol=0, atol=1e-8 * push)
        assert level.report.works["push"] == pytest.approx(-down, rel=1e-9)


@pytest.mark.mpi2
def test_contact_is_relieved_and_pushed_again() -> None:
    """Without load no pair pushes, but pairs are in contact where the next level begins."""
    contacts = [Contact("lower_top", "upper_bottom")]
    problem = bar(ISOTROPIC, contacts=contacts)
    levels = solved(problem, [Stage({"push": top}) for top in (350.0, 0.0, 420.0)])
    strains = by_hand(ISOTROPIC, np.array([350.0, 0.0, 420.0]))
    for level, strain in zip(levels, strains, strict=True):
        assert level.report.works["push"] == pytest.approx(2 * strain, rel=1e-9)


def test_more_than_is_carried_ends_the_stages() -> None:
    weight = Pressure("top", 0.9 * YIELD, "weight", constant=True)
    problem = bar(STEEL, loads=[weight, Pressure("top", 1.0)])
    stages = [Stage({"top": -100.0}, 1, "relief"), Stage({"top": 50.0}, 3, "too much")]
    levels = list(stage_path(Newton(problem, SHARP), LoadingHistory(problem, stages)))
    assert [level.report.stage for level in levels] == ["", "relief", *["too much"] * 3]
    assert [level.report.converged for level in levels] == [True] * 4 + [False]
    assert levels[-1].report.reason.startswith("in 'too much', at top = 50: no equilibrium exists")
    assert levels[-2].report.works["top"] == pytest.approx(2 * 0.9 * YIELD / YOUNG)


def test_names_that_do_not_fit() -> None:
    problem = bar(STEEL, loads=[Pressure("top", 1.0, "push"), Pressure("x0", 1.0, "bed", True)])
    for stages, message in (
        ([Stage({"pusch": 1.0})], "'pusch'.*did you mean 'push'"),
        ([Stage({"push": 1.0}), Stage({"bed": 0.0})], "stage 2 has .* 'bed', which is constant"),
        ([Stage({})], "the load 'push' is in no stage"),
    ):
        with pytest.raises(InputError, match=message):
            LoadingHistory(problem, stages)
    for steps in (0, 10**7):
        with pytest.raises(InputError, match=f"steps = {steps} is not a valid number of levels"):
            Stage({"push": 1.0}, steps)
    with pytest.raises(InputError, match="factor of 'push' is inf"):
        Stage({"push": np.inf})


def test_algorithms_that_cannot_remember() -> None:
    problem = bar(ISOTROPIC)
    with pytest.raises(InputError, match="HardeningFlowLaw is not a projection"):
        AugmentedLagrangian(problem)
    history = LoadingHistory(problem, [Stage({"push": 1.0})])
    with pytest.raises(InputError, match="the method 'bordered-newton"):
        next(stage_path(BorderedNewton(problem), history))


@pytest.mark.parametrize("body", [ISOTROPIC, KINEMATIC])
def test_strained_to_twice_first_yield_and_back(body: Hardening) -> None:
    """A moving support imposes ±2ε_y, and finally zero strain."""
    at_yield = YIELD / YOUNG
    supports = [*ROLLERS, Support("top", "z", -2.0, constant=False)]
    problem = bar(body, supports=supports, loads=[])
    strains = at_yield * np.array([1.0, 2.0, 0.5, -2.0, 2.0, 0.0])
    levels = list(load_path(Newton(problem, SHARP), strains))
    plastic = accumulated = 0.0
    for level, strain in zip(levels, strains, strict=True):
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-10
        trial = YOUNG * (strain - plastic) - body.kinematic * plastic
        beyond = max(0.0, abs(trial) - YIELD - body.isotropic * accumulated)
        flow = beyond / (YOUNG + body.isotropic + body.kinematic)
        plastic, accumulated = plastic + flow * np.sign(trial), accumulated + flow
        expected = YOUNG * (strain - plastic) * np.array([0, 0, -1, 0, 0, 0])
        found = level.stress.x.array.reshape(-1, 6)
        assert np.allclose(found, expected, rtol=0, atol=1e-9 * YIELD)
