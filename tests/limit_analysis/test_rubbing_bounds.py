"""Test strict bounds with friction: Tresca friction, and Drucker's pair for Coulomb friction."""

import math

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    Elastic,
    Plane,
    Pressure,
    Problem,
    Support,
    Traction,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.limit_analysis import BodyBounds, strict_upper_bound
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import STEEL

COMM = MPI.COMM_WORLD
K = STEEL.yield_stress / math.sqrt(3)
PLATEN = Elastic(young=206900e3, poisson=0.29)
ROUGH = 2.42768
"""Mean pressure over k on a block twice as wide as high, between rough platens."""


def between_platens(n: int, **friction: float) -> Problem:
    """Return a quarter of such a block, with the platen as a separate body."""
    mesh = blocks_apart(COMM, (2 * n, n), (2 * n, n // 2), moved_by=0.0)
    mesh.mesh.geometry.x[:, 0] *= 2
    return Problem(
        mesh,
        {"lower": STEEL, "upper": PLATEN},
        [Support("x0", "x"), Support("upper_x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


def pushed(n: int, slope: float = 0.0, gdim: int = 2, **friction: float) -> Problem:
    """Return a block that a constant pressure of 10 presses on another block, pushed aside."""
    return Problem(
        blocks_apart(COMM, [n] * gdim, [n] * gdim, moved_by=0.0, slope=slope),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [
            Pressure("top", 10.0, constant=True),
            Traction("top", (1.0, 0.0) if gdim == 2 else (0.8, 0.6, 0.0)),
        ],
        [Contact("lower_top", "upper_bottom", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


def both(bounds: BodyBounds, rel: float = 1e-6) -> tuple[float, float]:
    """Return both strict bounds, whose gap equals the sum of the shares."""
    assert bounds.strict
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert bounds.shares is not None
    gap = bounds.upper.value - bounds.lower.value
    shares = COMM.allreduce(float(bounds.shares.sum()))
    assert shares == pytest.approx(gap, rel=rel)
    return bounds.lower.value, bounds.upper.value


@pytest.mark.long
def test_rubbing_platens() -> None:
    """The load increases with friction, from smooth to rough platens."""
    smooth = limit_bounds(between_platens(4))
    assert smooth.lower.value == pytest.approx(2 * K, rel=1e-4)
    found = [both(limit_bounds(between_platens(4, tresca=m * K))) for m in (0.3, 0.6, 1.0, 1.5)]
    lower, upper = np.array(found).T / K
    assert (np.diff(lower) > -1e-4).all()
    assert (np.diff(upper) > 0).all()
    assert 2.17 < lower[0] < upper[0] < 2.26
    assert 2.29 < lower[2] < ROUGH < upper[2] < 2.51
    assert lower[3] == pytest.approx(lower[2], rel=1e-4)  # the block yields
    none = limit_bounds(between_platens(4, tresca=0.0))
    assert none.lower.value == pytest.approx(smooth.lower.value, rel=1e-4)
    assert none.upper.value == pytest.approx(smooth.upper.value or 0.0, rel=1e-4)


@pytest.mark.mpi2
def test_a_block_that_slides_in_space() -> None:
    """For friction in any direction the whole seam slips, at τ̄ over the shear traction.

    The checker proves a better upper bound than the one whose gap the shares divide.
    """
    problem = Problem(
        blocks_apart(COMM, [2] * 3, [2] * 3, moved_by=0.0),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [Traction("top", (0.2, 0.15, -1.0))],
        [Contact("lower_top", "upper_bottom", tresca=0.02 * K)],
        degree=2,
    )
    bounds = limit_bounds(problem, 1e-3)
    lower, upper = bounds.lower.value, bounds.upper.value
    found = strict_upper_bound(bounds.problem, bounds.mechanism).value
    assert bounds.strict and bounds.shares is not None
    assert lower is not None and upper is not None and found is not None
    shares = COMM.allreduce(float(bounds.shares.sum()))
    assert shares == pytest.approx(found - lower, rel=1e-6)
    assert upper < found
    exact = 0.02 * K / 0.25
    assert exact * (1 - 1e-3) < lower <= exact * (1 + 1e-9)
    assert exact * (1 - 1e-9) <= upper < exact * (1 + 1e-3)


@pytest.mark.long
def test_a_rough_floor() -> None:
    """A plane with friction has the same bounds as a platen that is a body."""
    mesh = rectangle(
        (8, 6),
        (2.0, 1.5),
        {"block": lambda x: x[1] < 1, "platen": lambda x: x[1] > 1},
        {
            "x0": lambda x: x[0] < 1e-9,
            "y0": lambda x: x[1] < 1e-9,
            "top": lambda x: x[1] > 1.5 - 1e-9,
        },
    )
    found = []
    for m in (0.0, 0.3):
        floor = Plane("y0", (0.0, 0.0), (0.0, 1.0), tresca=m * K, name="floor")
        problem = Problem(
            mesh,
            {"block": STEEL, "platen": PLATEN},
            [Support("x0", "x")],
            [Pressure("top", 1.0)],
            obstacles=[floor],
            degree=2,
        )
        found.append(both(limit_bounds(problem)))
    (_, smooth), (lower, upper) = found
    assert smooth < lower < upper < 1.06 * lower


@pytest.mark.long(but=["0.0"])
@pytest.mark.parametrize("adhesion", [0.0, 1.0])
def test_drucker_of_a_block_that_slides(adhesion: float) -> None:
    """The upper bound is statics, μN + cA; the lower bound is the adhesion alone, if any."""
    bounds = limit_bounds(pushed(4, coulomb=0.3, tresca=adhesion), 1e-6)
    assert bounds.upper.strict
    assert bounds.lower.strict == (adhesion > 0)
    assert bounds.upper.value == pytest.approx(3.0 + adhesion, rel=1e-6)
    if bounds.lower.value is not None:
        assert 0.5 * adhesion < bounds.lower.value <= adhesion
    words = bounds.in_words()
    assert "Drucker's pair" in words


@pytest.mark.long(but=["0.2"])
@pytest.mark.parametrize("slope", [0.1, 0.2, -0.3])
def test_drucker_up_and_down_a_slope(slope: float) -> None:
    """Statics gives (tan α + μ)/(1 − μ tan α) of the weight, with adhesion along the seam."""
    mu, c = 0.2, 0.3  # with larger values it tips
    bounds = limit_bounds(pushed(3, slope, coulomb=mu, tresca=c), 1e-6)
    # along the seam: H cos α − V sin α = c l + μ (V cos α + H sin α) with l = 1/cos α
    angle = math.atan(slope)
    exact = 10 * math.sin(angle) + mu * 10 * math.cos(angle) + c / math.cos(angle)
    exact /= math.cos(angle) - mu * math.sin(angle)
    assert bounds.upper.strict
    assert bounds.upper.value == pytest.approx(exact, rel=1e-6)


@pytest.mark.long
def test_a_path_knows_adhesion_beside_friction() -> None:
    """Statics, μN + cA, by the iteration for Coulomb friction."""
    path = limit_load(pushed(2, coulomb=0.3, tresca=1.0), 1e-5)
    assert path.lower == pytest.approx(4.0, rel=2e-5)
    assert path.upper is not None
    assert path.lower < path.upper < 4.0 * (1 + 2e-5)


@pytest.mark.long
@pytest.mark.serial
def test_the_path_lies_between_druckers_pair() -> None:
    """Block between platens with Coulomb friction: frictionless ≤ path ≤ associated ≤ glued."""
    problem = between_platens(2, coulomb=0.1)
    smooth, (lower, upper) = limit_bounds(between_platens(2)), both(limit_bounds(problem))
    assert lower == pytest.approx(smooth.lower.value, rel=1e-6)
    path = limit_load(problem, 1e-3)
    assert lower < path.lower
    assert path.upper is not None
    assert path.lower < upper
    glued = both(limit_bounds(between_platens(2, tresca=10 * K)))
    assert upper < glued[1]


@pytest.mark.long
def test_coulomb_in_space_is_bounded_as_if_nothing_slipped() -> None:
    bounds = limit_bounds(pushed(2, gdim=3, coulomb=0.3), 1e-3)
    assert bounds.upper.strict
    assert bounds.upper.value is not None
    assert bounds.upper.value > 3.0
