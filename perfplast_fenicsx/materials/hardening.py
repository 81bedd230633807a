"""Define a metal with von Mises' condition and linear hardening.

The first law has Hencky's form. Let h = ⅔H for a hardening modulus H. A body that hardens is
equivalent to an elastic body and a perfectly plastic body in parallel. The elastic body carries the
share s = h/(2μ + h):

    Σ(e)  = sCe + (1 − s)Σ_p(e)
    ψ(e)  = ½ s e:Ce + (1 − s)ψ_p(e)
    ψ*(τ) = ½ τ:C⁻¹τ + max(0, ‖dev τ‖ − γ)²/(2h)

The tangent is therefore the tangent of perfect plasticity with another ρ. In a single step from the
virgin body, isotropic and kinematic hardening give the same result; in a history their results
differ.

The second law describes plastic flow step by step. A step (implicit Euler) starts from the plastic
strain p, the accumulated plastic strain p̄ and the back stress χ = ⅔H_k p. The step is Hencky's law
with a shifted strain (:mod:`plastic_flow`). With q = p + χ/(2μ), and with the radius γ + √⅔ H_i p̄
instead of γ,

    Σ(e)  = Σ_H(e − q) + χ
    ψ(e)  = ψ_H(e − q) + χ:e + μ(‖p‖² − ‖q‖²)
    ψ*(s) = ψ_H*(s − χ) + (s − χ):q − μ(‖p‖² − ‖q‖²)
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.materials.law import Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.plastic_flow import ACCUMULATED, STRAIN, Flow, Step
from perfplast_fenicsx.materials.von_mises import FirstYield, VonMises, VonMisesLaw


@dataclass(frozen=True)
class HardeningLaw(FirstYield):
    """Hencky's law for hardening from ‖dev σ‖ = γ on; :class:`Law` describes the methods.

    Args:
        isotropic: ⅔H of isotropic hardening (stress), not negative.
        kinematic: ⅔H of kinematic hardening (stress), not negative. At least one of the two moduli
            is positive.
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
        """Return the sum h of the isotropic and kinematic moduli."""
        return self.isotropic + self.kinematic

    @property
    def share(self) -> Expr:
        """Return the share s = h/(2μ + h) of the elastic body, in (0, 1)."""
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
        """Return the plastic strain of the virgin body at the strain e."""
        return (1 - self.share) * self.perfect.flow(e)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields of perfect plasticity, with ρ + (1 − ρ)s instead of ρ."""
        return self.perfect.tangent_fields(e, old, rho + (1 - rho) * self.share)


@dataclass(frozen=True)
class HardeningFlowLaw(Step, FirstYield):
    """Plastic flow with linear hardening, step by step; :class:`Law` describes the methods.

    Args:
        isotropic: ⅔H_i (stress), not negative.
        kinematic: ⅔H_k (stress), not negative. At least one of the two moduli is positive.
    """

    isotropic: Expr
    kinematic: Expr
    projects: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = True

    def hencky(self, old: Old) -> HardeningLaw:
        """Return Hencky's law with the radius γ + √⅔ H_i p̄."""
        radius = self.yield_radius + math.sqrt(3 / 2) * self.isotropic * old[ACCUMULATED]
        return HardeningLaw(self.bulk, self.shear, radius, self.isotropic, self.kinematic)

    def shifted(self, e: Expr, old: Old) -> Expr:
        """Return the strain e − q, the argument of Hencky's law."""
        return e - self._centre(old)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e)."""
        return super().stress(e, old) + self._back_stress(old)

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e)."""
        return super().potential(e, old) + ufl.dot(self._back_stress(old), e) + self._offset(old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ψ*(s)."""
        rest = s - self._back_stress(old)
        shift = ufl.dot(rest, self._centre(old))
        return self.hencky(old).conjugate(rest, {}) + shift - self._offset(old)

    def _back_stress(self, old: Old) -> Expr:
        """Return χ = ⅔H_k p."""
        return self.kinematic * old[STRAIN]

    def _centre(self, old: Old) -> Expr:
        """Return q, the centre of the elastic strains."""
        return old[STRAIN] + self._back_stress(old) / (2 * self.shear)

    def _offset(self, old: Old) -> Expr:
        """Return μ(‖p‖² − ‖q‖²), the term that makes ψ(e) the energy of the step."""
        p, q = old[STRAIN], self._centre(old)
        return self.shear * (ufl.dot(p, p) - ufl.dot(q, q))


@dataclass(frozen=True)
class Hardening:
    """A body with von Mises' condition and linear hardening, which has no limit load.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Initial uniaxial yield stress σ_y > 0 (stress).
        isotropic: Isotropic modulus H (stress): increase of the yield stress per equivalent plastic
            strain.
        kinematic: Kinematic modulus H (stress): increase of the back stress per plastic strain, in
            uniaxial stress. The yield stress rises in one direction and falls in the opposite
            direction.
        expansion: Thermal strain per degree (1/temperature).

    Raises:
        InputError: If a number is out of its range, or if neither modulus is positive.
    """

    flow_law: ClassVar[type[HardeningFlowLaw]] = HardeningFlowLaw

    young: float
    poisson: float
    yield_stress: float
    isotropic: float = 0.0
    kinematic: float = 0.0
    expansion: float = 0.0

    @property
    def law(self) -> type[HardeningLaw]:
        """Return the class of the law."""
        return HardeningLaw

    def __post_init__(self) -> None:
        VonMises(self.young, self.poisson, self.yield_stress, self.expansion)
        for field in ("isotropic", "kinematic"):
            value = getattr(self, field)
            if not (value >= 0 and math.isfinite(value)):
                raise InputError(
                    f"{field} = {value} is not a valid hardening modulus; give a number >= 0 in"
                    " stress units (softening is not possible)."
                )
            check_magnitude(field, value)
        if not self.isotropic + self.kinematic > 0:
            raise InputError(
                "isotropic and kinematic hardening are both zero; give one of them, or law ="
                " 'von-mises'."
            )

    def parameters(self) -> dict[str, float]:
        """Return the parameters of :class:`VonMisesLaw` and the two moduli ⅔H."""
        perfect = VonMises(self.young, self.poisson, self.yield_stress).parameters()
        return perfect | {"isotropic": 2 / 3 * self.isotropic, "kinematic": 2 / 3 * self.kinematic}

    def remembering(self) -> Flow:
        """Return the material with plastic flow, for a history."""
        return Flow(self)
