"""Test each law at 10⁵ points against other methods, including edges, apex and equal values.

Differences check the derivatives of plain projections, and these check the tangents of laws.
"""

from collections.abc import Callable

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import create_unit_cube, create_unit_square

from perfplast_fenicsx import DruckerPrager, Hill, MohrCoulomb, Tresca, VonMises
from perfplast_fenicsx.arrays import matrices, vectors
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials import Material
from tests.materials.plain_projections import (
    DEV,
    Array,
    Projected,
    conical,
    hooke,
    principal,
    quadratic,
)

pytestmark = pytest.mark.serial

POINTS = 100_000
EXACT = 1e-12
"""Tolerance relative to the elastic stress, whose rounding error no law can reduce."""

AMONG = {4: [0, 1, 2, 5], 6: list(range(6))}
"""Components of 3D Mandel vectors that a plane section has."""

SHAPES = [(1, -1, 0), (1, 1, -2), (2, -1, -1), (0, 0, 0)]
SHAPES += [(1, 1 - 1e-9, -2), (1, -0.5, -0.5 - 1e-12)]


def of_space(material: Hill) -> Array:
    """Return Hill's form in the axes of the mesh, by a rotation of stresses."""
    F, G, H, L, M, N = material.coefficients
    form = np.diag([G + H, F + H, F + G, L, M, N])
    form[0, 1] = form[1, 0] = -H
    form[0, 2] = form[2, 0] = -G
    form[1, 2] = form[2, 1] = -F
    c, s = np.cos(np.radians(material.angle)), np.sin(np.radians(material.angle))
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    units = np.eye(6)
    turn = np.stack([_turned(unit, axes) for unit in units], axis=1)
    return np.asarray(turn.T @ form @ turn)


def _turned(vector: Array, axes: Array) -> Array:
    return np.asarray(vectors(axes @ matrices(vector) @ axes.T))


def of_metal(material: VonMises | Hill) -> Callable[[Array], Projected]:
    """Quadratic forms."""
    form = of_space(material) if isinstance(material, Hill) else 1.5 * DEV
    C = hooke(material.bulk, material.shear)
    return lambda e: quadratic(e, C, form, material.yield_stress)


def of_ground(material: MohrCoulomb | Tresca | DruckerPrager) -> Callable[[Array], Projected]:
    """Planes, or a cone."""
    bulk, shear = material.bulk, material.shear
    if isinstance(material, DruckerPrager):
        angle = np.radians(material.friction_angle)
        root = np.sqrt(9 + 12 * np.tan(angle) ** 2)  # of the match below
        return lambda e: conical(
            e, bulk, shear, 3 * np.tan(angle) / root, 3 * material.cohesion / root
        )
    angle = np.radians(getattr(material, "friction_angle", 0.0))
    b = 2 * material.cohesion * np.cos(angle)
    return lambda e: principal(e, bulk, shear, np.sin(angle), b)


STEEL, SHEET = VonMises(2e5, 0.3, 240.0), Hill(2e5, 0.3, 240.0, 1.0, 0.9, 1.2, 0.8, 1.3, 1.1, 25.0)
CASES: dict[str, tuple[Material, Callable[[Array], Projected], float]] = {
    "von-mises": (STEEL, of_metal(STEEL), 240 / 2e5),
    "hill": (SHEET, of_metal(SHEET), 240 / 2e5),
}
"""A material, another method for its stress, and a strain at which it yields."""

for name, found in {
    "mohr-coulomb": MohrCoulomb(1e4, 0.3, 10.0, 25.0),
    "nearly-no-friction": MohrCoulomb(1e4, 0.3, 10.0, 1e-5),
    "nearly-incompressible": MohrCoulomb(1e4, 0.499, 10.0, 30.0),
    "tresca": Tresca(1e4, 0.3, 10.0),
    "drucker-prager": DruckerPrager(1e4, 0.3, 10.0, 25.0, "plane-strain"),
}.items():
    CASES[name] = found, of_ground(found), 10 / 1e4


