r"""Linear hardening with the condition of von Mises, in Hencky's form.

With h = ⅔H for a modulus H of hardening, a body that hardens is an elastic one and a perfectly
plastic one side by side, of which the elastic one has the share s = h/(2μ + h):

    Σ(e)  = sCe + (1 − s)Σ_p(e)
    ψ(e)  = ½ s e:Ce + (1 − s)ψ_p(e)
    ψ*(τ) = ½ τ:C⁻¹τ + max(0, ‖dev τ‖ − γ)²/(2h)

So the tangent is that of perfect plasticity with another ρ. In a single step from the virgin body
isotropic and kinematic hardening are the same; in a history they differ (:mod:`plastic_flow`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.materials.law import Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.von_mises import FirstYield, VonMises, VonMisesLaw


@dataclass(frozen=True)
class HardeningLaw(FirstYield):
    """Whose stress grows beyond ‖dev σ‖ = γ; see :class:`Law` for the methods.

    Args:
        isotropic: ⅔H of the yield stress that grows (stress), not negative.
        kinematic: ⅔H of the back stress (stress), not negative; one of both is positive.
    """

    isotropic: Expr
    kinematic: Expr
    projects: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = True

    @property
    def perfect(self) -> VonMisesLaw:
        """The law without hardening."""
        return VonMisesLaw(self.bulk, self.shear, self.yield_radius)

    @property
    def hardening(self) -> Expr:
        """The modulus h of both kinds together."""
        return self.isotropic + self.kinematic

    @property
    def share(self) -> Expr:
        """The elastic body's share s = h/(2μ + h), in (0, 1)."""
        return self.hardening / (2 * self.shear + self.hardening)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Σ(e)."""
        return self.share * self.elastic.hooke(e) + (1 - self.share) * self.perfect.stress(e, old)

    def potential(self, e: Expr, old: Old) -> Expr:
        """ψ(e)."""
        elastic = ufl.dot(self.elastic.hooke(e), e) / 2
        return self.share * elastic + (1 - self.share) * self.perfect.potential(e, old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """ψ*(s)."""
        beyond = self.yield_radius * ufl.max_value(0.0, self.yields.gauge(s) - 1)
        return self.perfect.conjugate(s, old) + beyond**2 / (2 * self.hardening)

    def plastic(self, e: Expr, old: Old) -> Expr:
        """1 where e lies outside the elastic range, else 0."""
        return self.perfect.plastic(e, old)

    def flow(self, e: Expr) -> Expr:
        """The plastic strain of a strain."""
        return (1 - self.share) * self.perfect.flow(e)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Those of perfect plasticity, with ρ + (1 − ρ)s for ρ."""
        return self.perfect.tangent_fields(e, old, rho + (1 - rho) * self.share)


@dataclass(frozen=True)
class Hardening:
    """A body with the von Mises condition and linear hardening; it has no limit load.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Uniaxial yield stress σ_y > 0 at first.
        isotropic: Growth H of the yield stress with the equivalent plastic strain (stress).
        kinematic: Growth H of the back stress with the plastic strain (stress), in uniaxial stress:
            the yield stress moves on in one direction, and back in the other.
        expansion: Strain of a change of temperature by one degree (1/temperature).

    Raises:
        InputError: If a number is out of its range, or neither hardening is positive.
    """

    law: ClassVar[type[HardeningLaw]] = HardeningLaw

    young: float
    poisson: float
    yield_stress: float
    isotropic: float = 0.0
    kinematic: float = 0.0
    expansion: float = 0.0

    def __post_init__(self) -> None:
        VonMises(self.young, self.poisson, self.yield_stress, self.expansion)
        for field in ("isotropic", "kinematic"):
            value = getattr(self, field)
            if not (value >= 0 and math.isfinite(value)):
                raise InputError(
                    f"{field} = {value} is no modulus of hardening; give a number >= 0 in stress"
                    " units (softening is not possible)."
                )
            check_magnitude(field, value)
        if not self.isotropic + self.kinematic > 0:
            raise InputError(
                "isotropic and kinematic hardening are both zero; give one of them, or law ="
                " 'von-mises'."
            )

    def parameters(self) -> dict[str, float]:
        """Those of :class:`VonMisesLaw`, and ⅔H of both kinds."""
        perfect = VonMises(self.young, self.poisson, self.yield_stress).parameters()
        return perfect | {"isotropic": 2 / 3 * self.isotropic, "kinematic": 2 / 3 * self.kinematic}
