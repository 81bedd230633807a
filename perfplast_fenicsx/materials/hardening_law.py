r"""Linear hardening with the condition of von Mises, in Hencky's form.

With h = ⅔H for a modulus H of hardening, a body that hardens is an elastic one and a perfectly
plastic one side by side, of which the elastic one has the share s = h/(2μ + h):

    Σ(e)  = sCe + (1 − s)Σ_p(e)
    ψ(e)  = ½ s e:Ce + (1 − s)ψ_p(e)
    ψ*(τ) = ½ τ:C⁻¹τ + max(0, ‖dev τ‖ − γ)²/(2h)

So the tangent is that of perfect plasticity with another ρ. In a single step from the virgin body
isotropic and kinematic hardening are the same; in a history they differ (:mod:`hardening_flow`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.materials.law import Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.von_mises import FirstYield, VonMisesLaw


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
        """Return the plastic strain of a strain."""
        return (1 - self.share) * self.perfect.flow(e)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return those of perfect plasticity, with ρ + (1 − ρ)s for ρ."""
        return self.perfect.tangent_fields(e, old, rho + (1 - rho) * self.share)
