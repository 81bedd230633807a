"""Define a metal in plane stress, σ_zz = 0, by a quadratic condition on the in-plane stresses.

The thickness of bodies is free to change; all strain rates in the plane are therefore admissible.
Let P, shape (3, 3), be the form in (σ_xx, σ_yy, √2σ_xy), and C = 2μB₀B₀ᵀ in plane stress. The
principal axes of B₀ᵀPB₀ define the coordinates of :mod:`quadratic_law`. Σ is the 3D projection at
σ_zz = 0 (J. C. Simo, R. L. Taylor, Int. J. Numer. Meth. Eng. 22 (1986), 649).

The module also defines Hooke's tensor of an isotropic sheet and the in-plane inverse of this
tensor. All expressions are UFL expressions at a point.

Mandel vectors have four components, as in plane strain (:mod:`mandel`). The out-of-plane component
is zero for stresses and ignored for strains, because the thickness of bodies is free to change.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.materials.law import Cone
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.quadratic_law import QuadraticLaw
from perfplast_fenicsx.spatial_fields import Strength


@dataclass(frozen=True)
class SheetElasticity:
    """Hooke's tensor λ'(e_xx + e_yy) δ' + 2μ e in the plane, λ' = 2μ(3κ − 2μ)/(3κ + 4μ).

    Args:
        bulk: Bulk modulus κ of the material in three dimensions (stress).
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
        """Return C⁻¹ s with a zero out-of-plane component."""
        share = self._lame / (4 * self.shear * (self._lame + self.shear))
        return _flat(1 / (2 * self.shear), s, -share * (s[0] + s[1]))


def _flat(factor: Expr, x: Expr, mean: Expr) -> Expr:
    return ufl.as_vector([factor * x[0] + mean, factor * x[1] + mean, 0.0, factor * x[3]])


@dataclass(frozen=True)
class SheetForm:
    """The form Σ h_i s_i², for rates with the coordinates Bᵀε and stresses σ = Bs.

    Args:
        sizes: The three h_i.
        rows: Rows of Bᵀ, three components in each row.
        inverse: Rows of B⁻¹, in the same layout.
    """

    sizes: Sequence[Expr]
    rows: Sequence[Sequence[Expr]]
    inverse: Sequence[Sequence[Expr]]

    def weights(self, size: int) -> Sequence[Expr]:
        """Return the three h_i."""
        return self.sizes

    def frame(self, size: int) -> Expr:
        """Return Bᵀ, shape (3, 4)."""
        return ufl.as_matrix([_wide(row) for row in self.rows])

    def back(self) -> Expr:
        """Return B⁻¹, shape (3, 4)."""
        return ufl.as_matrix([_wide(row) for row in self.inverse])


def _wide(row: Sequence[Expr]) -> list[Expr]:
    """Return a row with a zero for the out-of-plane component."""
    return [row[0], row[1], 0.0, row[2]]


@dataclass(frozen=True)
class SheetSet:
    """The yield set Σ h_i s_i² ≤ Y²; :class:`YieldSet` describes the methods.

    Args:
        form: The form Σ h_i s_i².
        strength: Y (stress).
    """

    form: SheetForm
    strength: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return √(Σ h_i s_i²)/Y."""
        parts = ufl.dot(self.form.back(), s)
        return ufl.sqrt(sum(h * parts[i] ** 2 for i, h in enumerate(self.form.sizes))) / (
            self.strength
        )

    def support(self, rate: Expr) -> Expr:
        """Return Y √(Σ ε_i²/h_i)."""
        return self.strength * ufl.sqrt(self.resistance(rate, rate))

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return Σ a_i b_i/h_i."""
        frame = self.form.frame(len(a))
        left, right = ufl.dot(frame, a), ufl.dot(frame, b)
        return sum(left[i] * right[i] / h for i, h in enumerate(self.form.sizes))

    def cones(self, size: int) -> Sequence[Cone]:
        """Return one cone, which bounds all in-plane stresses."""
        back = self.form.back()
        matrix = ufl.as_matrix(
            [[ufl.sqrt(h) * back[i, j] for j in range(size)] for i, h in enumerate(self.form.sizes)]
        )
        return (Cone(self.strength, ufl.as_vector([0.0] * size), matrix),)

    def inadmissible(self, rate: Expr) -> Expr:
        """Return zero, because every rate in the plane is admissible."""
        return 0 * rate


