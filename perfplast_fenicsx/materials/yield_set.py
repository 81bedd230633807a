"""Define the yield set of a law, in UFL at a point: admissible stresses and dissipation.

Stresses s and strain rates are Mandel vectors, shape (m,) (:mod:`mandel`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import ufl

from perfplast_fenicsx.materials.mandel import Expr, spherical


@dataclass(frozen=True)
class Cone:
    """‖matrix·s‖ ≤ bound − slope·s, a second-order cone of stresses.

    If the matrix does not contain the mean stress, the mean stress is not bounded. If it has rank
    m, the set is an ellipsoid, whose centre is zero if the slope is.

    Args:
        bound: Positive (stress), shape ().
        slope: Decrease of the bound per stress, shape (m,); zero without friction.
        matrix: Full row rank, shape (k, m).
    """

    bound: Expr
    slope: Expr
    matrix: Expr


@dataclass(frozen=True)
class PrincipalCone:
    """(1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound and σ₁ ≤ tension, principal stresses σ₁ ≥ σ₂ ≥ σ₃.

    It must be the only cone of its set, and acts on symmetric 3 × 3 tensors.

    Args:
        bound: Positive (stress), shape ().
        sine: In [0, 1), shape (); zero without friction.
        tension: Positive (stress), shape (); None if no tensile strength bounds σ₁.
    """

    bound: Expr
    sine: Expr
    tension: Expr | None = None


class YieldSet(Protocol):
    """A closed convex set of stresses with zero inside.

    Gauge, support and cones are three descriptions of one set.
    """

    def gauge(self, s: Expr) -> Expr:
        """1 on the surface, and t times as much for t s; 0 where no multiple of s yields."""
        ...

    def support(self, rate: Expr) -> Expr:
        """Return the supremum of s:rate over the set, power per volume, for an admissible rate."""
        ...

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a symmetric bilinear form of rates for the mechanism search along loading paths.

        It is positive. If such a form exists, its value at an admissible rate is proportional to
        the square of :meth:`support`. The program uses it only where :meth:`inadmissible` is
        linear.
        """
        ...

    def cones(self, size: int) -> Sequence[Cone | PrincipalCone] | None:
        """Return the cones whose intersection is the set; () without yield, None if there are none.

        The interior point method, strict bounds and their proofs support only one cone: of
        principal stresses, or with a matrix of rank m − 1 or m and zero inside. For limit loads of
        meshes it may also be an object of another class
        (:class:`perfplast_fenicsx.limit_analysis.conic.cone.LawSet`).

        Args:
            size: The number of Mandel components m.
        """
        ...

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the part of a rate, shape (k,) and linear in it, that must vanish, or None.

        If this part vanishes, :meth:`support` is finite. None if no linear condition describes
        admissible rates, as when they form a cone.
        """
        ...


class NeverYields:
    """The set of all stresses; see :class:`YieldSet` for the methods."""

    def gauge(self, s: Expr) -> Expr:
        """Return 0."""
        return ufl.as_ufl(0)

    def support(self, rate: Expr) -> Expr:
        """Return 0, the power of a rate of zero."""
        return ufl.as_ufl(0)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """Return no cones."""
        return ()

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the whole rate."""
        return rate


def axial_cone(bound: Expr, alpha: Expr | float, size: int) -> Cone:
    """Return the cone ‖dev s‖ ≤ bound − αp about the hydrostatic axis; p is the mean stress.

    Args:
        bound: γ > 0 (stress).
        alpha: α ≥ 0.
        size: The number of Mandel components m.
    """
    return Cone(bound, spherical(ufl.as_ufl(alpha) / 3, size), deviators(size))


def deviators(size: int) -> Expr:
    """Return orthonormal deviators as rows, shape (m − 1, m).

    Their product with s has the norm of dev s.

    Args:
        size: The number of Mandel components m.
    """
    a, b = 1 / math.sqrt(2), 1 / math.sqrt(6)
    shears = [[float(i == j) for j in range(size)] for i in range(3, size)]
    rest = [0.0] * (size - 3)
    return ufl.as_matrix([[a, -a, 0.0, *rest], [b, b, -2 * b, *rest], *shears])
