r"""Define associated plasticity with the Mohr–Coulomb or Tresca condition, in Hencky's form.

The yield set is (1 + s)σ₁ − (1 − s)σ₃ ≤ 2c cos φ, with s = sin φ and σ₁ ≥ σ₂ ≥ σ₃. For φ = 0 this
set is Tresca's set. Stresses are projections of Ce in the norm of C⁻¹: a trial stress returns to a
face, to one of two edges, or to the apex (S. Sysala, M. Čermák, T. Ligurský, ZAMM 97 (2017), 1502).
:mod:`principal_axes` computes principal values and axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.materials.coulomb_cone import CoulombSet, TrescaSet
from perfplast_fenicsx.materials.law import Law, Old
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity, spherical, trace
from perfplast_fenicsx.materials.principal_axes import TINY, principal_axes


@dataclass(frozen=True)
class MohrCoulombLaw(Law):
    """The law of the yield set (1 + s)σ₁ − (1 − s)σ₃ ≤ b; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        sine: Sine of the friction angle, s.
        strength: b = 2c cos φ (stress).
    """

    bulk: Expr
    shear: Expr
    sine: Expr
    strength: Expr
    projects: ClassVar[bool] = True
    dilates: ClassVar[bool] = True

    @property
    def elastic(self) -> IsotropicElasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def _lame(self) -> Expr:
        return self.bulk - 2 * self.shear / 3

    def excess(self, e: Expr) -> Expr:
        """Return (1 + s)σ₁ − (1 − s)σ₃ − b of Ce (stress)."""
        most, _, least = principal_axes(e).ordered
        sheared = (1 + self.sine) * most - (1 - self.sine) * least
        return 2 * self.shear * sheared + 2 * self._lame * self.sine * trace(e) - self.strength

    def _normals(self) -> tuple[Sequence[Expr], ...]:
        """Return mean normals of the face, the left edge σ₁ = σ₂ and the right edge σ₂ = σ₃.

        Each normal has a component for each of the axes of σ₁, σ₂ and σ₃.
        """
        up, down = 1 + self.sine, self.sine - 1
        return (up, 0.0, down), (up / 2, up / 2, down), (up, down / 2, down / 2)

    def _by_branch(self, e: Expr, values: Sequence[Expr]) -> Expr:
        """Return the value of the active branch: elastic, face, left edge, right edge or apex."""
        e1, e2, e3 = principal_axes(e).ordered
        to_left, to_right = (e1 - e2) / (1 + self.sine), (e2 - e3) / (1 - self.sine)
        face, left, right = (self._flow(e, i) for i in range(3))
        past_left = ufl.gt(left, (e1 + e2 - 2 * e3) / (3 - self.sine))
        past_right = ufl.gt(right, (2 * e1 - e2 - e3) / (3 + self.sine))
        edge = ufl.conditional(
            ufl.lt(to_left, to_right),
            ufl.conditional(past_left, values[4], values[2]),
            ufl.conditional(past_right, values[4], values[3]),
        )
        near = ufl.le(face, ufl.min_value(to_left, to_right))
        flows = ufl.conditional(near, values[1], edge)
        return ufl.conditional(ufl.gt(self.excess(e), 0.0), flows, values[0])

    def _steepness(self, i: int) -> Expr:
        """Return n·Cn for the mean normal n with the index i."""
        squares = sum(n**2 for n in self._normals()[i])
        return 4 * self._lame * self.sine**2 + 2 * self.shear * squares

    def _flow(self, e: Expr, i: int) -> Expr:
        """Return the plastic multiplier along the mean normal with the index i."""
        along = sum(
            n * w for n, w in zip(self._normals()[i], principal_axes(e).ordered, strict=True)
        )
        trial = 2 * self.shear * along + 2 * self._lame * self.sine * trace(e)
        return (trial - self.strength) / self._steepness(i)

    def _returned(self, e: Expr) -> list[Expr]:
        """Return the principal stresses of Σ(e) in descending order."""
        w = principal_axes(e).ordered
        merged = w, ((w[0] + w[1]) / 2,) * 2 + (w[2],), (w[0],) + ((w[1] + w[2]) / 2,) * 2
        mean, tip = self._lame * trace(e), self.strength / (2 * ufl.max_value(self.sine, TINY))
        found = []
        for k in range(3):
            values = [mean + 2 * self.shear * w[k]]
            for i, n in enumerate(self._normals()):
                push = 2 * self._lame * self.sine + 2 * self.shear * n[k]
                values.append(mean + 2 * self.shear * merged[i][k] - self._flow(e, i) * push)
            found.append(self._by_branch(e, [*values, tip]))
        return found

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        return ufl.conditional(ufl.gt(self.excess(e), 0.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of ψ."""
        flowing = principal_axes(e).vector(self._returned(e))
        return ufl.conditional(ufl.gt(self.excess(e), 0.0), flowing, self.elastic.hooke(e))

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e) = Σ(e):e − ½ Σ(e):C⁻¹Σ(e)."""
        s = self.stress(e, old)
        return ufl.dot(s, e) - self.conjugate(s, old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def _turned(self, stresses: Expr, strains: Expr) -> Expr:
        """Return the reduction of 2μ for rotating axes.

        Args:
            stresses: Difference of two principal stresses.
            strains: Difference of the principal strains on the same two axes.
        """
        apart = ufl.gt(abs(strains), TINY)
        turns = ufl.conditional(apart, stresses / ufl.conditional(apart, strains, 1.0), 0.0)
        return 2 * self.shear - ufl.min_value(ufl.max_value(turns, 0.0), 2 * self.shear)

    def _lost(self, e: Expr, stresses: Expr, strains: Expr) -> Expr:
        """Return the reduction of :meth:`_turned`; 0 in the elastic range and at the apex."""
        lost = self._turned(stresses, strains)
        return self._by_branch(e, [0.0, lost, lost, lost, 0.0])

    def _keeps(self, e: Expr) -> Expr:
        """Return 0 at the apex, else 1."""
        return self._by_branch(e, [1.0, 1.0, 1.0, 1.0, 0.0])

    def _merged(self, e: Expr) -> list[Expr]:
        """Return U/√μ on the axes of σ₁, σ₂ and σ₃; it is zero except on an edge."""
        left, right = (self._by_branch(e, one) for one in ([0.0, 0, 1, 0, 0], [0.0, 0, 0, 1, 0]))
        return [left, right - left, -right]

    def _pushes(self, e: Expr) -> list[Expr]:
        """Return M = Cn/√(n·Cn) on the axes of σ₁, σ₂ and σ₃; zero if elastic or at the apex."""
        found = []
        for k in range(3):
            pushes = [
                (2 * self._lame * self.sine + 2 * self.shear * n[k]) / ufl.sqrt(self._steepness(i))
                for i, n in enumerate(self._normals())
            ]
            found.append(self._by_branch(e, [0.0, *pushes, 0.0]))
        return found

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the terms of :meth:`tangent`: lame and a, shape (), and vectors, shape (m,).

        U is the difference of the tensors of the two principal axes whose stresses are equal on an
        edge. W is the direction in which the principal axes rotate in the plane, and M is
        Cn/√(n·Cn) for the mean normal n. In 3D, two more vectors describe rotations of these axes
        towards the axis perpendicular to the plane.
        """
        on, share = principal_axes(e), 1 - rho
        first, second, across = on.placed(self._returned(e))
        p, q = on.in_plane
        lost = self._lost(e, first - second, p - q)
        tilts = {
            f"tilt_{i}": ufl.sqrt(share * self._lost(e, *between)) * tilted
            for i, tilted, between in zip(
                range(2),
                on.tilted,
                ((first - across, p - on.across), (second - across, q - on.across)),
                strict=False,
            )
        }
        keeps = rho + share * self._keeps(e)
        return {
            "lame": self._lame * keeps,
            "a": 2 * self.shear * keeps,
            "U": ufl.sqrt(share * self.shear) * on.vector(self._merged(e)),
            "W": ufl.sqrt(share * lost) * on.turned,
            **tilts,
            "M": ufl.sqrt(share) * on.vector(self._pushes(e)),
        }

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d]."""
        result = spherical(stored["lame"] * trace(d), len(d)) + stored["a"] * d
        for name in stored.keys() - {"lame", "a"}:
            result = result - ufl.dot(stored[name], d) * stored[name]
        return result

    @property
    def yields(self) -> CoulombSet:
        """Return the set (1 + s)σ₁ − (1 − s)σ₃ ≤ b."""
        cosine = ufl.sqrt(1 - ufl.as_ufl(self.sine) ** 2)
        return CoulombSet(self.strength / (2 * cosine), self.sine)


@dataclass(frozen=True)
class TrescaLaw(MohrCoulombLaw):
    """The law of the yield set σ₁ − σ₃ ≤ b, with s = 0; :class:`Law` describes the methods."""

    dilates: ClassVar[bool] = False

    @property
    def yields(self) -> TrescaSet:
        """Return the set σ₁ − σ₃ ≤ b."""
        return TrescaSet(self.strength / 2)
