"""Test Hill's condition: potential, tangent, coefficients, axes, and refusals."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import Hill, InputError, VonMises
from tests.materials.properties import Point, check_all, strains

pytestmark = pytest.mark.serial

SHEET = Hill(2e5, 0.3, 450.0, 1.0, 0.953, 1.195, 0.8, 1.3, 1.1, 25.0)


@pytest.mark.parametrize("gdim", [2, 3])
def test_potential_tangent_and_conjugate(gdim: int) -> None:
    check_all(SHEET, 450.0 / (2 * SHEET.shear), gdim)


def test_equal_ratios_are_von_mises() -> None:
    ours, theirs = Point(Hill(2e5, 0.3, 450.0, angle=10.0)), Point(VonMises(2e5, 0.3, 450.0))
    for e in strains([1e-4, 1e-2, 1.0]):
        for name in ("stress", "yield_ratio", "dissipation", "potential"):
            assert np.allclose(ours(name, e), theirs(name, e), rtol=1e-11, atol=1e-11)


def test_coefficients_are_those_of_the_quadratic_form() -> None:
    """The test uses rotated axes, and tensors."""
    F, G, H, L, M, N = SHEET.coefficients
    c, s = math.cos(math.radians(25.0)), math.sin(math.radians(25.0))
    to_axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    for x in np.random.default_rng(0).normal(size=(20, 6)):
        whole = np.diag(x[:3])
        for place, (i, j) in zip((3, 4, 5), ((1, 2), (0, 2), (0, 1)), strict=True):
            whole[i, j] = whole[j, i] = x[place] / math.sqrt(2)
        t = to_axes @ whole @ to_axes.T
        form = F * (t[1, 1] - t[2, 2]) ** 2 + G * (t[2, 2] - t[0, 0]) ** 2
        form += H * (t[0, 0] - t[1, 1]) ** 2
        form += 2 * (L * t[1, 2] ** 2 + M * t[0, 2] ** 2 + N * t[0, 1] ** 2)
        ratio = Point(SHEET).number("yield_ratio", x)
        assert ratio == pytest.approx(math.sqrt(form) / 450.0, rel=1e-12)


def test_ratios_are_of_tension_and_shear() -> None:
    plain = Hill(2e5, 0.3, 450.0, 1.1, 0.9, 1.2, 0.8, 1.3, 0.7)
    point = Point(plain)
    for i, ratio in enumerate((1.1, 0.9, 1.2)):
        assert point.number("yield_ratio", 450.0 * ratio * np.eye(6)[i]) == pytest.approx(1)
    for i, ratio in zip((3, 4, 5), (0.7, 1.3, 0.8), strict=True):
        shear = math.sqrt(2) * ratio * 450.0 / math.sqrt(3)
        assert point.number("yield_ratio", shear * np.eye(6)[i]) == pytest.approx(1)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e4])
def test_it_returns_to_the_surface(scale: float) -> None:
    """This holds far outside the surface, and for strengths of very different size."""
    for material in (SHEET, Hill(2e5, 0.3, 450.0, r12=3.0, r13=1 / 3)):
        point = Point(material)
        for e in strains([scale] * 5, seed=int(scale * 100)):
            ratio = point.number("yield_ratio", point("stress", e))
            assert ratio == pytest.approx(1, rel=max(1e-12, 1e-13 * scale))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"r11": 0.0}, "r11 = 0.0 is not a positive number"),
        ({"r23": math.nan}, "r23 = nan is not a positive number"),
        ({"angle": math.inf}, "angle = inf is not finite"),
        ({"r11": 0.5, "r22": 2.0, "r33": 2.0}, "r33 = 2.0"),
        ({"yield_stress": -1.0}, "yield_stress = -1.0"),
        ({"poisson": 0.5}, "poisson"),
    ],
)
def test_refused(change: dict[str, float], words: str) -> None:
    numbers = {"young": 2e5, "poisson": 0.3, "yield_stress": 450.0} | change
    with pytest.raises(InputError, match=words):
        Hill(**numbers)


def test_reduced_strength() -> None:
    assert SHEET.divided_by(2.0).yield_stress == 225.0
    assert SHEET.divided_by(2.0).coefficients == SHEET.coefficients
