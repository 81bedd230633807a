r"""Define linear hardening with von Mises' condition, in Hencky's form.

With h = ⅔H for a modulus H of hardening, a body that hardens is a parallel connection of an elastic
and a perfectly plastic body. The elastic body has the share s = h/(2μ + h):

    Σ(e)  = sCe + (1 − s)Σ_p(e)
    ψ(e)  = ½ s e:Ce + (1 − s)ψ_p(e)
    ψ*(τ) = ½ τ:C⁻¹τ + max(0, ‖dev τ‖ − γ)²/(2h)

So the tangent is that of perfect plasticity with another ρ. In a single step from the virgin body,
isotropic and kinematic hardening give the same result; in a history they differ
(:mod:`hardening_flow`).
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
    """The law of a body whose stress grows beyond ‖dev σ‖ = γ; see :class:`Law` for the methods.

    Args:
        isotropic: ⅔H of isotropic hardening (stress), not negative.
        kinematic: ⅔H of kinematic hardening (stress), not negative; at least one of both is
            positive.
    """

    isotropic: Expr
    kinematic: Expr
    projects: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = True

    @property
    def perfect(self) -> VonMisesLaw:
        """Return the law without hardening."""
        return VonMisesLaw(self.bulk, self.shear, self.yield_radius)

    @property
    def hardening(self) -> Expr:
        """Return the modulus h of both kinds together."""
        return self.isotropic + self.kinematic

    @property
    def share(self) -> Expr:
        """Return the elastic body's share s = h/(2μ + h), in (0, 1)."""
        return self.hardening / (2 * self.shear + self.hardening)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e)."""
        return self.share * self.elastic.hooke(e) + (1 - self.share) * self.perfect.stress(e, old)

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e)."""
        elastic = ufl.dot(self.elastic.hooke(e), e) / 2
        return self.share * elastic + (1 - self.share) * self.perfect.potential(e, old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ψ*(s)."""
        beyond = self.yield_radius * ufl.max_value(0.0, self.yields.gauge(s) - 1)
        return self.perfect.conjugate(s, old) + beyond**2 / (2 * self.hardening)

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        return self.perfect.plastic(e, old)

    def flow(self, e: Expr) -> Expr:
        """Return the plastic strain of a strain."""
        return (1 - self.share) * self.perfect.flow(e)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields of perfect plasticity, with ρ + (1 − ρ)s instead of ρ."""
        return self.perfect.tangent_fields(e, old, rho + (1 - rho) * self.share)
