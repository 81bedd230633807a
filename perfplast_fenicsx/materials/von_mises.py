r"""The law: Hooke's tensor C, the potential ψ, its derivative Σ and the tangents Σ°, Σ^{o,ρ}.

Everything here is UFL: no mesh, no MPI, no arrays. Strains and stresses are Mandel vectors
(:mod:`mandel`).

With θ = 1 / max(1, 2μ‖dev e‖/γ), which is 1 exactly on the elastic branch and needs neither a
condition nor a division by ‖dev e‖,

    Σ(e)     = κ tr(e) δ + 2μθ dev e
    ψ(e)     = ½ κ tr(e)² + μ θ(2 − θ) ‖dev e‖²
    Σ°(e)[d] = κ tr(d) δ + 2μθ (dev d − (n̂:d) n̂),   n̂ = dev e/‖dev e‖ where plastic, 0 elsewhere

(Section 2 of Čermák, Haslinger, Sysala, COMPLAS XII, 2013). An elastic body has γ = ∞.
"""

import math
from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.mandel import Expr, deviator, spherical, trace


@dataclass(frozen=True)
class Moduli:
    """The three numbers of the law at a point, as UFL: κ, μ (stress) and γ (stress, ∞: elastic)."""

    bulk: Expr
    shear: Expr
    yield_radius: Expr

    def overstress(self, e: Expr) -> Expr:
        """2μ‖dev e‖/γ: above 1 the point is plastic."""
        d = deviator(e)
        return 2 * self.shear * ufl.sqrt(ufl.dot(d, d)) / self.yield_radius

    def secant(self, e: Expr) -> Expr:
        """θ in (0, 1]: the share of the elastic deviatoric stress that the yield set admits."""
        return 1 / ufl.max_value(1.0, self.overstress(e))

    def plastic(self, e: Expr) -> Expr:
        """1 where e lies outside the elastic range, else 0."""
        return ufl.conditional(ufl.gt(self.overstress(e), 1.0), 1.0, 0.0)

    def hooke(self, e: Expr) -> Expr:
        """C e."""
        return spherical(self.bulk * trace(e), len(e)) + 2 * self.shear * deviator(e)

    def compliance(self, s: Expr) -> Expr:
        """C⁻¹ s."""
        return spherical(trace(s) / (9 * self.bulk), len(s)) + deviator(s) / (2 * self.shear)

    def stress(self, e: Expr) -> Expr:
        """Σ(e), the derivative of ψ."""
        scaled = 2 * self.shear * self.secant(e) * deviator(e)
        return spherical(self.bulk * trace(e), len(e)) + scaled

    def potential(self, e: Expr) -> Expr:
        """ψ(e), energy per volume."""
        d, theta = deviator(e), self.secant(e)
        volumetric = self.bulk * trace(e) ** 2 / 2
        return volumetric + self.shear * theta * (2 - theta) * ufl.dot(d, d)

    def may_yield(self) -> Expr:
        """Condition that the body has a yield stress: γ is not ∞."""
        return ufl.gt(1 / self.yield_radius, 0.0)

    def dissipation(self, e: Expr) -> Expr:
        """γ‖dev e‖, the plastic power of a strain rate e; 0 in elastic bodies."""
        d = deviator(e)
        power = self.yield_radius * ufl.sqrt(ufl.dot(d, d))
        return ufl.conditional(self.may_yield(), power, 0.0)

    def direction(self, e: Expr) -> Expr:
        """n̂ = dev e/‖dev e‖ where plastic, else 0. No division by zero at e = 0."""
        d = deviator(e)
        least = self.yield_radius / (2 * self.shear)
        return self.plastic(e) * d / ufl.max_value(ufl.sqrt(ufl.dot(d, d)), least)

    def tangent_data(self, e: Expr, rho: Expr) -> tuple[Expr, Expr]:
        """What Σ^{o,ρ} = ρC + (1 − ρ)Σ° needs beside κ.

        Returns:
            a (scalar) and N (Mandel vector), with
            Σ^{o,ρ}(e)[d] = κ tr(d) δ + a dev d − (N:d) N.
        """
        theta = self.secant(e)
        a = 2 * self.shear * (rho + (1 - rho) * theta)
        root = ufl.sqrt(2 * self.shear * (1 - rho) * theta)
        return a, root * self.direction(e)


def tangent(bulk: Expr, a: Expr, normal: Expr, d: Expr) -> Expr:
    """Σ^{o,ρ}[d] from the data of :meth:`Moduli.tangent_data`."""
    return spherical(bulk * trace(d), len(d)) + a * deviator(d) - ufl.dot(normal, d) * normal


@dataclass(frozen=True)
class VonMises:
    """An elastic–perfectly plastic body with the von Mises condition ‖dev σ‖ ≤ γ = √(2/3) σ_y.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Uniaxial yield stress σ_y > 0.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    yield_stress: float

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson)
        require_positive("yield_stress", self.yield_stress)

    @property
    def bulk(self) -> float:
        """κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    @property
    def yield_radius(self) -> float:
        """γ = √(2/3) σ_y."""
        return math.sqrt(2 / 3) * self.yield_stress
