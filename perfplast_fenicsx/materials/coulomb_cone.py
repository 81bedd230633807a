"""The yield sets of Mohr and Coulomb, and of Tresca, in the plane, as limit analysis knows them.

With the cohesion c and the angle φ stresses are admissible where their extreme principal values
fulfil σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ. In plane strain the one out of the plane is in no
equation of equilibrium, and is between those in the plane where it leaves them the most room, so
that

    √(¼(σ_x − σ_y)² + τ²) ≤ c cos φ − ½(σ_x + σ_y) sin φ,

one second-order cone. In space, and around an axis, the set is none (it is two semidefinite ones):
limit loads by the interior point method and strict bounds are not known of it there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.materials.yield_set import Cone, InPlaneCone

IN_PLANE = 4
"""Components of the vectors that these sets are of."""

LEAST_SINE = 1e-12
"""Sine of φ below which ground does not dilate."""


@dataclass(frozen=True)
class CoulombInPlane:
    """σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ; see :class:`YieldSet` for the methods.

    Stresses and rates are vectors of 4: in plane strain or around an axis.

    Args:
        cohesion: c > 0 (stress).
        sine: sin φ in [0, 1).
    """

    cohesion: Expr
    sine: Expr

    @property
    def _cosine(self) -> Expr:
        return ufl.sqrt(1 - ufl.as_ufl(self.sine) ** 2)

    def gauge(self, s: Expr) -> Expr:
        """(σ₁ − σ₃ + (σ₁ + σ₃) sin φ)/(2c cos φ), and 0 where pressure makes it negative."""
        low, high, out = principal(s)
        most, least = ufl.max_value(high, out), ufl.min_value(low, out)
        size = (most - least) + (most + least) * self.sine
        return ufl.max_value(size, 0.0) / (2 * self.cohesion * self._cosine)

    def support(self, rate: Expr) -> Expr:
        """C cot φ tr rate, where tr rate ≥ sin φ Σ|ε_i| with the principal rates ε_i.

        Where φ is zero it is c Σ|ε_i|, and tr rate has to vanish.
        """
        angle = ufl.max_value(self.sine, LEAST_SINE)
        grows = self.cohesion * self._cosine / angle * trace(rate)
        keeps = self.cohesion * sum(abs(value) for value in principal(rate))
        return ufl.conditional(ufl.gt(self.sine, LEAST_SINE), grows, keeps)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """a:b, though the square of the power is no form."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone] | None:
        """Of the stresses in the plane; None in space."""
        if size != IN_PLANE:
            return None
        half = 1 / math.sqrt(2)
        bound = math.sqrt(2) * self.cohesion * self._cosine
        slope = ufl.as_vector([half * self.sine, half * self.sine, 0.0, 0.0])
        matrix = ufl.as_matrix([[half, -half, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        return (InPlaneCone(bound, slope, matrix),)

    def inadmissible(self, rate: Expr) -> Expr:
        """None: admissible rates are a cone, which no linear condition says."""
        return None


@dataclass(frozen=True)
class TrescaInPlane(CoulombInPlane):
    """σ₁ − σ₃ ≤ 2c, c being half of the uniaxial yield stress: no friction.

    Args:
        cohesion: c > 0 (stress).
        sine: 0.
    """

    sine: Expr = 0.0

    def support(self, rate: Expr) -> Expr:
        """C Σ|ε_i|."""
        return self.cohesion * sum(abs(value) for value in principal(rate))

    def inadmissible(self, rate: Expr) -> Expr:
        """The spherical part."""
        return spherical(trace(rate) / 3, len(rate))


def principal(s: Expr) -> tuple[Expr, Expr, Expr]:
    """Least and largest principal value in the plane, and that out of it; of a vector of 4.

    Raises:
        ValueError: If the vector is another one.
    """
    if len(s) != IN_PLANE:
        raise ValueError(f"a vector of {len(s)} components is none of plane strain; give 4.")
    mean, half = (s[0] + s[1]) / 2, (s[0] - s[1]) / 2
    radius = ufl.sqrt(half**2 + s[3] ** 2 / 2)
    return mean - radius, mean + radius, s[2]
