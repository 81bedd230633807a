r"""Plastic flow with the condition of von Mises: a step of Prandtl's and Reuss' law.

A step (implicit Euler) from the plastic strain p, the accumulated plastic strain p̄ and the back
stress χ = ⅔H_k p is Hencky's law, shifted. With q = p + χ/(2μ) and the radius
γ + √⅔ H_i p̄ in place of γ

    Σ(e)  = Σ_H(e − q) + χ
    ψ(e)  = ψ_H(e − q) + χ:e + μ(‖p‖² − ‖q‖²)
    ψ*(s) = ψ_H*(s − χ) + (s − χ):q − μ(‖p‖² − ‖q‖²)

where ψ is the energy that the step stores and dissipates, and ½ e:Ce of e − p where it is elastic.
Without hardening q = p, χ = 0, and ψ*(s) = ½ s:C⁻¹s + s:p.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import ufl

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.hardening import Hardening, HardeningLaw
from perfplast_fenicsx.materials.law import Law, Material, Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.von_mises import FirstYield, VonMises, VonMisesLaw

STRAIN, ACCUMULATED = "plastic_strain", "accumulated_plastic_strain"
"""The history: p as a Mandel vector, and p̄ = ∫√⅔‖dp‖, which in uniaxial stress is ∫|dε^p|."""


class Step(Law, Protocol):
    """A step of flow; see :class:`Law` for the methods.

    Attributes:
        shear: μ (stress).
    """

    shear: Expr
    projects: ClassVar[bool] = False

    @abstractmethod
    def hencky(self, old: Old) -> VonMisesLaw | HardeningLaw:
        """The law of total strain with the radius that the yield set has now."""
        ...

    @abstractmethod
    def back_stress(self, old: Old) -> Expr | None:
        """χ, or None without kinematic hardening."""
        ...

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """The shapes of p and p̄, zero at first."""
        return {STRAIN: (m,), ACCUMULATED: ()}

    def shifted(self, e: Expr, old: Old) -> Expr:
        """The strain e − q that Hencky's law sees."""
        chi = self.back_stress(old)
        seen = e - old[STRAIN]
        return seen if chi is None else seen - chi / (2 * self.shear)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Σ(e)."""
        chi, stress = self.back_stress(old), self.hencky(old).stress(self.shifted(e, old), {})
        return stress if chi is None else stress + chi

    def potential(self, e: Expr, old: Old) -> Expr:
        """ψ(e)."""
        chi, energy = self.back_stress(old), self.hencky(old).potential(self.shifted(e, old), {})
        return energy if chi is None else energy + ufl.dot(chi, e) + self._offset(chi, old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """ψ*(s)."""
        law, p, chi = self.hencky(old), old[STRAIN], self.back_stress(old)
        if chi is None:
            return law.conjugate(s, {}) + ufl.dot(s, p)
        rest = s - chi
        shift = ufl.dot(rest, p + chi / (2 * self.shear))
        return law.conjugate(rest, {}) + shift - self._offset(chi, old)

    def plastic(self, e: Expr, old: Old) -> Expr:
        """1 where the step flows, else 0."""
        return self.hencky(old).plastic(self.shifted(e, old), {})

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Those of Hencky's law."""
        return self.hencky(old).tangent_fields(self.shifted(e, old), {}, rho)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """What p and p̄ are behind the step."""
        flow = self.hencky(old).flow(self.shifted(e, old))
        more = math.sqrt(2 / 3) * ufl.sqrt(ufl.dot(flow, flow))
        return {STRAIN: old[STRAIN] + flow, ACCUMULATED: old[ACCUMULATED] + more}

    def _offset(self, chi: Expr, old: Old) -> Expr:
        """What makes ψ(e) the energy of the step: μ(‖p‖² − ‖q‖²)."""
        return -ufl.dot(chi, old[STRAIN] + chi / (4 * self.shear))


@dataclass(frozen=True)
class FlowLaw(FirstYield, Step):
    """Perfect plasticity, step by step."""

    projects: ClassVar[bool] = True

    @property
    def perfect(self) -> VonMisesLaw:
        """The law of total strain."""
        return VonMisesLaw(self.bulk, self.shear, self.yield_radius)

    def hencky(self, old: Old) -> VonMisesLaw | HardeningLaw:
        """It does not change."""
        return self.perfect

    def back_stress(self, old: Old) -> Expr | None:
        """None."""
        return None

    def unstressed(self, old: Old) -> Expr | None:
        """What has flowed."""
        return old[STRAIN]


@dataclass(frozen=True)
class HardeningFlowLaw(FlowLaw):
    """Plastic flow with linear hardening, step by step.

    Args:
        isotropic: ⅔H_i (stress), not negative.
        kinematic: ⅔H_k (stress), not negative; one of both is positive.
    """

    isotropic: Expr
    kinematic: Expr
    projects: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = True

    def hencky(self, old: Old) -> VonMisesLaw | HardeningLaw:
        """With the radius γ + √⅔ H_i p̄."""
        radius = self.yield_radius + math.sqrt(3 / 2) * self.isotropic * old[ACCUMULATED]
        return HardeningLaw(self.bulk, self.shear, radius, self.isotropic, self.kinematic)

    def back_stress(self, old: Old) -> Expr | None:
        """⅔H_k p."""
        return self.kinematic * old[STRAIN]


@dataclass(frozen=True)
class Flow:
    """A body that remembers its plastic flow: what is loaded, unloaded and loaded again.

    Without it a body follows Hencky's law, and each level is one step from the virgin body.

    Args:
        body: Its numbers.

    Raises:
        InputError: If the body is none of these two.
    """

    body: VonMises | Hardening

    def __post_init__(self) -> None:
        if not isinstance(self.body, VonMises | Hardening):
            raise InputError(
                f"{self.body!r} has no plastic flow to be remembered; give VonMises or Hardening."
            )

    @property
    def law(self) -> type[FlowLaw]:
        """With hardening or without."""
        return HardeningFlowLaw if isinstance(self.body, Hardening) else FlowLaw

    @property
    def expansion(self) -> float:
        """Strain of a change of temperature by one degree (1/temperature)."""
        return self.body.expansion

    def parameters(self) -> dict[str, float]:
        """Those of the body."""
        return self.body.parameters()


def with_memory(material: Material) -> Material | None:
    """A body that remembers its plastic flow, an elastic one as it is; None if it cannot."""
    if isinstance(material, VonMises | Hardening):
        return Flow(material)
    return material if isinstance(material, Elastic | Flow) else None
