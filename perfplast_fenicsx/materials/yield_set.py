"""The yield set of a law, in UFL at a point: what stresses a body carries, and what flow costs.

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

    A matrix without the mean stress leaves that free; with one of rank m the set is an ellipsoid,
    about zero where the slope is.

    Args:
        bound: Positive (stress), shape ().
        slope: By which the bound falls with the stress, shape (m,); zero without friction.
        matrix: Full row rank, shape (k, m).
    """

    bound: Expr
    slope: Expr
    matrix: Expr


@dataclass(frozen=True)
class PrincipalCone:
    """(1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound and σ₁ ≤ tension, principal stresses σ₁ ≥ σ₂ ≥ σ₃.

    It is the only cone of its set, of symmetric 3 × 3 tensors.

    Args:
        bound: Positive (stress), shape ().
        sine: In [0, 1), shape (); zero without friction.
        tension: Positive (stress), shape (); None where nothing else bounds σ₁.
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
        """Sup of s:rate over the set, power per volume, for a rate that is admissible."""
        ...

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a symmetric form of rates by which mechanisms are looked for along loading paths.

        It is positive, and of an admissible rate with itself in proportion to the square of
        :meth:`support`, if there is such a form; asked for where :meth:`inadmissible` is linear.
        """
        ...

    def cones(self, size: int) -> Sequence[Cone | PrincipalCone] | None:
        """Return the cones whose intersection the set is; () if nothing yields, None if not known.

        Limit loads by the interior point method, strict bounds and their proofs need no more than
        one of them: of principal stresses, or with a matrix of rank m − 1 or m and zero inside.
        For limit loads of meshes it may be an object of another kind
        (:class:`perfplast_fenicsx.limit_analysis.conic.cone.LawSet`).

        Args:
            size: m.
        """
        ...

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the part of a rate, shape (k,) and linear in it, that has to vanish, or None.

        Where it does :meth:`support` is finite. None where no linear condition says so, as for a
        set whose admissible rates are a cone.
        """
        ...


class NeverYields:
    """All stresses; see :class:`YieldSet` for the methods."""

    def gauge(self, s: Expr) -> Expr:
        """0."""
        return ufl.as_ufl(0)

    def support(self, rate: Expr) -> Expr:
        """0, the power of no rate at all."""
        return ufl.as_ufl(0)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """a:b."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """None of them bounds a stress."""
        return ()

    def inadmissible(self, rate: Expr) -> Expr:
        """Return all of it."""
        return rate


def axial_cone(bound: Expr, alpha: Expr | float, size: int) -> Cone:
    """‖dev s‖ ≤ bound − αp about the hydrostatic axis, p being the mean of the normal stresses.

    Args:
        bound: γ > 0 (stress).
        alpha: α ≥ 0.
        size: m.
    """
    return Cone(bound, spherical(ufl.as_ufl(alpha) / 3, size), deviators(size))


def deviators(size: int) -> Expr:
    """Orthonormal deviators as rows, shape (m − 1, m): their product with s has the size of dev s.

    Args:
        size: m.
    """
    a, b = 1 / math.sqrt(2), 1 / math.sqrt(6)
    shears = [[float(i == j) for j in range(size)] for i in range(3, size)]
    rest = [0.0] * (size - 3)
    return ufl.as_matrix([[a, -a, 0.0, *rest], [b, b, -2 * b, *rest], *shears])
