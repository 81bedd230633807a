"""Test strict bounds for bodies with pore water; strengths refer to effective stresses."""

import math
from pathlib import Path

from mpi4py import MPI

import pytest

from demos.verification.ground import COHESION
from meshes.slope import write_slope
from perfplast_fenicsx import (
    BodyForce,
    DruckerPrager,
    InputError,
    PorePressure,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.bound_problems import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_linear_tractions import SQUARE, cube
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read, touching_blocks

ANGLE = 25.0
N = math.tan(math.radians(45 + ANGLE / 2)) ** 2
DRY = 2 * COHESION * math.sqrt(N)
"""Limit pressure on a dry block between smooth planes."""
U = 0.2 * COHESION
GROUND = DruckerPrager(1e4, 0.3, COHESION, ANGLE, "plane-strain")
MERIDIAN = DruckerPrager(1e4, 0.3, COHESION, ANGLE, "compression")


def square(*loads: Load, material: DruckerPrager | VonMises = GROUND) -> Problem:
    """Return the unit square on rollers, consisting of two glued halves."""
    halves = {"lower": lambda x: x[1] < 0.5, "upper": lambda x: x[1] > 0.5}
    mesh = rectangle((2, 2), (1.0, 1.0), halves, SQUARE, 0.1)
    materials = dict.fromkeys(halves, material)
    return Problem(mesh, materials, [Support("left", "x"), Support("bottom", "y")], loads, degree=2)


def proven(problem: Problem, path: Path, rtol: float = 1e-5) -> BodyBounds:
    """Return strict bounds, which the checker also finds. Collective."""
    bounds = limit_bounds(problem, rtol)
    assert bounds.strict, (bounds.lower.why_not, bounds.upper.why_not)
    folder = ResultFolder(MPI.COMM_WORLD, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    for half in checked.values():
        assert not half.faults
    return bounds


def holds(bounds: BodyBounds, exact: float, rtol: float = 1e-4) -> None:
    """Check that the exact load lies between the bounds, and that they are close."""
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    off = 1e-8 * abs(exact)
    assert exact * (1 - rtol) <= bounds.lower.value <= exact + off
    assert exact - off <= bounds.upper.value <= exact * (1 + rtol)


def test_a_block_with_wet_pores(shared_tmp_path: Path) -> None:
    """σ₃′ = u is a tension, so the pressure on top is smaller by (N − 1)u."""
    wet = [PorePressure(name, U) for name in ("lower", "upper")]
    holds(proven(square(Pressure("top", 1.0), *wet), shared_tmp_path), DRY - (N - 1) * U)


@pytest.mark.mpi2
def test_a_seam_that_parts_pores(shared_tmp_path: Path) -> None:
    """A dry half glued to a wet half supports it, and carries no more than dry ground.

    The effective tractions of both halves at the seam differ by u.
    """
    bounds = proven(square(Pressure("top", 1.0), PorePressure("lower", U)), shared_tmp_path)
    assert DRY - (N - 1) * U < bounds.lower.value < bounds.upper.value < DRY


def test_pores_that_fill(shared_tmp_path: Path) -> None:
    """The pressure in the pores grows beside a constant pressure on top."""
    loads: list[Load] = [Pressure("top", 0.5 * DRY, constant=True)]
    loads += [PorePressure(name, 1.0, constant=False) for name in ("lower", "upper")]
    holds(proven(square(*loads), shared_tmp_path), 0.5 * DRY / (N - 1))


def test_pores_beside_contact(shared_tmp_path: Path) -> None:
    """The contact pressure is the total stress, including the pressure of the water."""
    problem = touching_blocks(
        materials=dict.fromkeys(("lower", "upper"), MERIDIAN),
        loads=[Pressure("top", 1.0), PorePressure("lower", U)],
        degree=2,
    )
    holds(proven(problem, shared_tmp_path), DRY - (N - 1) * U)


def test_under_water(shared_tmp_path: Path) -> None:
    """Water around a body and in its pores only reduces its weight."""
    water, weight = 0.3 * COHESION, 0.8 * COHESION
    deep = f"{water}*(3 - y)"
    loads: list[Load] = [Pressure("top", 1.0), Pressure("top", deep, constant=True)]
    loads += [Pressure("right", deep, constant=True)]
    for name in ("lower", "upper"):
        loads += [
            PorePressure(name, deep),
            BodyForce(name, (0.0, -weight), constant=True),
        ]
    wet = proven(square(*loads), shared_tmp_path, 1e-6)
    buoyant = [BodyForce(on, (0.0, water - weight), constant=True) for on in ("lower", "upper")]
    dry = limit_bounds(square(Pressure("top", 1.0), *buoyant), 1e-6)
    assert dry.strict
    assert wet.lower.value == pytest.approx(dry.lower.value, rel=1e-5)
    assert wet.upper.value == pytest.approx(dry.upper.value, rel=1e-5)


def test_pores_of_metal_change_nothing() -> None:
    """A flow that preserves volume does no work against a pore pressure."""
    metal = VonMises(1e4, 0.3, math.sqrt(3))
    plain = limit_bounds(square(Pressure("top", 1.0), material=metal), 1e-7)
    pores = PorePressure("upper", "3 + 2*x - y", constant=False)
    wet = square(Pressure("top", 1.0), pores, material=metal)
    bounds = limit_bounds(wet, 1e-7)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(plain.lower.value, rel=1e-6)
    assert bounds.upper.value == pytest.approx(plain.upper.value, rel=1e-6)


@pytest.mark.parametrize("wet", [("lower",), ("upper", "lower")])
def test_pores_of_metal_that_stay(shared_tmp_path: Path, wet: tuple[str, ...]) -> None:
    """Mean stresses alone carry such a constant pressure."""
    metal = VonMises(1e4, 0.3, math.sqrt(3))
    loads = [Pressure("top", 1.0), *(PorePressure(name, 0.3) for name in wet)]
    problem = square(*loads, material=metal)
    holds(proven(problem, shared_tmp_path), 2.0)


def test_wet_pores_in_space(shared_tmp_path: Path) -> None:
    """A cube of ground between smooth planes; the cone matches triaxial compression."""
    held = [Support(f"{axis}0", axis) for axis in "xyz"]
    loads = [Pressure("z1", 1.0), PorePressure("block", U)]
    problem = Problem(cube(1), {"block": MERIDIAN}, held, loads, degree=2)
    holds(proven(problem, shared_tmp_path), DRY - (N - 1) * U)


def test_a_pressure_that_is_not_linear_is_refused() -> None:
    problem = square(Pressure("top", 1.0), PorePressure("lower", "x**2"))
    with pytest.raises(InputError, match="'lower' is a formula"):
        limit_bounds(problem)


KINKED = "0.6*maximum(0, 0.55 + 0.3*abs(x - 0.7) - y)"


def wet_slope(read: Read, *more: Load) -> Problem:
    ground = DruckerPrager(1e4, 0.3, 0.1, 25.0, "plane-strain")
    weight = BodyForce("soil", (0.0, -1.0), constant=True)
    supports = [Support("bottom"), Support("left", "x")]
    mesh = read(write_slope, size=0.5)
    return Problem(mesh, {"soil": ground}, supports, [weight, *more], degree=2)


@pytest.mark.long
def test_kinks_in_cells_leave_bounds_strict(read: Read, shared_tmp_path: Path) -> None:
    """The lower bound uses a function above, the upper bound one below. Earlier it was refused."""
    problem = wet_slope(read, PorePressure("soil", KINKED))
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.strict, (bounds.lower.why_not, bounds.upper.why_not)
    assert "is bounded from above" in bounds.in_words()
    below, above = weaker_and_stronger(problem)
    assert [it.given.loads[1].side for it in (below, above)] == ["above", "below"]  # type: ignore[attr-defined]
    lower, upper = bounds.lower.value, bounds.upper.value
    assert lower is not None and upper is not None and lower < upper
    for it in (below, above):  # which function each bound would have from the user
        own = limit_bounds(it, 1e-3)
        assert own.strict
    dry = limit_bounds(wet_slope(read), 1e-3)
    assert lower < (dry.lower.value or 0.0)
    folder = ResultFolder(MPI.COMM_WORLD, shared_tmp_path)
    stress, velocity = proofs(bounds, bounds)
    for kind, pair in (("lower", (stress, None)), ("upper", (None, velocity))):
        write_proof(folder, folder.file(f"{kind}.h5"), *pair)
        half = check(folder.file(f"{kind}.h5"))[kind]
        assert not half.faults
        assert half.claimed == pytest.approx((lower if kind == "lower" else upper), rel=1e-8)
