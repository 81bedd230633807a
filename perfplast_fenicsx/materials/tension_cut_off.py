r"""Define associated Mohr–Coulomb or Tresca plasticity with a tensile strength, in Hencky's form.

The yield set is (1 + s)σ₁ − (1 − s)σ₃ ≤ b and σ₁ ≤ f for principal stresses σ₁ ≥ σ₂ ≥ σ₃. The
tensile strength f is below the apex b/2s of the first condition. A stress is the projection of Ce
in the norm of C⁻¹. If the projection onto the set of one condition satisfies the other condition,
this projection is the result. If neither projection does, both conditions are active: σ₁ = f,
σ₃ = r = ((1 + s)f − b)/(1 − s), and σ₂ is the nearest value in [r, f].
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.materials.coulomb_cone import CutOffSet
from perfplast_fenicsx.materials.law import Old
from perfplast_fenicsx.materials.mandel import Expr, trace
from perfplast_fenicsx.materials.mohr_coulomb import MohrCoulombLaw
from perfplast_fenicsx.materials.principal_axes import principal_axes


@dataclass(frozen=True)
class CutOffLaw(MohrCoulombLaw):
    """The law of (1 + s)σ₁ − (1 − s)σ₃ ≤ b and σ₁ ≤ f; :class:`Law` describes the methods.

    Args:
        tension: f > 0 (stress).
    """

    tension: Expr
    dilates: ClassVar[bool] = True

    @property
    def _lowest(self) -> Expr:
        """Return r, the smallest admissible σ₃ if σ₁ = f."""
        return ((1 + self.sine) * self.tension - self.strength) / (1 - self.sine)

    def _sheared(self, most: Expr, least: Expr) -> Expr:
        return (1 + self.sine) * most - (1 - self.sine) * least - self.strength

    @property
    def _plain(self) -> MohrCoulombLaw:
        """Return the law without the tensile strength."""
        return MohrCoulombLaw(self.bulk, self.shear, self.sine, self.strength)

    def _trial(self, e: Expr) -> list[Expr]:
        """Return the principal values of Ce in descending order."""
        mean = self._lame * trace(e)
        return [mean + 2 * self.shear * w for w in principal_axes(e).ordered]

    def excess(self, e: Expr) -> Expr:
        """Return the larger of the excesses of Ce over the limits of both conditions (stress)."""
        most, _, least = self._trial(e)
        return ufl.max_value(self._sheared(most, least), most - self.tension)

    def _cut(self, e: Expr) -> tuple[list[Expr], Expr, Expr]:
        """Return the principal stresses of the projection onto σ₁ ≤ f, and two flags.

        The first flag marks places where at least two principal stresses are f, the second flag
        places where all are f.
        """
        f, lame = self.tension, self._lame
        first, second, third = self._trial(e)
        one = ufl.max_value(first - f, 0.0) / (lame + 2 * self.shear)
        two = (first + second - 2 * f) / (2 * (lame + self.shear))
        of_one = [first - (lame + 2 * self.shear) * one, second - lame * one, third - lame * one]
        of_two = [f, f, third - lame * two]
        edge = ufl.gt(of_one[1], f)
        tip = ufl.And(edge, ufl.gt(of_two[2], f))
        found = [
            ufl.conditional(tip, f, ufl.conditional(edge, a, b))
            for a, b in zip(of_two, of_one, strict=True)
        ]
        return found, edge, tip

    def _middle(self, e: Expr) -> Expr:
        """Return the σ₂ nearest to Ce for σ₁ = f and σ₃ = r; it may lie outside [r, f]."""
        first, second, third = self._trial(e)
        poisson = self._lame / (2 * (self._lame + self.shear))
        return second + poisson * (self.tension + self._lowest - first - third)

    def _by_kind(self, e: Expr, coulomb: Expr, cut: Sequence[Expr], both: Sequence[Expr]) -> Expr:
        """Return the value of the active case: ``coulomb``, one of ``cut``, or one of ``both``.

        Args:
            e: The strain.
            coulomb: Value if no condition other than the Mohr–Coulomb condition is active.
            cut: Values if only the tensile strength is active: for σ₁, for σ₁ and σ₂, for all three
                stresses.
            both: Values if both conditions are active: for r < σ₂ < f, and for σ₂ equal to r or f.
        """
        (first, _, third), edge, tip = self._cut(e)
        f, middle = self.tension, self._middle(e)
        between = ufl.And(ufl.gt(middle, self._lowest), ufl.lt(middle, f))
        of_both = ufl.conditional(between, both[0], both[1])
        of_cut = ufl.conditional(tip, cut[2], ufl.conditional(edge, cut[1], cut[0]))
        alone = ufl.le(self._sheared(first, third), 0.0)
        rest = ufl.conditional(alone, of_cut, of_both)
        return ufl.conditional(ufl.le(self._plain._returned(e)[0], f), coulomb, rest)

    def _returned(self, e: Expr) -> list[Expr]:
        """Return the principal stresses of Σ(e) in descending order."""
        (cut, *_), low, f = self._cut(e), self._lowest, self.tension
        middle = ufl.max_value(ufl.min_value(self._middle(e), f), low)
        return [
            self._by_kind(e, a, [b, b, b], [c, c])
            for a, b, c in zip(self._plain._returned(e), cut, (f, middle, low), strict=True)
        ]

    def _lost(self, e: Expr, stresses: Expr, strains: Expr) -> Expr:
        """Return the reduction of 2μ for rotating axes at yield; 0 if all stresses are f."""
        lost = self._turned(stresses, strains)
        without = super()._lost(e, stresses, strains)
        return self._by_kind(e, without, [lost, lost, 0.0], [lost, lost])

    def _keeps(self, e: Expr) -> Expr:
        """Return 0 if all principal stresses are f, else 1."""
        return self._by_kind(e, super()._keeps(e), [1.0, 1.0, 0.0], [1.0, 1.0])

    def _merged(self, e: Expr) -> list[Expr]:
        """Return U/√μ on the axes of σ₁, σ₂ and σ₃."""
        own = (0.0, 1.0, 1.0, 1.0), (0.0, -1.0, 0.0, -1.0), (0.0, 0.0, -1.0, 0.0)
        return [
            self._by_kind(e, a, [face, edge, 0.0], [between, corner])
            for a, (face, edge, between, corner) in zip(super()._merged(e), own, strict=True)
        ]

    def _pushes(self, e: Expr) -> list[Expr]:
        """Return M = Cn/√(n·Cn) on the axes of σ₁, σ₂ and σ₃."""
        lame, shear = self._lame, self.shear
        normals = (1.0, 0.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.0, 0.5)
        sizes = [ufl.sqrt(lame + 2 * shear * sum(x**2 for x in n)) for n in normals]
        found = []
        for k, without in enumerate(super()._pushes(e)):
            face, edge, between = (
                (lame + 2 * shear * n[k]) / size for n, size in zip(normals, sizes, strict=True)
            )
            corner = ufl.sqrt(self.bulk)
            found.append(self._by_kind(e, without, [face, edge, 0.0], [between, corner]))
        return found

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields of :class:`MohrCoulombLaw`, and a further vector V.

        V is zero unless both conditions are active and σ₂ is r or f. In this case V, U and M
        together keep the three principal stresses constant.
        """
        corner = self._by_kind(e, 0.0, [0.0, 0.0, 0.0], [0.0, 1.0])
        third = principal_axes(e).vector([corner, corner, -2 * corner])
        fields = super().tangent_fields(e, old, rho)
        return {**fields, "V": ufl.sqrt((1 - rho) * self.shear / 3) * third}

    @property
    def yields(self) -> CutOffSet:
        """Return the set of stresses that satisfy both conditions."""
        cosine = ufl.sqrt(1 - ufl.as_ufl(self.sine) ** 2)
        return CutOffSet(self.strength / (2 * cosine), self.sine, self.tension)
