"""Test the Drucker–Prager law: projection on a cone with an apex, and parameters."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import DruckerPrager, InputError, VonMises
from tests.materials.properties import Array, Point, check_all, deviator

pytestmark = pytest.mark.serial

CLAY = DruckerPrager(1e4, 0.3, 10.0, 20.0, "compression")
DENSE = DruckerPrager(1e5, 0.2, 1.0, 42.0, "plane-strain")
NEARLY_INCOMPRESSIBLE = DruckerPrager(1e3, 0.499, 3.0, 5.0, "extension")
MATERIALS = (CLAY, DENSE, NEARLY_INCOMPRESSIBLE)


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", MATERIALS)
def test_what_is_true_of_every_law(material: DruckerPrager, gdim: int) -> None:
    _, strength = material.cone
    check_all(material, strength / (math.sqrt(2) * material.shear), gdim)


@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("material", MATERIALS)
def test_stress_is_the_nearest_admissible_one(material: DruckerPrager, size: int) -> None:
    """Each branch satisfies the variational inequality of a projection."""
    point = Point(material, gdim=size // 2 if size == 4 else 3)
    random = np.random.default_rng(3)
    slope, strength = material.cone
    seen = set()
    for trace in (-3.0, -0.1, 0.02, 0.3, 3.0):
        for deviatoric in (0.0, 1e-9, 0.3, 2.0):
            e = deviator(random.normal(size=size))
            e *= deviatoric / np.linalg.norm(e)
            e[:3] += trace / 3
            e *= strength / material.shear
            stress, trial = point("stress", e), point("hooke", e)
            assert excess(stress, slope, strength) <= 1e-12 * strength + 1e-13 * abs(trial).max()
            lost = point("compliance", trial - stress)
            seen.add((bool(point("plastic", e)[0]), bool(np.allclose(deviator(stress), 0))))
            assert np.isfinite([point("tangent", e, d) for d in np.eye(size)]).all()
            for _ in range(20):
                other = random.normal(size=size) * strength
                other /= max(1.0, point.number("yield_ratio", other))
                assert (other - stress) @ lost <= 1e-12 * np.abs(other - stress) @ np.abs(lost)
    assert seen >= {(False, False), (True, False), (True, True)}


@pytest.mark.parametrize("material", MATERIALS)
def test_dissipation_is_the_largest_power(material: DruckerPrager) -> None:
    point = Point(material)
    slope, strength = material.cone
    random = np.random.default_rng(5)
    rate = deviator(random.normal(size=6))
    rate[:3] += math.sqrt(2) * slope * np.linalg.norm(rate) / 3 * 1.3
    power = point.number("dissipation", rate)
    for _ in range(200):
        stress = random.normal(size=6) * strength
        stress /= point.number("yield_ratio", stress) or 1.0
        assert stress @ rate <= power * (1 + 1e-12)
    assert point("stress", 1e3 * rate) @ rate == pytest.approx(power)


def test_without_friction_it_is_von_mises() -> None:
    """As the friction angle vanishes, the law tends to von Mises' law, with its shear strength."""
    cohesion = 7.0
    rough = Point(DruckerPrager(1e4, 0.3, cohesion, 1e-9, "plane-strain"))
    smooth = Point(VonMises(1e4, 0.3, math.sqrt(3) * cohesion))
    random = np.random.default_rng(2)
    for scale in (1e-4, 1e-3, 1e-2, 1.0):
        e, d = scale * random.normal(size=6), random.normal(size=6)
        for name in ("stress", "potential", "yield_ratio"):
            assert rough(name, e) == pytest.approx(smooth(name, e), rel=1e-6)
        assert rough("tangent", e, d) == pytest.approx(smooth("tangent", e, d), rel=1e-5)


def test_constants_are_those_of_mohr_and_coulomb_where_they_match() -> None:
    """Uniaxial compressive strength agrees; in extension, σ₁ = σ₂ > σ₃ = 0 with reversed signs."""
    cohesion, angle = 10.0, 30.0
    strong = 2 * cohesion * math.cos(math.radians(angle)) / (1 - math.sin(math.radians(angle)))
    outer = DruckerPrager(1e4, 0.3, cohesion, angle, "compression")
    uniaxial = np.array([0, 0, -strong, 0, 0, 0])
    assert excess(uniaxial, *outer.cone) == pytest.approx(0, abs=1e-12)
    inner = DruckerPrager(1e4, 0.3, cohesion, angle, "extension")
    assert excess(np.array([-strong, -strong, 0, 0, 0, 0]), *inner.cone) == pytest.approx(
        0, abs=1e-12
    )
    plane = DruckerPrager(1e4, 0.3, cohesion, angle, "plane-strain")
    slope, strength = plane.cone
    # with the best σ_zz a state reaches the Mohr–Coulomb circle, and no σ_zz passes it
    s = math.sin(math.radians(angle))
    p = -12.0
    radius = cohesion * math.cos(math.radians(angle)) - p * s
    out = [
        excess(np.array([p + radius, p - radius, z, 0, 0, 0]), slope, strength)
        for z in np.linspace(p - 2 * radius, p + 2 * radius, 4001)
    ]
    assert min(out) == pytest.approx(0, abs=1e-5 * radius)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"cohesion": -1.0}, "cohesion = -1.0"),
        ({"friction_angle": 0.0}, "friction_angle = 0.0"),
        ({"friction_angle": 90.0}, "friction_angle = 90.0"),
        ({"friction_angle": math.nan}, "friction_angle = nan"),
        ({"match": "middle"}, "match = 'middle'"),
        ({"young": -1.0}, "young = -1.0"),
    ],
)
def test_impossible_constants_are_named(change: dict, named: str) -> None:
    given = {"young": 1.0, "poisson": 0.3, "cohesion": 1.0, "friction_angle": 30.0}
    with pytest.raises(InputError, match=named):
        DruckerPrager(**(given | {"match": "compression"} | change))


def test_sand_has_no_cohesion_but_friction() -> None:
    sand = DruckerPrager(1.0, 0.3, cohesion=0.0, friction_angle=30.0, match="compression")
    assert sand.cohesion == 0.0


def excess(stress: Array, slope: float, strength: float) -> float:
    """Return ‖dev σ‖/√2 + ηp − c."""
    size = np.linalg.norm(deviator(stress)) / math.sqrt(2)
    return float(size + slope * stress[:3].mean() - strength)
