"""Test that gauge, support, cones and admissible rates of a law describe the same set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
import ufl

from perfplast_fenicsx import DruckerPrager, Elastic, Hill, MohrCoulomb, Tresca, VonMises
from perfplast_fenicsx.arrays import matrices, vectors
from perfplast_fenicsx.materials import (
    MATERIALS,
    Cone,
    DruckerPragerSet,
    Expr,
    Flow,
    Hardening,
    Material,
    PrincipalCone,
    VonMisesSet,
    YieldSet,
)
from tests.materials.energy_cap import Foam
from tests.materials.properties import Array, Point

pytestmark = pytest.mark.serial

EXACT = 1e-12
"""Relative difference of two descriptions of a set."""

STEEL = VonMises(2e5, 0.3, 240.0)
HARD = Hardening(2e5, 0.3, 240.0, isotropic=1e3, kinematic=2e3)
LAWS: dict[str, Sequence[Material]] = {
    "von-mises": (STEEL, Flow(STEEL)),
    "von-mises-hardening": (HARD, Flow(HARD)),
    "drucker-prager": (
        DruckerPrager(1e4, 0.3, 10.0, 20.0, "compression"),
        DruckerPrager(1e4, 0.3, 0.1, 42.0, "plane-strain"),
        DruckerPrager(1e4, 0.3, 3.0, 2.0, "extension"),
    ),
    "hill": (
        Hill(2e5, 0.3, 450.0, 1.0, 0.953, 1.195, 0.8, 1.3, 1.1, 25.0),
        Hill(2e5, 0.3, 450.0, r33=1.6),
        Hill(2e5, 0.3, 450.0),
    ),
    "elastic": (Elastic(2e5, 0.3),),
}
"""Materials by the names of case files."""


PRINCIPAL: dict[str, Sequence[Material]] = {
    "mohr-coulomb": (MohrCoulomb(1e4, 0.3, 10.0, 20.0), MohrCoulomb(1e4, 0.3, 0.1, 42.0)),
    "tresca": (Tresca(1e4, 0.3, 10.0),),
}
"""Laws whose set bounds principal stresses."""


def value(expression: Expr) -> Array:
    """Return the value of an expression without fields; UFL evaluates its entries."""
    shape = expression.ufl_shape
    entries = [expression[i](()) if i else expression(()) for i in np.ndindex(shape)]
    return np.array(entries, dtype=np.float64).reshape(shape)


def check_set(yields: YieldSet, size: int) -> None:
    """Check that a set with one cone or no cone is the same in all its descriptions."""
    random = np.random.default_rng(11)
    cones = yields.cones(size)
    assert cones is not None and len(cones) <= 1
    units = [yields.inadmissible(ufl.as_vector(list(e))) for e in np.eye(size)]
    linear = None if units[0] is None else np.stack([value(unit) for unit in units])
    if not cones:
        assert linear is not None and np.linalg.matrix_rank(linear) == size
        for stress in random.normal(size=(20, size)):
            assert value(yields.gauge(ufl.as_vector(list(stress)))) == 0
        assert value(yields.support(ufl.as_vector([0.0] * size))) == 0
        return
    assert isinstance(cones[0], Cone)
    bound, slope, matrix = (value(ufl.as_ufl(a)) for a in (cones[0].bound, *_rest(cones[0])))
    assert np.linalg.matrix_rank(matrix) == len(matrix) and bound > 0

    def gauge(stress: Array) -> float:
        return float(value(yields.gauge(ufl.as_vector(list(stress)))))

    def support(rate: Array) -> float:
        return float(value(yields.support(ufl.as_vector(list(rate)))))

    def room(stress: Array) -> float:
        return float(bound - slope @ stress - np.linalg.norm(matrix @ stress))

    both, bounded = np.vstack([slope, matrix]), len(matrix) == size
    if linear is not None:
        # stress components that the cone leaves free are the rates that are not admissible
        assert not slope.any()
        assert np.linalg.matrix_rank(linear) + len(matrix) == size
        assert np.abs(matrix @ linear).max() < EXACT
    else:
        assert (slope.any() or bounded) and np.linalg.matrix_rank(both) == size
    surface = []
    for stress in random.normal(size=(200, size)) * bound:
        t = gauge(stress)
        assert gauge(3 * stress) == pytest.approx(3 * t, rel=EXACT)
        if t == 0:
            assert room(1e3 * stress) > 0
            continue
        surface.append(stress / t)
        rounding = EXACT * (bound + np.linalg.norm(both) * np.linalg.norm(surface[-1]))
        assert abs(room(surface[-1])) < rounding
    assert len(surface) > 20
    for z in random.normal(size=(50, len(matrix))):
        # a rate in the dual cone, (head, z); the best stress is on its ray, or at the apex
        for more in (1.0,) if linear is not None or bounded else (1.0, 1.7):
            head = more * np.linalg.norm(z)
            rate = matrix.T @ z + head * slope
            if linear is not None:
                assert np.abs(rate @ linear).max() < EXACT * np.linalg.norm(rate)
            power = support(rate)
            assert power == pytest.approx(bound * head, rel=EXACT)
            along = bound * z / head if more == 1 else 0 * z
            heads = np.r_[0 if more == 1 else bound, along]
            best: Array = np.linalg.lstsq(both, heads, rcond=None)[0].astype(np.float64)
            if bounded:
                best = np.linalg.solve(matrix, along)
                best /= 1 + slope @ best / bound
            assert gauge(best) == pytest.approx(1, rel=EXACT)
            assert best @ rate == pytest.approx(power, rel=EXACT)
            sizes = np.linalg.norm(surface, axis=1) * np.linalg.norm(rate)
            assert (np.array(surface) @ rate <= power + EXACT * sizes).all()


def _rest(cone: Cone) -> tuple[Expr, Expr]:
    return cone.slope, cone.matrix


def test_each_law_of_case_files_is_here() -> None:
    """All are here except the parabola of rock and rigid bodies, which have no yield set."""
    elsewhere = {"rigid", "hoek-brown"}  # test_hoek_brown.py compares its set
    assert set(LAWS) | set(PRINCIPAL) == set(MATERIALS) - elsewhere
    for name, given in (LAWS | PRINCIPAL).items():
        assert type(given[0]) is MATERIALS[name]


@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("material", [m for given in PRINCIPAL.values() for m in given])
def test_sets_of_principal_stresses(material: Material, size: int) -> None:
    """Gauge and support belong to the set of the cone, also with equal principal values."""
    numbers = {name: ufl.as_ufl(value) for name, value in material.parameters().items()}
    yields = material.law(**numbers).yields
    (cone,) = yields.cones(size)
    assert isinstance(cone, PrincipalCone)
    point = Point(material, gdim=2 if size == 4 else 3)
    bound, sine = float(value(cone.bound)), float(value(cone.sine))
    random = np.random.default_rng(5)
    surface = []
    for stress in [*random.normal(size=(200, size)) * bound, bound * np.eye(size)[2]]:
        t = point.number("yield_ratio", stress)
        if t > 0:
            surface.append(stress / t)
            least, _, most = np.linalg.eigvalsh(matrices(surface[-1]))
            room = bound - (1 + sine) * most + (1 - sine) * least
            assert abs(room) < EXACT * (bound + np.linalg.norm(surface[-1]))
    assert len(surface) > 20
    for _ in range(50):
        # rates of adjacent faces: σ₁ or σ₃ is the same in both
        shares = random.uniform(size=2) * (random.uniform(size=2) > 0.3)
        faces = np.array([[1 + sine, 0, sine - 1], [0, 1 + sine, sine - 1]])
        if random.uniform() > 0.5:
            faces = np.array([[1 + sine, 0, sine - 1], [1 + sine, sine - 1, 0]])
        values = shares @ faces
        axes = np.eye(3)
        axes[:2, :2] = np.linalg.qr(random.normal(size=(2, 2)))[0]
        if size == 6:
            axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        tensor = (axes * values) @ axes.T
        rate = vectors(tensor)[[0, 1, 2, 5] if size == 4 else slice(None)]
        power = point.number("dissipation", rate)
        assert power == pytest.approx(bound * shares.sum(), rel=EXACT, abs=EXACT * bound)
        sizes = np.linalg.norm(surface, axis=1) * np.linalg.norm(rate)
        assert (np.array(surface) @ rate <= power + EXACT * sizes).all()


OTHERS = (Foam(1e4, 0.3, 10.0), Foam(1e4, 0.3, 10.0, 4.0), Foam(1e4, 0.45, 10.0, -1.0))
"""Laws that case files do not have: ellipsoids about zero, about a pressure and about a tension."""


@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("material", [*(m for given in LAWS.values() for m in given), *OTHERS])
def test_descriptions_are_of_one_set(material: Material, size: int) -> None:
    law = material.law(**{name: ufl.as_ufl(a) for name, a in material.parameters().items()})
    check_set(law.yields, size)


@dataclass(frozen=True)
class Wrong(VonMisesSet):
    """A set with one description of a different set.

    Args:
        which: Name of this description.
    """

    which: str = ""

    def gauge(self, s: Expr) -> Expr:
        return super().gauge(s) * (1.001 if self.which == "gauge" else 1)

    def support(self, rate: Expr) -> Expr:
        return super().support(rate) * (1 + 1e-9 if self.which == "support" else 1)

    def cones(self, size: int) -> Sequence[Cone]:
        (cone,) = super().cones(size)
        return (replace(cone, bound=cone.bound * (2 if self.which == "cones" else 1)),)

    def inadmissible(self, rate: Expr) -> Expr:
        return rate if self.which == "inadmissible" else super().inadmissible(rate)


@pytest.mark.parametrize("which", ["", "gauge", "support", "cones", "inadmissible"])
def test_a_description_of_another_set_is_noticed(which: str) -> None:
    yields = Wrong(ufl.as_ufl(3.0), which)
    if not which:
        return check_set(yields, 6)
    with pytest.raises(AssertionError):
        check_set(yields, 6)


def test_tip_of_a_cone_bounds_tension() -> None:
    """The tip is c cot φ of Mohr–Coulomb ground, for any match of cone and pyramid."""
    for material in LAWS["drucker-prager"]:
        assert isinstance(material, DruckerPrager)
        yields = DruckerPragerSet(*(ufl.as_ufl(a) for a in material.cone))
        tip = material.cohesion / np.tan(np.radians(material.friction_angle))
        even = ufl.as_vector([tip] * 3 + [0.0] * 3)
        assert value(yields.gauge(even)) == pytest.approx(1, rel=EXACT)
