"""The law alone: Σ against DΨ, the tangent against differences, admissibility, symmetry."""

import math

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import create_unit_cube, create_unit_square

from perfplast_fenicsx import Elastic, InputError, VonMises
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials.mandel import deviator, strain, tensor
from perfplast_fenicsx.materials.von_mises import Moduli, tangent

Array = npt.NDArray[np.float64]


class Point:
    """The law at one cell of a mesh on this rank alone, fed with numbers."""

    def __init__(self, material: Elastic | VonMises, rho: float = 0.0) -> None:
        self.mesh = create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
        self.e, self.d = (fem.Constant(self.mesh, np.zeros(6)) for _ in range(2))
        gamma = material.yield_radius
        law = Moduli(*(fem.Constant(self.mesh, x) for x in (material.bulk, material.shear, gamma)))
        a, normal = law.tangent_data(self.e, fem.Constant(self.mesh, rho))
        self.expressions = {
            "stress": law.stress(self.e),
            "potential": law.potential(self.e),
            "hooke": law.hooke(self.e),
            "compliance": law.compliance(law.hooke(self.e)),
            "tangent": tangent(law.bulk, a, normal, self.d),
            "deviator": deviator(law.stress(self.e)),
        }
        self.compiled: dict[str, fem.Expression] = {}

    def __call__(self, name: str, e: Array, d: Array | None = None) -> Array:
        self.e.value[:] = e
        self.d.value[:] = 0 if d is None else d
        if name not in self.compiled:
            points = np.array([[0.25, 0.25, 0.25]])
            self.compiled[name] = fem.Expression(self.expressions[name], points)
        cells = np.array([0], dtype=np.int32)
        return np.asarray(self.compiled[name].eval(self.mesh, cells)).ravel()


STEEL = VonMises(206900.0, 0.29, 450.0)
SOFT = VonMises(1000.0, 0.499, 2.0)
STRAINS = [s * np.random.default_rng(7).normal(size=6) for s in (0.0, 1e-4, 3e-3, 1.0)]


@pytest.mark.parametrize("material", [STEEL, SOFT, Elastic(10.0, -0.3)])
def test_stress_is_the_derivative_of_the_potential(material: VonMises) -> None:
    point = Point(material)
    for e in STRAINS[1:]:
        d = np.random.default_rng(1).normal(size=6)
        h = 1e-4 * np.linalg.norm(e)
        steps = [float(point("potential", e + k * h * d)[0]) for k in (-2, -1, 1, 2)]
        derivative = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * h)
        assert derivative == pytest.approx(float(point("stress", e) @ d), rel=1e-8)


@pytest.mark.parametrize("rho", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("material", [STEEL, SOFT, Elastic(10.0, 0.2)])
def test_tangent_matches_differences_of_the_stress(material: VonMises, rho: float) -> None:
    point = Point(material, rho)
    for e in STRAINS[1:]:
        d = np.random.default_rng(2).normal(size=6)
        h = 1e-5 * np.linalg.norm(e)
        slope = (point("stress", e + h * d) - point("stress", e - h * d)) / (2 * h)
        expected = rho * point("hooke", d) + (1 - rho) * slope
        found = point("tangent", e, d)
        assert np.linalg.norm(found - expected) < 1e-7 * np.linalg.norm(expected)


def test_tangent_is_symmetric_and_not_negative() -> None:
    point = Point(STEEL)
    for e in STRAINS:
        matrix = np.stack([point("tangent", e, d) for d in np.eye(6)])
        assert np.allclose(matrix, matrix.T, atol=1e-9 * abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > -1e-9 * abs(matrix).max()


@pytest.mark.parametrize("material", [STEEL, SOFT])
def test_stress_is_admissible_and_elastic_inside(material: VonMises) -> None:
    point = Point(material)
    for e in STRAINS:
        size = np.linalg.norm(point("deviator", e))
        assert size <= material.yield_radius * (1 + 1e-12)
        assert np.isfinite(point("stress", e)).all()
        stress, elastic = point("stress", e * 1e-6), point("hooke", e * 1e-6)
        assert np.abs(stress - elastic).max() <= 1e-13 * np.abs(elastic).max()
        assert np.allclose(point("compliance", e), e, rtol=1e-9, atol=1e-300)


def test_zero_strain_gives_zero_stress_and_the_elastic_tangent() -> None:
    for material in (STEEL, Elastic(1.0, 0.3)):
        point = Point(material)
        d = np.arange(6.0)
        assert not point("stress", np.zeros(6)).any()
        assert np.allclose(point("tangent", np.zeros(6), d), point("hooke", d))


def test_constants_are_the_textbook_ones() -> None:
    assert STEEL.bulk == pytest.approx(206900 / (3 * 0.42))
    assert STEEL.shear == pytest.approx(206900 / 2.58)
    assert STEEL.yield_radius == pytest.approx(math.sqrt(2 / 3) * 450)


def test_mandel_products_are_tensor_products() -> None:
    for mesh in (create_unit_square(MPI.COMM_SELF, 1, 1), create_unit_cube(MPI.COMM_SELF, 1, 1, 1)):
        gdim = mesh.geometry.dim
        x = ufl.SpatialCoordinate(mesh)
        u = ufl.as_vector([x[0] ** 2 + (i + 2) * x[0] * x[1] for i in range(gdim)])
        e, full = strain(u), ufl.sym(ufl.grad(u))
        for difference in (
            ufl.dot(e, e) - ufl.inner(full, full),
            ufl.inner(tensor(e), tensor(e)) - ufl.inner(full, full),
            ufl.tr(tensor(deviator(e))),
        ):
            size = fem.assemble_scalar(fem.form(difference**2 * ufl.dx))
            assert abs(size) < 1e-20
    assert interpolation_points(fem.functionspace(mesh, ("DG", 0)).element).shape == (1, 3)


@pytest.mark.parametrize(
    ("young", "poisson", "yield_stress", "named"),
    [
        (0.0, 0.3, 1.0, "young = 0.0"),
        (1.0, 0.5, 1.0, "poisson = 0.5"),
        (1.0, -1.0, 1.0, "poisson = -1.0"),
        (1.0, math.nan, 1.0, "poisson = nan"),
        (1.0, 0.3, -2.0, "yield_stress = -2.0"),
        (math.inf, 0.3, 1.0, "young = inf"),
    ],
)
def test_impossible_constants_are_named(
    young: float, poisson: float, yield_stress: float, named: str
) -> None:
    with pytest.raises(InputError, match=named):
        VonMises(young, poisson, yield_stress)
