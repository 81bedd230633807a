"""Test the checker's parabola: gauge and dissipation by sampling, and forgeries."""

import re
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.conic import parabolas
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.proof.cones import Cones
from perfplast_fenicsx.proof.parabola import GENTLEST
from tests.limit_analysis.test_hoek_brown import ROCK
from tests.limit_analysis.test_tension_cut_off import block
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    alone,
    both,
    drop,
    high,
    make,
    put,
    said_of_forged,
    times,
    written,
)

pytestmark = pytest.mark.serial

AT = np.zeros(1, dtype=np.int64)
NONE = np.array([np.nan])


def rock() -> Cones:
    """Return the cone of a rock, as from a file."""
    bound, curvature = np.array([ROCK.tension]), np.array([ROCK.curvature])
    return Cones(bound, np.zeros((1, 3)), np.zeros((1, 3, 3)), NONE, NONE, curvature)


def test_strict_mechanisms_dilate_as_the_checker_asks() -> None:
    assert parabolas.GENTLEST >= GENTLEST


def test_gauge_is_convex_and_has_the_weakness() -> None:
    cones, random = rock(), np.random.default_rng(0)
    cones.check(3)
    one, other = random.normal(size=(2, 1, 2000, 3)) * np.geomspace(1e-3, 1e3, 2000)[:, None]
    sums = cones.ratios(AT, one) + cones.ratios(AT, other)
    assert (cones.ratios(AT, one + other) <= sums * (1 + 1e-12)).all()
    most = cones.weakness[0] * np.linalg.norm(one, axis=2)
    assert (cones.ratios(AT, one) <= most).all()
    assert cones.ratios(AT, 2 * one) == pytest.approx(2 * cones.ratios(AT, one), rel=1e-12)


def test_stresses_of_ratio_one_are_those_of_the_criterion() -> None:
    cones, random = rock(), np.random.default_rng(1)
    stress = random.normal(size=(1, 500, 3)) - np.array([3.0, 3.0, 0.0])
    stress /= cones.ratios(AT, stress)[..., None]
    tensors = np.zeros((500, 2, 2))
    tensors[:, 0, 0], tensors[:, 1, 1] = stress[0, :, 0], stress[0, :, 1]
    tensors[:, 0, 1] = tensors[:, 1, 0] = stress[0, :, 2] / np.sqrt(2)
    least, most = np.linalg.eigvalsh(tensors).T
    ci = ROCK.compressive_strength
    assert (most - least) ** 2 == pytest.approx(ci * (ROCK.s * ci - ROCK.m_b * most), rel=1e-8)


def test_dissipation_by_sampling() -> None:
    """Compare with the largest work of stresses on the surface, and with the Lipschitz constant."""
    cones, random = rock(), np.random.default_rng(2)
    stress = random.normal(size=(1, 200_000, 3)) - random.exponential(3, (200_000, 1)) * [1, 1, 0]
    stress /= cones.ratios(AT, stress)[..., None]
    for growth in (0.2, 0.5, 0.9, 1.3):
        rate = np.array([[[growth / 2 + 0.3, growth / 2 - 0.3, 0.8 / np.sqrt(2)]]])
        power = cones.principal_power(AT, rate)[0, 0]
        sampled = (stress[0] @ rate[0, 0]).max()
        assert power * (1 - 5e-3) < sampled <= power * (1 + 1e-12)
        assert cones.short(AT, rate)[0, 0] < 0
    one, step = random.normal(size=(2, 1, 5000, 3))
    step *= np.geomspace(1e-6, 1.0, 5000)[:, None]
    change = cones.principal_power(AT, one + step) - cones.principal_power(AT, one)
    sizes = np.linalg.norm(step, axis=2)
    assert (np.abs(change) <= cones.steepness[0] * sizes * (1 + 1e-9)).all()
    lacks = cones.short(AT, one + step) - cones.short(AT, one)
    assert (np.abs(lacks) <= cones.alertness[0] * sizes * (1 + 1e-9)).all()
    shear = np.array([[[0.5 + GENTLEST / 4, -0.5 + GENTLEST / 4, 0.0]]])
    assert cones.short(AT, shear)[0, 0] == pytest.approx(GENTLEST / 2)


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return a rock block, from the program."""
    path = tmp_path_factory.mktemp("parabola")
    found = written(path, limit_bounds(block(ROCK)))
    words = check(path / "bounds.h5")["lower"].words[0]
    assert "strength: (σ₁ − σ₃)² at most 30 times (0.133333 − σ₁)" in words
    return found


def divided(them: Arrays) -> None:
    """Divide the strength by F."""
    them["strength_factor"] = np.array(2.0)


FORGED: dict[str, tuple[Forgery, str]] = {
    "none at all": (both(drop("cone_curvature")), "more than one stress free"),
    "one too few": (both(make("cone_curvature", lambda a: a[1:])), "the shape of"),
    "straight": (both(put("cone_curvature", 0, 0.0)), "not positive"),
    "infinite": (both(put("cone_curvature", 0, np.inf)), "not positive"),
    "bent beyond rounding": (both(times("cone_curvature", 1e13)), "differs too much"),
    "with a slope": (both(put("cone_slope", (0, 0), 0.1)), "has a slope or a matrix"),
    "with a sine": (both(put("cone_sine", 0, 0.5)), "with a sine|has a slope"),
    "with a tension": (both(put("cone_tension", 0, 0.1)), "does not bound principal"),
    "weaker": (both(times("cone_bound", 0.99)), "times as large"),
    "bent more": (both(times("cone_curvature", 0.99)), "times as large"),
    "a higher bound": (alone("lower", times("bound", 1.001)), "proven"),
    "a lower bound": (alone("upper", times("bound", 0.999)), "proven"),
    "wider above": (high(times("cone_curvature", 0.99)), "other shapes|only"),
    "divided": (both(divided), "not a parabola"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_parabola_is_refused(name: str, honest: Halves, tmp_path: Path) -> None:
    forge, words = FORGED[name]
    assert re.search(words, said_of_forged(honest, forge, tmp_path))
