r"""Define perfect plasticity with a quadratic yield condition, in Hencky's form.

In suitable coordinates Hooke's tensor is 2μ and the yield condition is Σ h_i s_i² ≤ Y². A further
part of the stress may be unbounded. Strains have the coordinates Bᵀe, and stresses are σ = Bs. A
trial stress t = 2μBᵀe outside the set returns to

    s_i = t_i/(1 + xh_i),    Σ h_i t_i²/(1 + xh_i)² = Y²,    x > 0.

Newton's method is applied to the reciprocal square root of the left-hand side. From zero, its
iterates increase to the solution x without overshooting (J. J. Moré, D. C. Sorensen, SIAM J. Sci.
Stat. Comput. 4 (1983), 553). With D_i = 2μ/(1 + xh_i) and q_i = D_i h_i s_i, the derivative of s
with respect to Bᵀe is diag(D) − q⊗q/Σ h_i s_i q_i.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar, Protocol

import ufl

from perfplast_fenicsx.materials.law import Law, Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.rounding import TINY


class QuadraticForm(Protocol):
    """The quadratic form Σ h_i s_i²."""

    def weights(self, size: int) -> Sequence[Expr]:
        """Return the h_i: three for four Mandel components, five for six components."""
        ...

    def frame(self, size: int) -> Expr:
        """Return Bᵀ, shape (k, m) for k coordinates s_i."""
        ...


@dataclass(frozen=True)
class QuadraticLaw(Law):
    """The law of the yield set Σ h_i s_i² ≤ Y²; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        strength: Y (stress).
    """

    bulk: Expr
    shear: Expr
    strength: Expr
    projects: ClassVar[bool] = True

    @property
    def form(self) -> QuadraticForm:
        """Return the quadratic form of the law."""
        raise NotImplementedError

    def free(self, e: Expr) -> Expr:
        """Return the elastic stress that the condition does not bound, shape (m,)."""
        raise NotImplementedError

    def trial(self, e: Expr) -> list[Expr]:
        """Return the elastic stress in the form's coordinates, divided by Y."""
        parts, count = ufl.dot(self.form.frame(len(e)), e), len(self.form.weights(len(e)))
        return [2 * self.shear / self.strength * parts[i] for i in range(count)]

    def returned(self, e: Expr) -> list[Expr]:
        """Return the 1/(1 + xh_i), the ratios of the returned stresses to the elastic stresses."""
        t, weights = self.trial(e), self.form.weights(len(e))

        def nearer(x: Expr, _: int) -> Expr:
            w = [1 + x * h for h in weights]
            square = sum(h * (a / b) ** 2 for h, a, b in zip(weights, t, w, strict=True))
            slope = sum(h**2 * a**2 / b**3 for h, a, b in zip(weights, t, w, strict=True))
            size = ufl.sqrt(ufl.max_value(square, 1.0))
            return x + (size - 1) * square / ufl.max_value(slope, TINY)

        # Newton steps of a return. For shear ratios of 9 and strains of 3e6 times the yield strain,
        # these steps leave only rounding errors.
        steps = 10
        x = reduce(nearer, range(steps), ufl.as_ufl(0.0))
        return [1 / (1 + x * h) for h in weights]

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        weights = self.form.weights(len(e))
        square = sum(h * t**2 for h, t in zip(weights, self.trial(e), strict=True))
        return ufl.conditional(ufl.gt(square, 1.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of ψ."""
        left = zip(self.trial(e), self.returned(e), strict=True)
        parts = ufl.as_vector([self.strength * t * share for t, share in left])
        return self.free(e) + ufl.dot(parts, self.form.frame(len(e)))

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e): ½ e:Ce minus half of the squared distance of Ce from the yield set.

        The distance is in the norm of C⁻¹.
        """
        left = zip(self.trial(e), self.returned(e), strict=True)
        shape = sum(t**2 * share * (2 - share) for t, share in left)
        return ufl.dot(self.free(e), e) / 2 + self.strength**2 / (4 * self.shear) * shape

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return D, shape (k,), and N, shape (m,), of the tangent free(d) + B(D ∘ Bᵀd) − (N:d)N."""
        shares, weights = self.returned(e), self.form.weights(len(e))
        s = [t * share for t, share in zip(self.trial(e), shares, strict=True)]
        D = [2 * self.shear * share for share in shares]
        q = [a * h * b for a, h, b in zip(D, weights, s, strict=True)]
        length: Any = sum(h * a * b for h, a, b in zip(weights, s, q, strict=True))
        root = self.plastic(e, old) * ufl.sqrt((1 - rho) / ufl.max_value(length, TINY))
        normal = ufl.dot(ufl.as_vector([root * a for a in q]), self.form.frame(len(e)))
        return {
            "D": ufl.as_vector([rho * 2 * self.shear + (1 - rho) * a for a in D]),
            "N": normal,
        }

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d]."""
        D, N, frame = stored["D"], stored["N"], self.form.frame(len(d))
        parts = ufl.dot(frame, d)
        scaled = ufl.as_vector([D[i] * parts[i] for i in range(len(self.form.weights(len(d))))])
        return self.free(d) + ufl.dot(scaled, frame) - ufl.dot(N, d) * N
