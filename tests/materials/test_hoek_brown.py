"""Test the Hoek–Brown law in plane strain: projection, yield set, and rock parameters."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx import InputError
from perfplast_fenicsx.materials import HoekBrown
from tests.materials.properties import Array, Point, check_all

pytestmark = pytest.mark.serial

ROCK = HoekBrown(1e4, 0.25, compressive_strength=20.0, m_b=1.5, s=0.01)


def mohr(s: Array) -> tuple[float, float]:
    """Return mean and radius of Mohr's circle of in-plane stresses or rates."""
    return (s[0] + s[1]) / 2, math.hypot((s[0] - s[1]) / 2, s[3] / math.sqrt(2))


def boundary(radius: float) -> float:
    """Return the mean stress at which this radius yields, by the published criterion."""
    low, high = -1e4, ROCK.s * ROCK.compressive_strength / ROCK.m_b
    for _ in range(100):
        middle = (low + high) / 2
        pressure = -(middle + radius)  # the smallest principal pressure
        strength = ROCK.m_b * ROCK.compressive_strength * pressure
        strength += ROCK.s * ROCK.compressive_strength**2
        admissible = strength >= 0 and 2 * radius <= math.sqrt(strength)
        low, high = (middle, high) if admissible else (low, middle)
    return low


@cache
def on_boundary(count: int = 60) -> Array:
    """Return mean and radius of stresses on the boundary, shape (1 + count, 2)."""
    radii = np.concatenate([[0.0], np.geomspace(1e-3, 100.0, count)])
    return np.array([(boundary(float(radius)), radius) for radius in radii])


def stresses() -> list[Array]:
    """Return stresses on the boundary, in some directions."""
    found = []
    for p, radius in on_boundary():
        for angle in np.linspace(0, 2 * math.pi, 9):
            half, shear = radius * math.cos(angle), math.sqrt(2) * radius * math.sin(angle)
            found.append(np.array([p + half, p - half, 0.0, shear]))
    return found


def test_what_is_true_of_every_law() -> None:
    check_all(ROCK, 0.13 * ROCK.tension / 4e3, gdim=2)


def test_stress_is_the_nearest_admissible_one() -> None:
    """Random strains satisfy the variational inequality, on the parabola and at its apex."""
    point, random, apexes = Point(ROCK, gdim=2), np.random.default_rng(5), 0
    others = stresses()[::7]
    for scale in np.geomspace(1e-5, 1e-1, 60):
        e = scale * random.normal(size=4)
        stress, trial = point("stress", e), point("hooke", e)
        p, radius = mohr(stress)
        assert radius**2 <= ROCK.curvature * (ROCK.tension - p - radius) + 1e-9 * (1 + radius**2)
        lost = point("compliance", trial - stress)
        assert abs(lost[2]) <= 1e-12 * scale  # no out-of-plane flow
        work = [float((other - stress) @ lost) for other in others]
        assert max(work) <= 1e-9 * np.linalg.norm(lost) * (1 + np.linalg.norm(stress))
        apexes += radius == 0
    assert 0 < apexes < 40


def test_gauge_and_support_are_those_of_the_published_criterion() -> None:
    point, table = Point(ROCK, gdim=2), np.array(stresses())
    for stress in table[::11]:
        assert point.number("yield_ratio", stress) == pytest.approx(1.0, rel=1e-9)
    random = np.random.default_rng(3)
    for _ in range(30):
        rate = random.normal(size=4)
        rate[2] = 0.0
        rate[:2] += mohr(rate)[1] * random.uniform(0.15, 1.2) - mohr(rate)[0]
        power = point.number("dissipation", rate)
        assert (table @ rate).max() <= power * (1 + 1e-9)
        sampled = (on_boundary(600) @ (2 * np.array(mohr(rate)))).max()
        assert power == pytest.approx(sampled, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "value"), [("m_b", 0.0), ("s", 1.5), ("s", 0.0), ("compressive_strength", -1.0)]
)
def test_a_number_out_of_range_is_named(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=rf"{name} = {value}"):
        replace(ROCK, **{name: value})
