"""Test the laws of plastic flow and hardening at a point: general properties, and known cycles."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import Elastic, Flow, Hardening, Hill, InputError, VonMises
from perfplast_fenicsx.materials import DruckerPrager, Material, MohrCoulomb, Tresca
from tests.materials.energy_cap import Foam
from tests.materials.properties import Array, Point, check_all, deviator, strains
from tests.models import STEEL

pytestmark = pytest.mark.serial

ISOTROPIC = Hardening(STEEL.young, STEEL.poisson, STEEL.yield_stress, isotropic=STEEL.young / 20)
KINEMATIC = Hardening(STEEL.young, STEEL.poisson, STEEL.yield_stress, kinematic=STEEL.young / 20)
BOTH = Hardening(STEEL.young, STEEL.poisson, STEEL.yield_stress, 2000.0, 5000.0)
YIELDS_AT = STEEL.yield_radius / (2 * STEEL.shear)


def history(size: int) -> dict[str, Array]:
    """Return a plastic strain whose size makes a body with hardening yield."""
    p = deviator(strains([3 * YIELDS_AT], size, seed=11)[0])
    return {"plastic_strain": p, "accumulated_plastic_strain": np.array(5 * YIELDS_AT)}


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", [ISOTROPIC, KINEMATIC, BOTH])
def test_hardening_in_a_single_step(material: Hardening, gdim: int) -> None:
    check_all(material, YIELDS_AT, gdim)


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("body", [STEEL, ISOTROPIC, KINEMATIC, BOTH])
def test_what_is_true_of_every_law(body: VonMises | Hardening, gdim: int) -> None:
    size = {2: 4, 3: 6}[gdim]
    old = history(size)
    grown, moved = 0.0, np.zeros(size)
    if isinstance(body, Hardening):
        grown = math.sqrt(2 / 3) * body.isotropic * float(old["accumulated_plastic_strain"])
        moved = 2 / 3 * body.kinematic * old["plastic_strain"]
    centre = old["plastic_strain"] + moved / (2 * STEEL.shear)
    yields_at = YIELDS_AT + grown / (2 * STEEL.shear)
    check_all(Flow(body), yields_at, gdim, old, centre)


@pytest.mark.parametrize("body", [STEEL, ISOTROPIC, KINEMATIC])
def test_the_first_step_is_that_of_hencky(body: VonMises | Hardening) -> None:
    virgin = {"plastic_strain": np.zeros(6), "accumulated_plastic_strain": np.array(0.0)}
    flowing, hencky = Point(Flow(body), old=virgin), Point(body)
    for e in strains([0.5 * YIELDS_AT, 7 * YIELDS_AT]):
        for name in ("stress", "potential", "plastic"):
            assert np.allclose(flowing(name, e), hencky(name, e), rtol=1e-12, atol=0)
        p, stress = flowing("plastic_strain", e), flowing("stress", e)
        assert np.allclose(p, e - flowing("compliance", stress), rtol=0, atol=1e-12 * abs(e).max())
        size = math.sqrt(2 / 3) * np.linalg.norm(p)
        assert flowing.number("accumulated_plastic_strain", e) == pytest.approx(size)


def test_a_step_inside_leaves_no_trace() -> None:
    old = history(6)
    point = Point(Flow(STEEL), old=old)
    e = old["plastic_strain"] + 0.9 * deviator(strains([YIELDS_AT])[0])
    for name, value in old.items():
        assert np.array_equal(point(name, e), np.ravel(value))


@pytest.mark.parametrize(
    ("isotropic", "kinematic", "named"),
    [
        (0.0, 0.0, "kinematic hardening are both zero"),
        (-1.0, 2.0, "isotropic = -1.0"),
        (1.0, math.inf, "kinematic = inf"),
    ],
)
def test_impossible_hardening_is_named(isotropic: float, kinematic: float, named: str) -> None:
    with pytest.raises(InputError, match=named):
        Hardening(2e5, 0.3, 400.0, isotropic, kinematic)


GROUND = (
    DruckerPrager(STEEL.young, 0.3, 200.0, 20.0, "compression"),
    MohrCoulomb(STEEL.young, 0.3, 200.0, 20.0),
    Tresca(STEEL.young, 0.3, 200.0),
)
ROLLED = Hill(STEEL.young, 0.3, 400.0, r33=1.6)


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("body", [*GROUND, ROLLED, Foam(STEEL.young, 0.3, 300.0, 100.0)])
def test_every_projection_has_its_flow(body: Material, gdim: int) -> None:
    size = {2: 4, 3: 6}[gdim]
    old = history(size)
    old["plastic_strain"] = old["plastic_strain"] + np.r_[np.full(3, 1e-4), np.zeros(size - 3)]
    flowing, hencky = Point(Flow(body), gdim=gdim, old=old), Point(body, gdim=gdim)
    for e in strains([0.1 * YIELDS_AT, 2 * YIELDS_AT, 20 * YIELDS_AT], size, seed=5):
        seen = e - old["plastic_strain"]
        stress = flowing("stress", e)
        assert np.allclose(
            stress, hencky("stress", seen), rtol=1e-12, atol=1e-12 * abs(stress).max()
        )
        p = flowing("plastic_strain", e)
        assert np.allclose(p, e - flowing("compliance", stress), rtol=0, atol=1e-12 * abs(e).max())
        grown = flowing.number("accumulated_plastic_strain", e)
        grown -= float(old["accumulated_plastic_strain"])
        assert grown == pytest.approx(
            math.sqrt(2 / 3) * np.linalg.norm(p - old["plastic_strain"]), abs=1e-12
        )
        # Fenchel: the step stores and dissipates the work of the stress minus its conjugate
        work = flowing.number("potential", e) + flowing.number("conjugate", stress)
        assert work == pytest.approx(float(stress @ e), rel=1e-12)
        # the stress maximises the work of the flow in the set, whose support function is the
        # dissipation
        flow = p - old["plastic_strain"]
        assert flowing.number("dissipation", flow) == pytest.approx(
            float(stress @ flow), rel=1e-9, abs=1e-12 * abs(work)
        )


def test_sheets_grow_thinner_as_they_flow() -> None:
    old = history(4)
    point = Point(Flow(STEEL).in_plane_stress(), gdim=2, old=old)
    e = np.array([30 * YIELDS_AT, 5 * YIELDS_AT, 0.0, 4 * YIELDS_AT])
    p, stress = point("plastic_strain", e), point("stress", e)
    assert abs(p[:3].sum()) < 1e-12 * abs(p).max() and stress[2] == 0
    elastic = e - point("compliance", stress)
    assert np.allclose(p[[0, 1, 3]], elastic[[0, 1, 3]], rtol=0, atol=1e-12 * abs(e).max())
    assert Flow(GROUND[0]).in_plane_stress() is None


def test_what_cannot_flow_is_refused() -> None:
    for body in (Elastic(2e5, 0.3), Flow(STEEL)):
        with pytest.raises(InputError, match=r"has no plastic strains"):
            Flow(body)
    assert isinstance(Flow(STEEL), Material)
    assert Flow(STEEL).expansion == STEEL.expansion
