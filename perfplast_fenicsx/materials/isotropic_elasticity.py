"""Define Hooke's tensor C of an isotropic body, and its inverse.

The expressions are UFL at a point.
"""

from dataclasses import dataclass

from perfplast_fenicsx.materials.mandel import Expr, deviator, spherical, trace


@dataclass(frozen=True)
class IsotropicElasticity:
    """C e = κ tr(e) δ + 2μ dev e.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
    """

    bulk: Expr
    shear: Expr

    def hooke(self, e: Expr) -> Expr:
        """Return C e."""
        return spherical(self.bulk * trace(e), len(e)) + 2 * self.shear * deviator(e)

    def compliance(self, s: Expr) -> Expr:
        """Return C⁻¹ s."""
        return spherical(trace(s) / (9 * self.bulk), len(s)) + deviator(s) / (2 * self.shear)