@dataclass(frozen=True)
class SheetLaw(QuadraticLaw):
    """The law of a metal in plane stress; :class:`Law` describes the methods.

    Args:
        bulk: Bulk modulus κ of the material in three dimensions (stress).
        shear: μ (stress).
        strength: Y (stress).
        h0: The largest h_i.
        h1: The middle h_i.
        h2: The smallest h_i.
        b00: An entry of B.
        b01: An entry of B.
        b02: An entry of B.
        b10: An entry of B.
        b11: An entry of B.
        b12: An entry of B.
        b20: An entry of B.
        b21: An entry of B.
        b22: An entry of B.
    """

    h0: Expr
    h1: Expr
    h2: Expr
    b00: Expr
    b01: Expr
    b02: Expr
    b10: Expr
    b11: Expr
    b12: Expr
    b20: Expr
    b21: Expr
    b22: Expr

    @property
    def elastic(self) -> SheetElasticity:
        """Return Hooke's tensor C of a sheet."""
        return SheetElasticity(self.bulk, self.shear)

    @property
    def form(self) -> SheetForm:
        """Return the form Σ h_i s_i²."""
        rows = [[getattr(self, f"b{j}{i}") for j in range(3)] for i in range(3)]
        # B⁻¹ = 2μ Bᵀ C⁻¹
        back = []
        for row in rows:
            flat = self.elastic.compliance(ufl.as_vector(_wide(row)))
            back.append([2 * self.shear * flat[j] for j in (0, 1, 3)])
        return SheetForm((self.h0, self.h1, self.h2), rows, back)

    @property
    def yields(self) -> SheetSet:
        """Return the set Σ h_i s_i² ≤ Y²."""
        return SheetSet(self.form, self.strength)

    def free(self, e: Expr) -> Expr:
        """Return zero, because the condition bounds all stresses in the plane."""
        return ufl.as_vector([0.0] * len(e))

    def flow(self, e: Expr) -> Expr:
        """Return the plastic strain at the strain e.

        The out-of-plane component is such that the plastic strain preserves the volume.
        """
        p = super().flow(e)
        return ufl.as_vector([p[0], p[1], -p[0] - p[1], p[3]])


@dataclass(frozen=True, eq=False)
class Sheet:
    """The parameters of a metal in plane stress.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        strength: Y (stress).
        form: Matrix P of the form in (σ_xx, σ_yy, √2σ_xy), positive definite, shape (3, 3).
    """

    bulk: float
    shear: float
    strength: Strength
    form: Floats

    @property
    def law(self) -> type[SheetLaw]:
        """Return the class of the law."""
        return SheetLaw

    def parameters(self) -> dict[str, Strength]:
        """Return κ, μ, Y and the form of :class:`SheetLaw`."""
        even = 9 * self.bulk / (3 * self.bulk + 4 * self.shear)  # modulus of ½(xx + yy), over 2μ
        half = math.sqrt(0.5)
        columns = [[half, half, 0.0], [half, -half, 0.0], [0.0, 0.0, 1.0]]
        first = np.array(columns).T * [math.sqrt(even), 1.0, 1.0]
        values, turn = np.linalg.eigh(first.T @ self.form @ first)
        B = first @ turn[:, ::-1]
        numbers: dict[str, Strength] = {f"h{i}": float(h) for i, h in enumerate(values[::-1])}
        numbers |= {f"b{i}{j}": float(B[i, j]) for i in range(3) for j in range(3)}
        return {"bulk": self.bulk, "shear": self.shear, "strength": self.strength, **numbers}
