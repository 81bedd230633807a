"""Test ground that dilates less than its friction angle: Radenkovic's pair, Davis' estimates."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from meshes.platens import write_platens
from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    DruckerPrager,
    InputError,
    MohrCoulomb,
    Newton,
    Pressure,
    Problem,
    Support,
    Tie,
    factor_of_safety,
    limit_bounds,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis import BodyBounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.body.safety_factor import times_in_words
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.materials.nonassociated_flow import associated, weaker
from perfplast_fenicsx.proof.checker import check
from tests.conftest import Read

COMM = MPI.COMM_WORLD
C, PHI, PSI = 10.0, 35.0, 10.0


def ground(stand: str | None, psi: float = PSI) -> MohrCoulomb:
    """Return ground with a dilatancy angle."""
    return MohrCoulomb(1e4, 0.3, C, PHI, dilatancy_angle=psi, nonassociated=stand)


def strength(of: MohrCoulomb) -> float:
    """Return the uniaxial compressive strength of associated ground, 2c tan(45° + φ/2)."""
    return 2 * of.cohesion * math.tan(math.radians(45 + of.friction_angle / 2))


def column(
    of: MohrCoulomb, pressure: Pressure, upper: MohrCoulomb | None = None, n: int = 1
) -> Problem:
    """Return a free block of this ground, of two glued blocks, or with another block on it."""
    return Problem(
        stacked_blocks(COMM, n),
        {"lower": of, "upper": upper or of},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [pressure],
        contacts=[Tie("lower_top", "upper_bottom")],
        degree=2,
    )


def proven(bounds: BodyBounds, path: Path) -> None:
    """Check the file, which names the kind of pair, with the checker. Collective."""
    folder = ResultFolder(COMM, COMM.bcast(path))
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    if COMM.rank == 0:
        checked = check(folder.file("bounds.h5"))
        assert not any(half.faults for half in checked.values())
        assert any(
            "Radenkovic's pair" in words for half in checked.values() for words in half.words
        )
    COMM.barrier()


@pytest.mark.mpi2
def test_a_block_by_radenkovic(tmp_path: Path) -> None:
    of = ground("radenkovic")
    bounds = limit_bounds(column(of, Pressure("top", 1.0)))
    assert bounds.strict
    low, high = strength(weaker(of)), strength(associated(of))
    assert bounds.lower.value == pytest.approx(low, rel=2e-4)
    assert bounds.upper.value == pytest.approx(high, rel=2e-4)
    assert bounds.lower.value <= low < high <= bounds.upper.value
    assert "Radenkovic's pair" in bounds.in_words()
    proven(bounds, tmp_path)


def test_a_footing_by_radenkovic(read: Read, tmp_path: Path) -> None:
    """Upper: N_c = 14.8347 c for φ = 20°; lower: 8.344926 c tan ψ/tan φ for ψ = 10°."""
    soil = DruckerPrager(
        1e3, 0.3, 1.0, 20.0, "plane-strain", dilatancy_angle=10.0, nonassociated="radenkovic"
    )
    footing = Problem(
        read(write_strip_footing, size=1.0),
        {"ground": soil},
        [Support("bottom"), Support("x0", "x"), Support("side", "x")],
        [Pressure("footing", 1.0)],
        degree=2,
    )
    bounds = limit_bounds(footing)
    assert bounds.strict
    low = 8.344926 * math.tan(math.radians(10)) / math.tan(math.radians(20))
    assert 0.6 * low < bounds.lower.value < low
    assert 14.834712 < bounds.upper.value < 1.2 * 14.834712
    proven(bounds, tmp_path)


@pytest.mark.long
def test_unlike_ground_on_two_meshes_is_no_pair(shared_tmp_path: Path) -> None:
    """The check compares the cones of both halves place by place, for any order of steepness."""
    softer, steeper = MohrCoulomb(1e4, 0.3, C, 20.0), MohrCoulomb(1e4, 0.3, C, 30.0)
    low, high = (limit_bounds(column(softer, Pressure("top", 1.0), steeper, n=n)) for n in (1, 2))
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(low, high))
    if COMM.rank == 0:
        checked = check(folder.file("bounds.h5"))
        assert not any(half.faults for half in checked.values())
        told = " ".join(words for half in checked.values() for words in half.words)
        assert "Radenkovic" not in told


@pytest.mark.long(but=["radenkovic"])
@pytest.mark.parametrize("stand", ["radenkovic", "davis-b"])
def test_factors_of_safety(stand: str, read: Read) -> None:
    """A free block under a constant pressure: its strength divided by F equals the pressure."""
    of, stays = ground(stand), 20.0
    block = Problem(
        read(write_platens, size=1.0, grading=1.0),
        {"block": of},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", stays, constant=True)],
        degree=2,
    )
    found = factor_of_safety(block, 1e-4)
    least = weaker if stand == "radenkovic" else associated
    sides = (found.lower, least, -1), (found.upper, associated, 1)
    for value, stands, sign in sides:
        assert value is not None
        assert strength(stands(of.divided_by(value))) == pytest.approx(stays, rel=1e-3)
        assert sign * (stays - strength(stands(of.divided_by(value)))) >= -1e-9 * stays
    name = "Radenkovic's pair" if stand == "radenkovic" else f"Davis' method {stand[-1].upper()}"
    assert name in found.in_words()
    assert found.estimate == (stand != "radenkovic")
    assert ("for certain" in found.in_words()) == (stand == "radenkovic")
    assert found.in_words().startswith("By Davis' estimate") == found.estimate
    assert found.stands is not None
    assert found.falls is not None
    line = times_in_words(1.0, found.stands.lower, found.falls.upper, 12, found.estimate)
    assert ("for certain" in line) == ("estimate" not in line) == (stand == "radenkovic")


def test_what_davis_reduces() -> None:
    """A reduces by β of the original ground, B and C by β of the reduced ground."""
    factor, tan = 1.4, lambda angle: math.tan(math.radians(angle))

    def beta(phi: float, psi: float) -> float:
        phi, psi = math.radians(phi), math.radians(psi)
        return math.cos(phi) * math.cos(psi) / (1 - math.sin(phi) * math.sin(psi))

    phi = math.degrees(math.atan(tan(PHI) / factor))
    psi = math.degrees(math.atan(tan(PSI) / factor))
    for stand, by in (
        ("davis-a", beta(PHI, PSI)),
        ("davis-b", beta(phi, psi)),
        ("davis-c", beta(phi, PSI)),
    ):
        found = associated(ground(stand).divided_by(factor))
        assert found.cohesion == pytest.approx(by * C / factor)
        assert tan(found.friction_angle) == pytest.approx(by * tan(PHI) / factor)
    first, second = (associated(ground(f"davis-{it}", 0.0).divided_by(1.2)) for it in "bc")
    assert first.cohesion == pytest.approx(second.cohesion)
    assert associated(ground("davis-a", PHI)).cohesion == pytest.approx(C)
    published = associated(ground("davis-a", 5.0).divided_by(1.2))
    assert published.cohesion == pytest.approx(7.158129, rel=1e-6)
    assert published.friction_angle == pytest.approx(26.620835, rel=1e-6)


def test_why_the_weaker_ground_is_one() -> None:
    """σ:ε ≥ c cot φ tr ε for σ at yield with φ and ε from the potential with ψ, at 10⁴ points."""
    rng, n = np.random.default_rng(7), 10_000
    sine, apex = math.sin(math.radians(PHI)), C / math.tan(math.radians(PHI))
    dilation = math.sin(math.radians(PSI))
    below = rng.uniform(0, 5 * C, n)  # −σ₁ from the apex
    first = -below
    third = first * (1 + sine) / (1 - sine)
    middle = third + (first - third) * rng.uniform(0, 1, n)
    at_edge = rng.choice(3, n)
    middle = np.choose(at_edge, [middle, first, third])
    stress = np.column_stack([first, middle, third]) + apex
    shares = rng.uniform(0, 1, (2, n)) * [at_edge == 1, at_edge == 2]
    rate = np.column_stack([1 + dilation + 0 * first, 0 * first, dilation - 1 + 0 * first])
    for share, flow in zip(
        shares, ([0, 1 + dilation, dilation - 1], [1 + dilation, dilation - 1, 0]), strict=True
    ):
        rate += share[:, None] * np.array(flow)
    power, least = (stress * rate).sum(axis=1), apex * rate.sum(axis=1)
    assert (power >= least - 1e-12 * np.abs(power)).all()


def test_nothing_else_is_known_of_it() -> None:
    problem = column(ground("radenkovic"), Pressure("top", 1.0))
    for asks in (Newton, interior_point):
        with pytest.raises(InputError, match="the ground of 'lower' has nonassociated ="):
            asks(problem)
    with pytest.raises(InputError, match="dilatancy_angle = 0"):
        ground("radenkovic", 0.0)
    with pytest.raises(InputError, match="give one, or remove nonassociated"):
        MohrCoulomb(1e4, 0.3, C, PHI, nonassociated="davis-a")
    with pytest.raises(InputError, match="nonassociated = 'davis' is unknown"):
        ground("davis")
