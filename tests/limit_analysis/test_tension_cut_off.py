"""Test bodies with a tensile strength: limit loads, strict bounds and their proofs."""

import math
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    BodyForce,
    MohrCoulomb,
    Newton,
    Pressure,
    Problem,
    Support,
    Tresca,
    load_path,
)
from perfplast_fenicsx.io.results.proof_file import judge
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from tests.limit_analysis.test_principal_cones import COMM, assert_proven, column
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read

GROUND = MohrCoulomb(1e4, 0.3, 20.0, 25.0, tensile_strength=5.0)
WEAK = Tresca(1e4, 0.3, 20.0, tensile_strength=0.02)
FAR_APART = Tresca(1e4, 0.2, 1e7, tensile_strength=1.0)
SLOPE = (1 + math.sin(math.radians(25))) / (1 - math.sin(math.radians(25)))


def block(material: Any, sign: float = 1.0, lateral: float = 0.0) -> Problem:
    """Return a unit square on rollers: ζ presses or pulls on top, with a lateral pressure."""
    surfaces: dict[str, Any] = {
        "x0": lambda x: x[0] < 1e-9,
        "y0": lambda x: x[1] < 1e-9,
        "x1": lambda x: x[0] > 1 - 1e-9,
        "top": lambda x: x[1] > 1 - 1e-9,
    }
    mesh = rectangle((1, 1), (1.0, 1.0), {"block": lambda x: x[1] < 2}, surfaces)
    loads = [Pressure("top", sign)]
    loads += [Pressure("x1", lateral, constant=True)] if lateral else []
    supports = [Support("x0", "x"), Support("y0", "y")]
    return Problem(mesh, {"block": material}, supports, loads, degree=2)


@pytest.mark.parametrize(
    ("material", "sign", "lateral", "exact"),
    [
        (GROUND, 1, 10.0, 40 * math.sqrt(SLOPE) + 10 * SLOPE),
        (GROUND, 1, -2.0, 40 * math.sqrt(SLOPE) - 2 * SLOPE),
        (GROUND, -1, 10.0, 5.0),
        (WEAK, 1, 10.0, 50.0),
        (WEAK, -1, 0.0, 0.02),
        (FAR_APART, -1, 0.0, 1.0),
    ],
)
def test_a_block(
    shared_tmp_path: Path, material: Any, sign: int, lateral: float, exact: float
) -> None:
    """In tension σ₁ ≤ f; in compression the tensile strength has no effect."""
    bounds = limit_bounds(block(material, sign, lateral))
    assert bounds.strict
    assert bounds.lower.value is not None and bounds.upper.value is not None
    assert bounds.lower.value <= exact * (1 + 1e-9)
    assert exact <= bounds.upper.value * (1 + 1e-9)
    assert bounds.upper.value - bounds.lower.value <= 3e-4 * exact + 1e-4
    folder = ResultFolder(COMM, shared_tmp_path)
    low, high = judge(folder, folder.file("bounds.h5"), bounds, bounds)
    assert low.lower.strict and high.upper.strict
    # With strengths 1e7 apart, rounding of the mechanism costs 6e-6 of the bound.
    assert high.upper.value == pytest.approx(bounds.upper.value, rel=1e-5)


@pytest.mark.parametrize(("sign", "exact"), [(-1.0, 5.0), (1.0, 40 * math.sqrt(SLOPE))])
def test_a_block_in_space(shared_tmp_path: Path, sign: float, exact: float) -> None:
    bounds = limit_bounds(column(GROUND, GROUND, Pressure("top", sign)))
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(exact, rel=1e-4)
    assert bounds.upper.value == pytest.approx(exact, rel=1e-4)
    assert_proven(bounds, shared_tmp_path)


def test_a_bar_by_newton() -> None:
    """A bar that is also pulled at its sides carries exactly f."""
    problem = block(GROUND, -1.0, 0.0)
    for level in load_path(Newton(problem), [4.0, 4.99]):
        assert level.report.duality_gap < 1e-6


def test_rings_have_a_limit_load_of_the_mesh() -> None:
    """A solid cylinder under axial tension carries f."""
    surfaces: dict[str, Any] = {
        "y0": lambda x: x[1] < 1e-9,
        "top": lambda x: x[1] > 1 - 1e-9,
    }
    mesh = rectangle((2, 2), (1.0, 1.0), {"block": lambda x: x[1] < 2}, surfaces).turned()
    loads = [Pressure("top", -1.0)]
    problem = Problem(mesh, {"block": GROUND}, [Support("y0", "y")], loads, degree=2)
    found = interior_point(problem)
    assert found.lower == pytest.approx(5.0, rel=1e-4)
    assert found.upper == pytest.approx(5.0, rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_a_vertical_cut(read: Read, angle: float) -> None:
    """With f = 0 it is stable up to γH = 2c tan(45° + φ/2) (D. C. Drucker, W. Prager, 1952)."""
    exact = 2 * math.tan(math.radians(45 + angle / 2))
    without = {0.0: 3.83, 20.0: 5.51}[angle]  # log spirals
    tension = 1e-3
    ground: Any = Tresca(1e4, 0.3, 1.0, tensile_strength=tension)
    if angle:
        ground = MohrCoulomb(1e4, 0.3, 1.0, angle, tensile_strength=tension)
    problem = Problem(
        read(write_vertical_cut, size=0.5),
        {"ground": ground},
        [Support("bottom"), Support("sides", "x")],
        [BodyForce("ground", (0.0, -1.0))],
        degree=2,
    )
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.strict
    assert bounds.lower.value is not None and bounds.upper.value is not None
    assert 0.8 * exact < bounds.lower.value < bounds.upper.value
    assert exact < bounds.upper.value < 0.9 * without


@pytest.mark.mpi2
def test_ranks_agree() -> None:
    """Bounds agree also in units of 1e-6."""
    small = Tresca(1e-2, 0.3, 20e-6, tensile_strength=5e-6)
    bounds = limit_bounds(block(small, -1.0, 0.0))
    assert MPI.COMM_WORLD.allgather(bounds.strict) == [True] * MPI.COMM_WORLD.size
    assert bounds.lower.value == pytest.approx(5e-6, rel=1e-4)
    assert bounds.upper.value == pytest.approx(5e-6, rel=1e-4)
