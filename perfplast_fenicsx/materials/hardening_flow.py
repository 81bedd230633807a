r"""Define plastic flow with linear hardening and von Mises' condition.

A step (implicit Euler) starts from the plastic strain p, the accumulated plastic strain p̄ and the
back stress χ = ⅔H_k p. It is Hencky's law with a shifted strain (:mod:`plastic_flow`). With q = p +
χ/(2μ) and the radius γ + √⅔ H_i p̄ instead of γ

    Σ(e)  = Σ_H(e − q) + χ
    ψ(e)  = ψ_H(e − q) + χ:e + μ(‖p‖² − ‖q‖²)
    ψ*(s) = ψ_H*(s − χ) + (s − χ):q − μ(‖p‖² − ‖q‖²)
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.materials.hardening_law import HardeningLaw
from perfplast_fenicsx.materials.law import Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.plastic_flow import ACCUMULATED, STRAIN, Step
from perfplast_fenicsx.materials.von_mises import FirstYield


@dataclass(frozen=True)
class HardeningFlowLaw(Step, FirstYield):
    """Plastic flow with linear hardening, step by step; see :class:`Law` for the methods.

    Args:
        isotropic: ⅔H_i (stress), not negative.
        kinematic: ⅔H_k (stress), not negative; at least one of both is positive.
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
        """Return the term that makes ψ(e) the energy of the step: μ(‖p‖² − ‖q‖²)."""
        p, q = old[STRAIN], self._centre(old)
        return self.shear * (ufl.dot(p, p) - ufl.dot(q, q))
