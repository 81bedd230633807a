"""Test the Mohr–Coulomb and Tresca laws: projections on a pyramid with edges and an apex."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import InputError, MohrCoulomb, Tresca
from perfplast_fenicsx.arrays import matrices, vectors
from tests.materials.properties import Array, Point, check_all

pytestmark = pytest.mark.serial

MATERIALS = (
    MohrCoulomb(1e4, 0.3, 10.0, 20.0),
    MohrCoulomb(1e3, 0.499, 3.0, 1e-3),
    Tresca(1e4, 0.3, 10.0),
)


def principal(s: Array) -> Array:
    """Return the principal values in descending order, by a method that differs from the law's."""
    return np.linalg.eigvalsh(matrices(s))[::-1]


def overstress(s: Array, numbers: dict[str, float]) -> float:
    most, _, least = principal(s)
    sine = numbers["sine"]
    return float((1 + sine) * most - (1 - sine) * least - numbers["strength"])


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", MATERIALS)
def test_what_is_true_of_every_law(material: MohrCoulomb | Tresca, gdim: int) -> None:
    check_all(material, 0.3 * material.cohesion / material.shear, gdim)


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", MATERIALS)
def test_stress_is_the_nearest_admissible_one(material: MohrCoulomb | Tresca, gdim: int) -> None:
    """Faces, edges and apex satisfy the variational inequality of a projection."""
    point, numbers = Point(material, gdim=gdim), material.parameters()
    random = np.random.default_rng(3)
    size = point.size
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0] if gdim == 3 else np.eye(3)
    multiplicities = set()
    unit = material.cohesion / material.shear
    shapes = [(1, -1, 0), (1, 1, -2), (2, -1, -1), (1, -2, 1), (-1, -1, 2), (0, 0, 0)]
    shapes += [(1, -0.9, -1.1), (-0.1, 0.1, 0)]
    for trace in (-3.0, 0.0, 3.0, 300.0):
        for shape in shapes:
            for twist in (0.0, 1e-9, 1.0):
                tensor = unit * (3 * np.diag(shape) + trace * np.eye(3))
                tensor[0, 1] = tensor[1, 0] = twist * unit / math.sqrt(2)
                e = vectors(turn @ tensor @ turn.T)
                e = e if gdim == 3 else e[[0, 1, 2, 5]]
                stress, trial = point("stress", e), point("hooke", e)
                largest = material.cohesion + abs(trial).max()
                assert overstress(stress, numbers) <= 1e-12 * largest
                lost = point("compliance", trial - stress)
                tangent = np.array([point("tangent", e, d) for d in np.eye(size)])
                assert np.isfinite(tangent).all()
                if point("plastic", e)[0]:
                    assert overstress(stress, numbers) == pytest.approx(0, abs=1e-12 * largest)
                    gaps = np.diff(principal(stress)) > -1e-9 * largest
                    multiplicities.add(tuple(gaps.tolist()))
                else:
                    assert stress == pytest.approx(trial, abs=1e-12 * largest)
                for _ in range(10):
                    other = random.normal(size=size) * material.cohesion
                    other /= max(1.0, point.number("yield_ratio", other))
                    rounding = 1e-11 * (np.linalg.norm(other) + largest) * np.linalg.norm(lost)
                    assert (other - stress) @ lost <= rounding
    assert multiplicities >= {(False, False), (True, False), (False, True)}
    assert ((True, True) in multiplicities) == (numbers["sine"] > 0)


def test_tresca_is_the_limit_without_friction() -> None:
    ground, metal = (
        Point(material, gdim=2)
        for material in (MohrCoulomb(1e4, 0.3, 10.0, 1e-9), Tresca(1e4, 0.3, 10.0))
    )
    random = np.random.default_rng(2)
    for scale in (1e-4, 1e-3, 1e-2, 1.0):
        e, d = scale * random.normal(size=4), random.normal(size=4)
        assert ground("stress", e) == pytest.approx(metal("stress", e), rel=1e-7)
        assert ground("tangent", e, d) == pytest.approx(metal("tangent", e, d), rel=1e-6)


@pytest.mark.parametrize("angle", [0.0, -1.0, 90.0, math.nan])
def test_impossible_angles_are_named(angle: float) -> None:
    with pytest.raises(InputError, match="friction_angle"):
        MohrCoulomb(1.0, 0.3, 1.0, angle)


def test_cohesion_is_positive() -> None:
    with pytest.raises(InputError, match="cohesion = -1"):
        Tresca(1.0, 0.3, -1.0)
