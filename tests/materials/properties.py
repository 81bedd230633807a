"""Check properties of every law: Σ = Dψ, the tangent, the conjugate, the gauge.

The tests of a law call :func:`check_all` with materials of the law, and strains on all its
branches.
"""

from collections.abc import Iterable, Mapping

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import create_unit_cube, create_unit_square

from perfplast_fenicsx.materials import Material

Array = npt.NDArray[np.float64]


class Point:
    """A law at one cell of a mesh on this rank only, evaluated for given numbers.

    Attributes:
        size: Number of components of its Mandel vectors.
    """

    def __init__(
        self,
        material: Material,
        rho: float = 0.0,
        gdim: int = 3,
        old: Mapping[str, Array] | None = None,
    ) -> None:
        make = {2: create_unit_square, 3: create_unit_cube}[gdim]
        self.mesh = make(MPI.COMM_SELF, *(1,) * gdim)
        self.size = {2: 4, 3: 6}[gdim]
        self.x, self.d = (fem.Constant(self.mesh, np.zeros(self.size)) for _ in range(2))
        x, d = self.x, self.d
        numbers = {key: fem.Constant(self.mesh, a) for key, a in material.parameters().items()}
        law = material.law(**numbers)
        before = {name: fem.Constant(self.mesh, value) for name, value in (old or {}).items()}
        assert law.history(self.size) == {name: a.ufl_shape for name, a in before.items()}
        stored = law.tangent_fields(x, before, fem.Constant(self.mesh, rho))
        self.expressions = {
            "stress": law.stress(x, before),
            "potential": law.potential(x, before),
            "conjugate": law.conjugate(x, before),
            "plastic": law.plastic(x, before),
            "hooke": law.elastic.hooke(x),
            "compliance": law.elastic.compliance(x),
            "tangent": law.tangent(stored, d),
            "yield_ratio": law.yields.gauge(x),
            "dissipation": law.yields.support(x),
            **law.updated(x, before),
        }
        self.compiled: dict[str, fem.Expression] = {}

    def __call__(self, name: str, x: Array, d: Array | None = None) -> Array:
        """Return a value of the law at a strain, a rate or a stress x, and a direction d."""
        self.x.value[:] = x
        self.d.value[:] = 0 if d is None else d
        value = self.expressions[name]
        if isinstance(value, ufl.constantvalue.Zero):
            return np.zeros(value.ufl_shape).ravel()
        if name not in self.compiled:
            point = np.full((1, self.mesh.topology.dim), 0.25)
            self.compiled[name] = fem.Expression(value, point)
        cells = np.array([0], dtype=np.int32)
        return np.asarray(self.compiled[name].eval(self.mesh, cells)).ravel()

    def number(self, name: str, x: Array) -> float:
        """Return a scalar value of the law."""
        return float(self(name, x)[0])


def strains(scales: Iterable[float], size: int = 6, seed: int = 7) -> list[Array]:
    """Return strains in a random direction, whose deviators have the sizes ``scales``."""
    random = np.random.default_rng(seed)
    found = []
    for scale in scales:
        e = random.normal(size=size)
        d = deviator(e)
        found.append(scale * e / np.linalg.norm(d))
    return found


def deviator(x: Array) -> Array:
    """Return the deviator of a Mandel vector."""
    d = x.copy()
    d[:3] -= x[:3].mean()
    return d


def check_all(
    material: Material,
    yields_at: float,
    gdim: int = 3,
    old: Mapping[str, Array] | None = None,
    centre: Array | None = None,
) -> None:
    """Check a law inside, far outside and on both sides near its yield surface.

    Args:
        material: The material with its numbers.
        yields_at: Size of the deviator of a strain at first yield, from the centre.
        gdim: Dimension of the mesh.
        old: Values of the history.
        centre: Centre of the elastic strains; zero without a history.
    """
    point = Point(material, gdim=gdim, old=old)
    zero = np.zeros(point.size)
    middle = zero if centre is None else centre
    scales = [0.3, 0.999, 1.001, 1.7, 30.0]
    around = [middle + e for e in strains([x * yields_at for x in scales], point.size)]
    for e in around:
        _check_stress(point, e)
        _check_conjugate(point, e)
        assert np.allclose(point("compliance", point("hooke", e)), e, rtol=1e-9, atol=1e-300)
        ratio = point.number("yield_ratio", e)
        assert point.number("yield_ratio", 2 * e) == _near(2 * ratio)
    if centre is None:
        assert not point("stress", zero).any()
    for rho in (0.0, 0.3, 1.0):
        point = Point(material, rho, gdim, old)
        d = np.arange(1.0, 1 + point.size)
        assert np.allclose(point("tangent", middle, d), point("hooke", d))
        for e in around:
            _check_tangent(point, e, rho)


def _check_stress(point: Point, e: Array) -> None:
    """Check that Σ is the derivative of ψ, by differences of fourth order."""
    d = np.random.default_rng(1).normal(size=point.size)
    d /= np.linalg.norm(d)
    h = 1e-4 * np.linalg.norm(deviator(e))
    steps = [point.number("potential", e + k * h * d) for k in (-2, -1, 1, 2)]
    derivative = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * h)
    stress = point("stress", e)
    scale = np.linalg.norm(stress)
    assert abs(derivative - stress @ d) < 1e-7 * scale


def _check_conjugate(point: Point, e: Array) -> None:
    """Check that ψ(e) + ψ*(s) equals s:e for s = Σ(e), and exceeds it for other stresses."""
    stress = point("stress", e)
    potential, work = point.number("potential", e), float(stress @ e)
    conjugate = point.number("conjugate", stress)
    size = abs(potential) + abs(conjugate) + abs(work)
    assert potential + conjugate == pytest.approx(work, rel=0, abs=1e-12 * size)
    for other in strains([0.1, 1.0, 10.0], point.size, seed=3):
        s = point("stress", other * np.linalg.norm(e))
        room = potential + point.number("conjugate", s) - float(s @ e)
        assert room > -1e-12 * size


def _check_tangent(point: Point, e: Array, rho: float) -> None:
    """Check that the tangent is symmetric and positive semidefinite, and the stress derivative."""
    matrix = np.stack([point("tangent", e, d) for d in np.eye(point.size)])
    assert np.allclose(matrix, matrix.T, atol=1e-9 * abs(matrix).max())
    assert np.linalg.eigvalsh(matrix).min() >= -1e-9 * abs(matrix).max()
    d = np.random.default_rng(2).normal(size=point.size)
    h = 1e-6 * np.linalg.norm(e) / np.linalg.norm(d)
    slope = (point("stress", e + h * d) - point("stress", e - h * d)) / (2 * h)
    expected = rho * point("hooke", d) + (1 - rho) * slope
    assert np.linalg.norm(matrix @ d - expected) <= 1e-7 * np.linalg.norm(expected)


def _near(value: float) -> float:
    return pytest.approx(value, rel=1e-9, abs=1e-300)
