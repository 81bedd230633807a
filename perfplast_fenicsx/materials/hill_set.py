"""Define Hill's yield set of 1948, an elliptic cylinder about the line of mean stresses.

This module uses only UFL.

See :mod:`hill` for the condition and its coefficients.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.materials.yield_set import Cone


@dataclass(frozen=True)
class HillForm:
    """Σ h_i s_i², with s = Q dev σ.

    Args:
        first: The larger h of normal stresses.
        second: The smaller h of normal stresses.
        turn: Angle from (1, −1, 0)/√2 to the principal axis of ``first`` towards (1, 1, −2)/√6.
        yz: Coefficient L.
        xz: Coefficient M.
        xy: Coefficient N.
        axes: Angle about z, from x to the first axis of the material.
    """

    first: Expr
    second: Expr
    turn: Expr
    yz: Expr
    xz: Expr
    xy: Expr
    axes: Expr

    def weights(self, size: int) -> Sequence[Expr]:
        """Return the h_i.

        Args:
            size: The number of Mandel components m.
        """
        shears = [self.xy] if size == 4 else [self.yz, self.xz, self.xy]
        return [self.first, self.second, *shears]

    def frame(self, size: int) -> Expr:
        """Return Q, orthonormal deviators as rows, shape (m − 1, m)."""
        c, s = ufl.cos(self.axes), ufl.sin(self.axes)
        root, rest = math.sqrt(2), [0.0] * (size - 4)
        xx = [c**2, s**2, 0.0, *rest, root * c * s]
        yy = [s**2, c**2, 0.0, *rest, -root * c * s]
        zz = [0.0, 0.0, 1.0, *rest, 0.0]
        across = [(a - b) / root for a, b in zip(xx, yy, strict=True)]
        along = [(a + b - 2 * o) / math.sqrt(6) for a, b, o in zip(xx, yy, zz, strict=True)]
        cos, sin = ufl.cos(self.turn), ufl.sin(self.turn)
        rows = [
            [cos * a + sin * b for a, b in zip(across, along, strict=True)],
            [cos * b - sin * a for a, b in zip(across, along, strict=True)],
        ]
        if size == 6:
            rows += [[0.0, 0.0, 0.0, c, -s, 0.0], [0.0, 0.0, 0.0, s, c, 0.0]]
        rows.append([-root * c * s, root * c * s, 0.0, *rest, c**2 - s**2])
        return ufl.as_matrix(rows)


@dataclass(frozen=True)
class HillSet:
    """Σ h_i s_i² ≤ Y²; see :class:`YieldSet` for the methods.

    Args:
        form: The form Σ h_i s_i².
        strength: Y (stress).
    """

    form: HillForm
    strength: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return √(Σ h_i s_i²)/Y."""
        return ufl.sqrt(self._sum(s, 1)) / self.strength

    def support(self, rate: Expr) -> Expr:
        """Return Y √(Σ ε_i²/h_i)."""
        return self.strength * ufl.sqrt(self._sum(rate, -1))

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return Σ a_i b_i/h_i plus the product of traces."""
        frame, weights = self.form.frame(len(a)), self.form.weights(len(a))
        left, right = ufl.dot(frame, a), ufl.dot(frame, b)
        shape = sum(left[i] * right[i] / h for i, h in enumerate(weights))
        return shape + trace(a) * trace(b) / 3

    def _sum(self, s: Expr, power: int) -> Expr:
        parts, weights = ufl.dot(self.form.frame(len(s)), s), self.form.weights(len(s))
        return sum(h**power * parts[i] ** 2 for i, h in enumerate(weights))

    def cones(self, size: int) -> Sequence[Cone]:
        """Return one cone without a slope."""
        frame = self.form.frame(size)
        matrix = ufl.as_matrix(
            [
                [ufl.sqrt(h) * frame[i, j] for j in range(size)]
                for i, h in enumerate(self.form.weights(size))
            ]
        )
        return (Cone(self.strength, ufl.as_vector([0.0] * size), matrix),)

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the spherical part of the rate."""
        return spherical(trace(rate) / 3, len(rate))
