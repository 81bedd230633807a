"""Define Hooke's tensor of an isotropic sheet, σ_zz = 0, and its inverse in the plane.

The expressions are UFL at a point.

Vectors have the four components of the plane (:mod:`mandel`). The component across the plane is
zero for stresses and ignored for strains, since the thickness of bodies is free to change.
"""

from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.mandel import Expr


@dataclass(frozen=True)
class SheetElasticity:
    """C e = λ'(e_xx + e_yy) δ' + 2μ e in the plane, λ' = 2μ(3κ − 2μ)/(3κ + 4μ).

    Args:
        bulk: κ (stress), of the body in space.
        shear: μ (stress).
    """

    bulk: Expr
    shear: Expr

    @property
    def _lame(self) -> Expr:
        return 2 * self.shear * (3 * self.bulk - 2 * self.shear) / self._across

    @property
    def _across(self) -> Expr:
        return 3 * self.bulk + 4 * self.shear

    def hooke(self, e: Expr) -> Expr:
        """Return C e."""
        mean = self._lame * (e[0] + e[1])
        return _flat(2 * self.shear, e, mean)

    def compliance(self, s: Expr) -> Expr:
        """Return C⁻¹ s, zero across the plane."""
        share = self._lame / (4 * self.shear * (self._lame + self.shear))
        return _flat(1 / (2 * self.shear), s, -share * (s[0] + s[1]))


def _flat(factor: Expr, x: Expr, mean: Expr) -> Expr:
    return ufl.as_vector([factor * x[0] + mean, factor * x[1] + mean, 0.0, factor * x[3]])