def strains(unit: float, size: int, count: int) -> Array:
    """Return strains: half of them random, half with equal or nearly equal principal values."""
    random = np.random.default_rng(12)
    half = count // 2
    e = random.normal(size=(count, 6))
    shapes = np.array(SHAPES)[random.integers(len(SHAPES), size=half)]
    values = shapes * random.choice([-1.0, 1.0], size=(half, 1))
    values = values + random.choice([-3.0, 0.0, 0.0, 0.3, 3.0], size=(half, 1))
    axes = np.linalg.qr(random.normal(size=(half, 3, 3)))[0]
    axes[: half // 4] = np.eye(3)
    if size == 4:
        axes[:, 2] = axes[:, :, 2] = [0, 0, 1]
        axes[:, :2, :2] = np.linalg.qr(random.normal(size=(half, 2, 2)))[0]
        e[:, 3:5] = 0
    e[:half] = vectors(np.einsum("nai,ni,nbi->nab", axes, values, axes))
    e *= unit * 10 ** random.uniform(-1, 2.5, size=(count, 1))
    e[0] = 0
    return e


class Many:
    """A law at one point in each of many cells."""

    def __init__(self, material: Material, size: int, count: int) -> None:
        """Compile the law."""
        n = int(np.ceil((count / 6) ** (1 / 3))) if size == 6 else int(np.ceil((count / 2) ** 0.5))
        make = create_unit_cube if size == 6 else create_unit_square
        self.mesh = make(MPI.COMM_SELF, *(n,) * (3 if size == 6 else 2))
        space = fem.functionspace(self.mesh, ("DG", 0, (size,)))
        self.e, self.d = fem.Function(space), fem.Function(space)
        numbers = {key: fem.Constant(self.mesh, a) for key, a in material.parameters().items()}
        law = material.law(**numbers)
        rho = fem.Constant(self.mesh, 0.0)
        stored = law.tangent_fields(self.e, {}, rho)
        at = interpolation_points(space.element)
        self._stress = fem.Expression(law.stress(self.e, {}), at)
        self._tangent = fem.Expression(law.tangent(stored, self.d), at)
        self._size, self._count = size, count

    def __call__(self, e: Array, d: Array) -> tuple[Array, Array]:
        """Return the stress, and the change of stress from the tangent in given directions."""
        for function, values in ((self.e, e), (self.d, d)):
            function.x.array[: self._count * self._size] = values[:, AMONG[self._size]].ravel()
        cells = np.arange(self._count, dtype=np.int32)
        found = (it.eval(self.mesh, cells) for it in (self._stress, self._tangent))
        stress, change = (np.asarray(it).reshape(self._count, self._size) for it in found)
        return stress, change


@pytest.mark.long(but=[*(f"{name}-4" for name in CASES), "hill-6"])
@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("name", CASES)
def test_laws_are_their_projections(name: str, size: int) -> None:
    material, other, unit = CASES[name]
    count = POINTS if size == 6 else POINTS // 2
    e = strains(unit, size, count)
    d = np.random.default_rng(3).normal(size=e.shape)
    if size == 4:
        d[:, 3:5] = 0
    stress, change = Many(material, size, count)(e, d)
    assert np.isfinite(stress).all() and np.isfinite(change).all()
    found = other(e)
    numbers = material.parameters()
    C = hooke(numbers["bulk"], numbers["shear"])
    elastic = np.abs(e @ C).max(axis=1) + unit * numbers["shear"]
    off = np.abs(stress - found.stress[:, AMONG[size]]).max(axis=1)
    assert (off <= EXACT * elastic).all()
    expected = np.einsum("nab,nb->na", found.tangent, d)[:, AMONG[size]]
    off = np.abs(change - expected).max(axis=1) / (np.abs(C).max() * np.abs(d).max(axis=1))
    assert off.max() <= 1e-11
    if numbers.get("sine", 0.0) > 1e-3:
        assert set(found.branch) == {0, 1, 2, 3, 4}


@pytest.mark.parametrize("name", CASES)
def test_plain_tangents_are_derivatives(name: str) -> None:
    """Compare with differences, where no branch changes and no axes rotate quickly."""
    _, other, unit = CASES[name]
    e = strains(unit, 6, 20_000)[10_000:]
    d = np.random.default_rng(4).normal(size=e.shape)
    h = 1e-6 * np.linalg.norm(e, axis=1, keepdims=True)
    here, up, down = other(e), other(e + h * d), other(e - h * d)
    smooth = (here.branch == up.branch) & (here.branch == down.branch)
    slope = (up.stress - down.stress) / (2 * h)
    expected = np.einsum("nab,nb->na", here.tangent, d)
    off = np.abs(slope - expected)[smooth].max(axis=1) / np.abs(here.tangent).max()
    assert smooth.mean() > 0.9
    assert np.quantile(off, 0.99) <= 1e-6
