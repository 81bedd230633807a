r"""Define perfect plasticity with von Mises' condition, in Hencky's form.

Let θ = 1 / max(1, 2μ‖dev e‖/γ). This number is exactly 1 on the elastic branch, and needs neither a
condition nor a division by ‖dev e‖. Then

    Σ(e)     = κ tr(e) δ + 2μθ dev e
    ψ(e)     = ½ κ tr(e)² + μ θ(2 − θ) ‖dev e‖²
    Σ°(e)[d] = κ tr(d) δ + 2μθ (dev d − (n̂:d) n̂),   n̂ = dev e/‖dev e‖ where plastic, 0 elsewhere

(Section 2 of Čermák, Haslinger, Sysala, COMPLAS XII, 2013).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import ufl

from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.law import Cone, Law, Old, axial_cone
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity, deviator, spherical, trace
from perfplast_fenicsx.materials.sheet import Sheet
from perfplast_fenicsx.spatial_fields import Strength


@dataclass(frozen=True)
class VonMisesSet:
    """The yield set ‖dev σ‖ ≤ γ; :class:`YieldSet` describes the methods.

    Args:
        radius: γ (stress).
    """

    radius: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return ‖dev s‖/γ."""
        return _size(deviator(s)) / self.radius

    def support(self, rate: Expr) -> Expr:
        """Return γ‖dev rate‖."""
        return self.radius * _size(deviator(rate))

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """Return one cone with zero slope."""
        return (axial_cone(self.radius, 0.0, size),)

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the spherical part of the rate."""
        return spherical(trace(rate) / 3, len(rate))


@dataclass(frozen=True)
class FirstYield(Law):
    """Base class for laws that first yield at ‖dev σ‖ = γ; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        yield_radius: γ (stress).
    """

    bulk: Expr
    shear: Expr
    yield_radius: Expr

    @property
    def elastic(self) -> IsotropicElasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}[d] from the fields of :meth:`VonMisesLaw.tangent_fields`."""
        a, normal = stored["a"], stored["N"]
        pressure = spherical(self.bulk * trace(d), len(d))
        return pressure + a * deviator(d) - ufl.dot(normal, d) * normal

    @property
    def yields(self) -> VonMisesSet:
        """Return the set ‖dev σ‖ ≤ γ."""
        return VonMisesSet(self.yield_radius)


@dataclass(frozen=True)
class VonMisesLaw(FirstYield):
    """The law of the yield set ‖dev σ‖ ≤ γ; :class:`Law` describes the methods."""

    projects: ClassVar[bool] = True

    def overstress(self, e: Expr) -> Expr:
        """Return 2μ‖dev e‖/γ; the point is plastic if this value exceeds 1."""
        return 2 * self.shear * _size(deviator(e)) / self.yield_radius

    def secant(self, e: Expr) -> Expr:
        """Return θ in (0, 1], the ratio of the returned to the elastic deviatoric stress."""
        return 1 / ufl.max_value(1.0, self.overstress(e))

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        return ufl.conditional(ufl.gt(self.overstress(e), 1.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of ψ."""
        scaled = 2 * self.shear * self.secant(e) * deviator(e)
        return spherical(self.bulk * trace(e), len(e)) + scaled

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e)."""
        d, theta = deviator(e), self.secant(e)
        volumetric = self.bulk * trace(e) ** 2 / 2
        return volumetric + self.shear * theta * (2 - theta) * ufl.dot(d, d)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def flow(self, e: Expr) -> Expr:
        """Return the plastic strain (1 − θ) dev e, 0 for elastic strains e."""
        return (1 - self.secant(e)) * deviator(e)

    def direction(self, e: Expr) -> Expr:
        """Return n̂ = dev e/‖dev e‖ for plastic strains, else 0.

        The expression does not divide by zero at e = 0.
        """
        d = deviator(e)
        least = self.yield_radius / (2 * self.shear)
        return self.plastic(e, {}) * d / ufl.max_value(_size(d), least)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return a, shape (), and N, shape (m,): Σ^{o,ρ}(e)[d] = κ tr(d) δ + a dev d − (N:d)N."""
        theta = self.secant(e)
        root = ufl.sqrt(2 * self.shear * (1 - rho) * theta)
        return {
            "a": 2 * self.shear * (rho + (1 - rho) * theta),
            "N": root * self.direction(e),
        }


def _size(d: Expr) -> Expr:
    return ufl.sqrt(ufl.dot(d, d))


@dataclass(frozen=True)
class VonMises:
    """An elastic–perfectly plastic body with von Mises' condition ‖dev σ‖ ≤ γ = √(2/3) σ_y.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Uniaxial yield stress σ_y > 0 (stress), a number or a field.
        expansion: Thermal strain per degree (1/temperature).
        reduced: Whether F of ``control = "strength"`` divides the strength; true by default.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    yield_stress: Strength
    expansion: float = 0.0
    reduced: bool = True

    @property
    def law(self) -> type[VonMisesLaw]:
        """Return the class of the law."""
        return VonMisesLaw

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("yield_stress", self.yield_stress)

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    @property
    def yield_radius(self) -> Strength:
        """Return γ = √(2/3) σ_y."""
        return math.sqrt(2 / 3) * self.yield_stress

    def divided_by(self, factor: float) -> "VonMises":
        """Return the same body with σ_y/F.

        Args:
            factor: F > 0.
        """
        return replace(self, yield_stress=self.yield_stress / factor)

    def in_plane_stress(self) -> Sheet:
        """Return the sheet with σ_xx² − σ_xx σ_yy + σ_yy² + 3τ² ≤ (yield stress)²."""
        form = np.array([[1.0, -0.5, 0.0], [-0.5, 1.0, 0.0], [0.0, 0.0, 1.5]])
        return Sheet(self.bulk, self.shear, self.yield_stress, form)

    def parameters(self) -> dict[str, Strength]:
        """Return κ, μ and γ of :class:`VonMisesLaw`."""
        return {"bulk": self.bulk, "shear": self.shear, "yield_radius": self.yield_radius}
