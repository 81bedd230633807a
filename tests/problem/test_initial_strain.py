"""Test temperature, initial stress, interference: known values, and all terms of the gap."""

from functools import cache
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    BorderedNewton,
    Contact,
    Elastic,
    InitialStress,
    InputError,
    Level,
    Newton,
    NewtonOptions,
    PorePressure,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Temperature,
    VonMises,
    WorkNewton,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import limit_load
from perfplast_fenicsx.problem import Prescribed
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from tests.models import STACK_HEIGHTS
from tests.solvers.levels import TIGHT

YOUNG, YIELD, EXPANSION = 2e5, 300.0, 1e-5
HEIGHT = sum(STACK_HEIGHTS)
STEEL = VonMises(YOUNG, 0.3, YIELD, EXPANSION)
ROLLERS = (Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"))
METHODS = [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton]


@cache
def blocks() -> TaggedMesh:
    return stacked_blocks(MPI.COMM_WORLD, 2, heights=STACK_HEIGHTS)


def stack(
    *initial: Temperature | InitialStress, gap: float | str = 0.0, interference: bool = False
) -> Problem:
    """Return two blocks between rollers with free sides; ζ pulls the upper block sideways."""
    return Problem(
        blocks(),
        {"lower": STEEL, "upper": STEEL},
        [*ROLLERS, Support("top", "z")],
        [BodyForce("upper", (1.0, 0.0, 0.0))],
        [Contact("lower_top", "upper_bottom", gap, interference)],
        initial=initial,
    )


def heated(change: float | str) -> tuple[Temperature, Temperature]:
    return Temperature("lower", change), Temperature("upper", change)


def at_rest(problem: Problem, method: type) -> Level:
    value = 0.0
    if method.prescribes is Prescribed.WORK:  # type: ignore[attr-defined]
        value = Newton(problem, TIGHT).solve(0.0).state.alpha
    loose = method is AugmentedLagrangian
    options = AugmentedLagrangianOptions(tolerance=1e-11) if loose else TIGHT
    level: Level = method(problem, options).solve(value)
    assert level.report.converged, level.report.reason
    assert abs(level.report.duality_gap) < 1e-9
    assert level.report.balance < 1e-10
    assert level.state.zeta == pytest.approx(0.0, abs=1e-6)
    return level


def pushed(level: Level) -> float:
    """Return the force of the upper support on bodies of area 1."""
    return -level.report.reactions["support top"][2]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("change", [100.0, 200.0])
def test_a_bar_that_is_heated_and_held(method: type, change: float) -> None:
    """The stress is EaT, and at most the yield stress."""
    level = at_rest(stack(*heated(change)), method)
    stress = min(YOUNG * EXPANSION * change, YIELD)
    assert pushed(level) == pytest.approx(stress, rel=1e-8)
    assert (level.report.plastic_fraction > 0.99) == (stress > 0.99 * YIELD)


@pytest.mark.mpi2("0.001-Newton")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("overlap", [1e-3, 4e-3])
def test_a_press_fit(method: type, overlap: float) -> None:
    level = at_rest(stack(gap=-overlap, interference=True), method)
    assert pushed(level) == pytest.approx(min(YOUNG * overlap / HEIGHT, YIELD), rel=1e-8)
    assert level.report.equilibrium < 1e-8
    force = level.contact_forces.sum()
    assert MPI.COMM_WORLD.allreduce(force) == pytest.approx(pushed(level), rel=1e-8)


def fitted(gap: float | str, formulation: Any) -> Problem:
    """Return two blocks between rollers; the height of one block grows with ζ."""
    contact = Contact("lower_top", "upper_bottom", gap, True, formulation, constant=False)
    supports = [*ROLLERS, Support("top", "z")]
    return Problem(blocks(), {"lower": STEEL, "upper": STEEL}, supports, contacts=[contact])


@pytest.mark.parametrize(
    ("method", "formulation"), [(Newton, None), (Newton, "mortar"), (AugmentedLagrangian, None)]
)
def test_a_press_fit_that_grows(method: type, formulation: Any) -> None:
    """ζ is the overlap; its driving force is linear below yield, and 0 at ζ = 0."""
    loose = method is AugmentedLagrangian
    options = AugmentedLagrangianOptions(tolerance=1e-12) if loose else TIGHT
    solver = method(fitted(-1.0, formulation), options)
    for overlap in (0.0, 5e-4, 1e-3, 4e-3):
        level = solver.solve(overlap)
        assert level.report.converged, level.report.reason
        stress = min(YOUNG * overlap / HEIGHT, YIELD)
        assert level.report.driving_force == pytest.approx(stress, rel=1e-8, abs=1e-8)
        assert level.report.reactions["support top"][2] == pytest.approx(-stress, abs=1e-6)
        assert level.report.equilibrium < 1e-8
        assert abs(level.report.duality_gap) < 1e-11


def test_where_bodies_are_apart_no_overlap_grows() -> None:
    """The energy grows by the driving force, and the gap in the neighbourhood does not change."""
    problem = fitted("2e-3*(x - 0.6)", None)
    given = problem.constraints.gap
    solver = Newton(problem, TIGHT)
    levels = [solver.solve(zeta) for zeta in (1.0, 1.01, 1.02)]
    for level in levels:
        expected = np.where(given < 0, level.state.zeta * given, given)
        assert problem.motion.gap_at(level.state.zeta) == pytest.approx(expected)
        assert abs(level.report.duality_gap) < 1e-11
        assert 0 < level.report.active_contacts < problem.num_pairs
    energies = [level.iterations[-1].energy for level in levels]
    force = levels[1].report.driving_force
    assert (energies[2] - energies[0]) / 0.02 == pytest.approx(force, rel=1e-6)
    with pytest.raises(InputError, match="no overlap that could grow"):
        Contact("lower_top", "upper_bottom", constant=False)


@pytest.mark.parametrize("method", METHODS)
def test_bodies_that_swell_freely_have_no_stress(method: type) -> None:
    """The gap is wide enough; only rounding remains, and is judged as rounding."""
    problem = stack(*heated("50 + 0*x"), gap=0.01)
    value = 0.0
    if method.prescribes is Prescribed.WORK:  # type: ignore[attr-defined]
        value = Newton(problem).solve(0.0).state.alpha
    level = method(problem).solve(value)
    assert level.report.converged, level.report.reason
    assert abs(level.stress.x.array).max(initial=0) < 1e-6 * YIELD
    top = STACK_HEIGHTS[0] * EXPANSION * 50
    assert level.report.max_displacement == pytest.approx(np.hypot(np.sqrt(2) * 5e-4, top), rel=0.2)


def test_initial_stress_that_is_in_equilibrium_stays() -> None:
    both = [InitialStress(name, (0.0, 0.0, -50.0, 0.0, 0.0, 0.0)) for name in ("lower", "upper")]
    level = at_rest(stack(*both), Newton)
    assert pushed(level) == pytest.approx(50.0, rel=1e-9)
    assert level.report.max_displacement < 1e-12
    sheared = [InitialStress(name, (0.0, 0.0, -50.0, 7.0, 0.0, 0.0)) for name in ("lower", "upper")]
    mandel = Newton(stack(*sheared)).problem.initial_strain
    assert mandel is not None
    shear = mandel.x.array.reshape(-1, 6)[:, 3]
    assert shear == pytest.approx(-7.0 * np.sqrt(2) / (2 * STEEL.shear))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_term_of_the_duality_gap_counts(degree: int, seed: int) -> None:
    """Random problems have dead load, pore pressure, u_D, e₀ and gaps of both signs at once."""
    a, b, c, d, e, f, g = np.random.default_rng(seed).uniform(0.5, 1.5, 7)
    problem = Problem(
        blocks(),
        {
            "lower": VonMises(YOUNG, 0.3, 0.4 * YIELD, EXPANSION),
            "upper": VonMises(7e4, 0.2, 0.3 * YIELD, 2 * EXPANSION),
        },
        [*ROLLERS, Support("top", "z", -1.2e-3 * a), Support("top", "x")],
        [
            Pressure("upper_bottom", f"{20 * b} + 10*x"),
            BodyForce("upper", (f"{60 * c}*z", 30 * d, 0.0), constant=True),
            PorePressure("lower", f"{40 * e}*(1 + x*y)"),
        ],
        [Contact("lower_top", "upper_bottom", f"{3e-4 * f}*(x - 0.6*y - 0.4)", interference=True)],
        degree=degree,
        initial=[
            Temperature("lower", f"{60 * g}*(1 + y)"),
            InitialStress("upper", (30.0 * a, 0.0, "-40*x", 0.0, 10.0 * b, 0.0)),
        ],
    )
    assert problem.interferes
    assert problem.has_gaps
    level = Newton(problem, NewtonOptions(tolerance=1e-11)).solve(1.0)
    assert level.report.converged, level.report.reason
    assert 0 < level.report.plastic_fraction
    assert abs(level.report.duality_gap) < 1e-11
    assert level.report.balance < 1e-10

    fields, u = QuadratureFields(problem), level.state.u.x.petsc_vec
    fields.u.x.array[:] = level.state.u.x.array
    fields.update()
    forces = fields.assemble_all_forces().array_r
    u_D = problem.prescribed.ravel()[: len(forces)]
    gaps = problem.comm.allreduce(float(level.contact_forces @ problem.basis.gap))
    terms = {
        "Ψ": fields.potential(),
        "L₀": -float(problem.loads.dead.dot(u)),
        "L₁": -problem.loads.alpha(u),
        "S": fields.conjugate(),
        "e₀": fields.initial_work(),
        "gaps": gaps,
        "u_D": -problem.comm.allreduce(float(forces @ u_D)),
    }
    scale = terms["Ψ"] + terms["S"]
    assert abs(sum(terms.values())) < 1e-11 * scale
    assert min(map(abs, terms.values())) > 1e-4 * scale, terms


def test_a_limit_load_is_that_without() -> None:
    """Temperature and interference change the path to the limit load, but not the limit load."""
    arguments = (
        blocks(),
        {"lower": STEEL, "upper": STEEL},
        ROLLERS,
        [Pressure("top", 1.0)],
    )
    plain = Problem(*arguments, [Contact("lower_top", "upper_bottom")])
    other = Problem(
        *arguments,
        [Contact("lower_top", "upper_bottom", "-1e-4*(1 + x)", interference=True)],
        initial=[Temperature("lower", "40*y")],
    )
    known, found = limit_load(plain, 1e-4), limit_load(other, 1e-4)
    assert found.levelled_off, found.reason
    assert known.upper is not None
    assert found.lower == pytest.approx(YIELD, rel=2e-4)
    assert found.lower <= known.upper * (1 + 1e-9)
    direct = limit_load(other, 1e-4, method="interior-point")
    assert direct.lower == pytest.approx(known.lower, rel=1e-6)
    assert direct.upper == pytest.approx(known.upper, rel=1e-6)


@pytest.mark.parametrize(
    ("initial", "words"),
    [
        (Temperature("lower", "1/(x - x)"), ["temperature of 'lower'", "1/(x - x)"]),
        (Temperature("middle", 1.0), ["'middle' is not a volume"]),
        (InitialStress("lower", (1.0, 2.0)), ["initial stress of 'lower'", "2 components", "6"]),
    ],
)
def test_what_is_wrong_is_refused(initial: Temperature | InitialStress, words: list[str]) -> None:
    with pytest.raises(InputError) as refusal:
        stack(initial)
    assert all(word in str(refusal.value) for word in words)
    assert len(set(MPI.COMM_WORLD.allgather(str(refusal.value)))) == 1


def test_bodies_without_expansion_are_not_heated() -> None:
    with pytest.raises(InputError, match="has no expansion"):
        Problem(
            blocks(),
            {"lower": Elastic(1.0, 0.2), "upper": STEEL},
            ROLLERS,
            [Pressure("top", 1.0)],
            [Contact("lower_top", "upper_bottom")],
            initial=heated(1.0),
        )


def test_interference_is_said() -> None:
    with pytest.raises(InputError, match="interference = true"):
        stack(gap=-1e-3)
