"""Test a law in this file: von Mises with hardening, in a form that differs from the package's.

The law passes all tests that the package's laws pass. In Hencky's form, with Δ = max(0, 2μ‖dev e‖ −
γ)/(2μ + h), n = dev e/‖dev e‖ and h = ⅔H for a hardening modulus H,

    Σ(e)  = κ tr(e) δ + 2μ(dev e − Δ n)
    ψ(e)  = ½ e:Ce − ½ (2μ + h) Δ²
    ψ*(s) = ½ s:C⁻¹s + max(0, ‖dev s‖ − γ)²/(2h).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest
import ufl

from perfplast_fenicsx import (
    AugmentedLagrangian,
    Contact,
    Elastic,
    InputError,
    Level,
    Newton,
    NewtonOptions,
    OutputFields,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    WorkNewton,
    limit_load,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.io import dissipation
from perfplast_fenicsx.limit_analysis import dissipation_bound
from perfplast_fenicsx.materials import (
    Expr,
    IsotropicElasticity,
    Law,
    Material,
    deviator,
    spherical,
)
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from tests.materials.properties import check_all
from tests.models import STEEL


@dataclass(frozen=True)
class FirstSet:
    """Yield set of a law that does not declare hardening or admissible rates."""

    radius: Expr

    def gauge(self, s: Expr) -> Expr:
        return norm(deviator(s)) / self.radius

    def support(self, rate: Expr) -> Expr:
        return self.radius * norm(deviator(rate))

    def cones(self, size: int) -> None:
        return None

    def inadmissible(self, rate: Expr) -> None:
        return None


@dataclass(frozen=True)
class HardeningLaw(Law):
    bulk: Expr
    shear: Expr
    yield_radius: Expr
    hardening: Expr
    projects: ClassVar[bool] = False

    @property
    def elastic(self) -> IsotropicElasticity:
        return IsotropicElasticity(self.bulk, self.shear)

    def excess(self, e: Expr) -> Expr:
        """Return Δ, the norm of the plastic strain."""
        trial = 2 * self.shear * norm(deviator(e)) - self.yield_radius
        return ufl.max_value(0.0, trial) / (2 * self.shear + self.hardening)

    def direction(self, e: Expr) -> Expr:
        """Return n where plastic, else 0."""
        d = deviator(e)
        least = self.yield_radius / (2 * self.shear)
        return self.plastic(e, {}) * d / ufl.max_value(norm(d), least)

    def stress(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        return self.elastic.hooke(e) - 2 * self.shear * self.excess(e) * self.direction(e)

    def potential(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        elastic = ufl.dot(self.elastic.hooke(e), e) / 2
        return elastic - (2 * self.shear + self.hardening) * self.excess(e) ** 2 / 2

    def conjugate(self, s: Expr, old: Mapping[str, Expr]) -> Expr:
        excess = ufl.max_value(0.0, norm(deviator(s)) - self.yield_radius)
        return ufl.dot(self.elastic.compliance(s), s) / 2 + excess**2 / (2 * self.hardening)

    def plastic(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        size = 2 * self.shear * norm(deviator(e))
        return ufl.conditional(ufl.gt(size, self.yield_radius), 1.0, 0.0)

    def tangent_fields(self, e: Expr, old: Mapping[str, Expr], rho: Expr) -> Mapping[str, Expr]:
        """Return the whole matrix Σ^{o,ρ}, which no law of the package stores."""
        m, n, shear = len(e), self.direction(e), 2 * self.shear
        delta = spherical(ufl.as_ufl(1.0), m)
        least = self.yield_radius / shear
        share = self.excess(e) / ufl.max_value(norm(deviator(e)), least)
        deviatoric = ufl.Identity(m) - ufl.outer(delta, delta) / 3
        hooke = self.bulk * ufl.outer(delta, delta) + shear * deviatoric
        softer = shear * share * deviatoric
        turn = shear * (shear / (shear + self.hardening) - share) * ufl.outer(n, n)
        return {"D": hooke - (1 - rho) * (softer + turn)}

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        return ufl.dot(stored["D"], d)

    @property
    def yields(self) -> FirstSet:
        return FirstSet(self.yield_radius)


def norm(x: Expr) -> Expr:
    return ufl.sqrt(ufl.dot(x, x))


@dataclass(frozen=True)
class Hardening:
    """A material whose σ_y grows by H times the equivalent plastic strain."""

    law: ClassVar[type[HardeningLaw]] = HardeningLaw

    base: VonMises
    modulus: float

    def parameters(self) -> dict[str, float]:
        return self.base.parameters() | {"hardening": 2 / 3 * self.modulus}


METAL = Hardening(STEEL, STEEL.young / 20)
YIELDS_AT = STEEL.yield_radius / (2 * STEEL.shear)
SHARP = NewtonOptions(tolerance=1e-12)


def stack(
    lower: Material, upper: Material, degree: int = 1, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> Problem:
    """Return two blocks of height 1 under a pressure of ζ, in uniaxial stress."""
    return Problem(
        stacked_blocks(comm, 2),
        {"lower": lower, "upper": upper},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=degree,
    )


def tower(materials: dict[str, Material], degree: int) -> Problem:
    """Return a stack of blocks of height 1, one for each material, from the bottom up."""
    names = list(materials)

    def at(z: int) -> Callable[[npt.NDArray[np.int64]], npt.NDArray[np.bool_]]:
        return lambda x: x[2] == z

    boxes = [Box(name, (0, 0, z), (1, 1, z + 1), (2, 2, 2)) for z, name in enumerate(names)]
    surfaces = [
        Surface("x0", tuple(names), lambda x: x[0] == 0),
        Surface("y0", tuple(names), lambda x: x[1] == 0),
    ]
    for z, name in enumerate(names):
        surfaces.append(Surface(f"{name}_bottom", (name,), at(z)))
        surfaces.append(Surface(f"{name}_top", (name,), at(z + 1)))
    return Problem(
        structured_mesh(MPI.COMM_WORLD, boxes, surfaces),
        materials,
        [Support("x0", "x"), Support("y0", "y"), Support(f"{names[0]}_bottom", "z")],
        [Pressure(f"{names[-1]}_top", 1.0)],
        [Contact(f"{one}_top", f"{next_}_bottom") for one, next_ in pairwise(names)],
        degree=degree,
    )


def bending(material: Material, degree: int, comm: MPI.Intracomm = MPI.COMM_WORLD) -> Problem:
    return Problem(
        two_blocks(comm, 2),
        {"lower": material, "upper": material},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=degree,
    )


def check(level: Level) -> None:
    assert level.report.converged, level.report.reason
    assert abs(level.report.duality_gap) < 1e-10
    assert level.report.equilibrium < 1e-8


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("modulus", [1e-3, 0.05, 2.0])
def test_what_is_true_of_every_law(modulus: float, gdim: int) -> None:
    check_all(Hardening(STEEL, modulus * STEEL.young), YIELDS_AT, gdim)


@pytest.mark.parametrize("degree", [1, 2])
def test_uniaxial_stress_by_hand(degree: int) -> None:
    """Compare with ε = σ/E + (σ − σ_y)/H, and the work of the loads on this strain."""
    zeta = 1.6 * STEEL.yield_stress
    level = Newton(stack(METAL, METAL, degree), SHARP).solve(zeta)
    check(level)
    strain = zeta / STEEL.young + (zeta - STEEL.yield_stress) / METAL.modulus
    assert level.report.alpha == pytest.approx(2 * strain, rel=1e-10)
    assert level.report.plastic_fraction == pytest.approx(1.0)
    stress = level.stress.x.array.reshape(-1, 6)
    assert np.allclose(stress, zeta * np.array([0, 0, -1, 0, 0, 0]), atol=1e-8 * zeta)


@pytest.mark.parametrize("degree", [1, 2])
def test_bodies_of_three_laws(degree: int) -> None:
    """Each of the stacked blocks has its part of the work.

    The von Mises block remains below its yield stress, because it cannot carry more.
    """
    zeta = 1.2 * STEEL.yield_stress
    hard = zeta / STEEL.young + (zeta - STEEL.yield_stress) / METAL.modulus
    bodies: dict[str, tuple[Material, float, float]] = {
        "low": (METAL, hard, 1.2),
        "middle": (VonMises(STEEL.young / 3, 0.2, 2 * zeta), 3 * zeta / STEEL.young, 0.5),
        "high": (Elastic(STEEL.young / 2, 0.4), 2 * zeta / STEEL.young, 0.0),
    }
    problem = tower({name: material for name, (material, *_) in bodies.items()}, degree)
    assert sorted(type(on.law).__name__ for on in problem.laws) == [
        *("ElasticLaw", "HardeningLaw", "VonMisesLaw")
    ]
    level = Newton(problem, SHARP).solve(zeta)
    check(level)
    assert level.report.alpha == pytest.approx(sum(a for _, a, _ in bodies.values()), rel=1e-10)
    assert level.report.plastic_fraction == pytest.approx(1 / 3)
    fields = OutputFields(problem).update(level)
    for name, (material, _, ratio) in bodies.items():
        cells = problem.tagged_mesh.cells(name)
        assert np.allclose(fields["yield_ratio"].x.array[cells], ratio, rtol=1e-9)
        assert np.allclose(fields["plastic"].x.array[cells], float(material is METAL), rtol=1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_newton_converges_quadratically(degree: int) -> None:
    """Newton steps are not damped; the constant depends on the path to the solution."""
    problem = bending(METAL, degree)
    level = Newton(problem, replace(SHARP, damping=False)).solve(250.0)
    check(level)
    assert 0.02 < level.report.plastic_fraction < 0.9
    assert level.report.newton_iterations <= 10
    sizes = [step.increment for step in level.iterations if step.increment > 1e-9]
    for before, after in pairwise(sizes[-3:]):
        assert after < 50 * before**2


@pytest.mark.parametrize("degree", [1, 2])
def test_newton_converges_with_an_order_above_one(degree: int) -> None:
    """With order p, each ratio of increments is the previous ratio to the power of p."""
    problem = bending(METAL, degree)
    level = Newton(problem, SHARP).solve(250.0)
    check(level)
    assert 0.02 < level.report.plastic_fraction < 0.9
    assert level.report.newton_iterations <= 10
    sizes = [step.increment for step in level.iterations if step.increment > 1e-12]
    *_, before, last = [after / size for size, after in pairwise(sizes)]
    assert last < before**1.5


@pytest.mark.mpi2
def test_one_rank_and_several_agree() -> None:
    levels = [
        Newton(bending(METAL, 1, c), SHARP).solve(250.0) for c in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    together, alone = levels
    assert together.report.alpha == pytest.approx(alone.report.alpha, rel=1e-9)
    assert together.report.plastic_cells == alone.report.plastic_cells
    assert together.report.newton_iterations == alone.report.newton_iterations


def test_prescribed_work_gives_the_load_back() -> None:
    problem = bending(METAL, 1)
    by_load = Newton(problem, SHARP).solve(250.0)
    by_work = WorkNewton(problem, SHARP).solve(by_load.state.alpha)
    check(by_work)
    assert by_work.state.zeta == pytest.approx(250.0, rel=1e-8)


def test_first_yield() -> None:
    state = WorkNewton(stack(METAL, METAL)).first_yield()
    assert state.zeta == pytest.approx(STEEL.yield_stress, rel=1e-9)


def test_there_is_no_limit_and_no_upper_bound() -> None:
    problem = stack(METAL, STEEL)
    level = Newton(problem, SHARP).solve(0.5 * STEEL.yield_stress)
    bound = dissipation_bound(problem, level.state.u, level.state)
    assert bound.value is None
    assert bound.solves == 0
    assert "HardeningLaw" in bound.reason
    limit = limit_load(stack(METAL, METAL))
    assert limit.upper is None
    assert limit.estimate is None


def test_dissipation_of_a_velocity() -> None:
    problem = stack(METAL, Elastic(1.0, 0.3))
    level = Newton(problem).solve(1.0)
    v = level.state.u
    v.interpolate(lambda x: np.stack([3 * x[1], 0 * x[1], 0 * x[1]]))  # ‖dev ε‖ = 3/√2
    v.x.scatter_forward()
    work = dissipation(problem, v)
    for name, expected in (("lower", STEEL.yield_radius * 3 / math.sqrt(2)), ("upper", 0.0)):
        cells = problem.tagged_mesh.cells(name)
        assert np.allclose(work.x.array[cells], expected, rtol=1e-12, atol=1e-12)


def test_alg2_refuses_it() -> None:
    with pytest.raises(InputError, match="HardeningLaw is not a projection"):
        AugmentedLagrangian(stack(METAL, METAL))


def test_what_is_no_material_is_refused() -> None:
    with pytest.raises(InputError, match="'lower' is 'steel', which has neither a law"):
        stack("steel", METAL)  # type: ignore[arg-type]
