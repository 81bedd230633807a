"""Test metal in plane stress: the projection in the plane, and the 3D projection at σ_zz = 0."""

import numpy as np
import pytest

from perfplast_fenicsx import DruckerPrager, Elastic, Hill, VonMises
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import in_plane_stress
from perfplast_fenicsx.materials.sheet import Sheet
from tests.materials.plain_projections import Array, hooke, quadratic
from tests.materials.properties import Point
from tests.materials.test_projections import Many, of_space, strains

pytestmark = pytest.mark.serial

EXACT = 1e-12
PLANE, SPACE = [0, 1, 3], [0, 1, 5]
"""In-plane components of vectors of four and six."""

STEEL = VonMises(2e5, 0.3, 240.0)
ROLLED = Hill(2e5, 0.45, 240.0, 1.0, 0.9, 1.2, 0.8, angle=25.0)


def form_of(material: VonMises | Hill) -> Array:
    """Return P in 3D, shape (6, 6)."""
    return of_space(material if isinstance(material, Hill) else Hill(2e5, 0.3, 240.0))


@pytest.mark.parametrize("material", [STEEL, ROLLED])
def test_sheets_are_projections_in_the_plane_and_in_space(material: VonMises | Hill) -> None:
    """The test has 10⁵ points; ε_zz does not enter the law and may be arbitrary."""
    sheet = material.in_plane_stress()
    count = 100_000
    e = strains(240 / 2e5, 4, count)
    d = np.random.default_rng(3).normal(size=e.shape)
    stress, change = Many(sheet, 4, count)(e, d)
    assert not stress[:, 2].any() and not change[:, 2].any()
    young, poisson = material.young, material.poisson
    C = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, 1 - poisson]]) * young / (1 - poisson**2)
    form = form_of(material)
    plane = quadratic(e[:, SPACE], C, form[np.ix_(SPACE, SPACE)], material.yield_stress)
    elastic = np.abs(e[:, SPACE] @ C).max(axis=1) + material.yield_stress
    off = np.abs(stress[:, PLANE] - plane.stress).max(axis=1)
    assert (off <= EXACT * elastic).all()
    expected = np.einsum("nab,nb->na", plane.tangent, d[:, SPACE])
    off = np.abs(change[:, PLANE] - expected).max(axis=1)
    assert (off <= 1e-11 * young * np.abs(d).max(axis=1)).all()
    # the out-of-plane strain without out-of-plane stress: elastic, and by flow along P
    whole = np.zeros((count, 6))
    whole[:, SPACE] = stress[:, PLANE]
    C6 = hooke(material.bulk, material.shear)
    lost = e[:, SPACE] - np.linalg.solve(C, whole[:, SPACE].T).T
    flow = whole @ form
    size = np.einsum("ni,ni->n", flow[:, SPACE], flow[:, SPACE])
    rate = np.einsum("ni,ni->n", lost, flow[:, SPACE]) / np.maximum(size, 1e-300)
    total = np.linalg.solve(C6, whole.T).T + rate[:, None] * flow
    total[:, SPACE] = e[:, SPACE]
    found = quadratic(total, C6, form, material.yield_stress)
    off = np.abs(found.stress - whole).max(axis=1)
    assert (off <= 1e-10 * (np.abs(total @ C6).max(axis=1) + material.yield_stress)).all()


@pytest.mark.parametrize("material", [STEEL, ROLLED])
def test_potential_conjugate_and_set(material: VonMises | Hill) -> None:
    sheet = material.in_plane_stress()
    point = Point(sheet, gdim=2)
    random = np.random.default_rng(6)
    for scale in (1e-4, 1e-3, 1e-2, 0.3):
        e = scale * random.normal(size=4)
        stress, potential = point("stress", e), point.number("potential", e)
        work = float(stress @ e)
        assert potential + point.number("conjugate", stress) == pytest.approx(work, rel=EXACT)
        h, d = 1e-5 * scale, random.normal(size=4)
        up, down = (point.number("potential", e + sign * h * d) for sign in (1, -1))
        assert (up - down) / (2 * h) == pytest.approx(stress @ d, rel=1e-6, abs=1e-3 * abs(work))
        if point("plastic", e)[0]:
            assert point.number("yield_ratio", stress) == pytest.approx(1, rel=EXACT)
            power = point.number("dissipation", e - point("compliance", stress))
            lost = e - point("compliance", stress)
            assert power == pytest.approx(stress @ (lost * [1, 1, 0, 1]), rel=1e-9)


def test_elastic_sheets() -> None:
    """Under tension along x, the strains are 1/E along x and −ν/E along y."""
    point = Point(Elastic(2e5, 0.3).in_plane_stress(), gdim=2)
    stress = point("stress", np.array([1e-3, -0.3e-3, 7.0, 0.0]))
    assert stress == pytest.approx([200.0, 0.0, 0.0, 0.0], abs=1e-10)
    assert point("compliance", stress) == pytest.approx([1e-3, -0.3e-3, 0.0, 0.0], abs=1e-16)


def test_what_is_not_known_in_plane_stress() -> None:
    ground = DruckerPrager(1e4, 0.3, 10.0, 20.0, "compression")
    with pytest.raises(InputError, match="'soil', DruckerPrager"):
        in_plane_stress({"soil": ground, "plate": STEEL})
    assert isinstance(in_plane_stress({"plate": STEEL})["plate"], Sheet)
