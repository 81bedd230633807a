"""Define the yield sets of Mohr–Coulomb and Tresca for limit analysis.

With the cohesion c and the angle φ, stresses are admissible if their extreme principal values
satisfy σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ. In plane strain no equation of equilibrium contains
the out-of-plane stress. This stress can always lie between the two in-plane principal values. The
condition is therefore

    √(¼(σ_x − σ_y)² + τ²) ≤ c cos φ − ½(σ_x + σ_y) sin φ,

which is a single second-order cone. In 3D, in axisymmetry, and in plane strain with a tensile
strength, the set is a cone of principal stresses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.law import PrincipalCone
from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.materials.principal_axes import principal_axes
from perfplast_fenicsx.rounding import TINY


@dataclass(frozen=True)
class CoulombSet:
    """The yield set σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ; :class:`YieldSet` describes the methods.

    Args:
        cohesion: c ≥ 0 (stress); positive if φ = 0.
        sine: sin φ in [0, 1).
    """

    cohesion: Expr
    sine: Expr

    @property
    def _cosine(self) -> Expr:
        return ufl.sqrt(1 - ufl.as_ufl(self.sine) ** 2)

    def gauge(self, s: Expr) -> Expr:
        """Return (σ₁ − σ₃ + (σ₁ + σ₃) sin φ)/(2c cos φ), or 0 if pressure makes it negative.

        The value is very large if c = 0.
        """
        most, _, least = principal(s)
        size = (most - least) + (most + least) * self.sine
        return ufl.max_value(size, 0.0) / ufl.max_value(2 * self.cohesion * self._cosine, TINY)

    def support(self, rate: Expr) -> Expr:
        """Return c cot φ tr rate, for tr rate ≥ sin φ Σ|ε_i| with the principal rates ε_i.

        For φ = 0 the value is c Σ|ε_i|, and tr rate must vanish.
        """
        least_sine = 1e-12  # ground with a smaller sin φ counts as ground that does not dilate
        angle = ufl.max_value(self.sine, least_sine)
        grows = self.cohesion * self._cosine / angle * trace(rate)
        keeps = self.cohesion * sum(abs(value) for value in principal(rate))
        return ufl.conditional(ufl.gt(self.sine, least_sine), grows, keeps)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b, although the square of the power is not a quadratic form."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[PrincipalCone]:
        """Return the cone of the principal stresses."""
        return (PrincipalCone(2 * self.cohesion * self._cosine, ufl.as_ufl(self.sine)),)

    def inadmissible(self, rate: Expr) -> Expr:
        """Return None: admissible rates form a cone, which no linear condition describes."""
        return None


@dataclass(frozen=True)
class TrescaSet(CoulombSet):
    """The yield set σ₁ − σ₃ ≤ 2c, where c is half of the uniaxial yield stress.

    Args:
        cohesion: c > 0 (stress).
        sine: Zero.
    """

    sine: Expr = 0.0

    def support(self, rate: Expr) -> Expr:
        """Return c Σ|ε_i|."""
        return self.cohesion * sum(abs(value) for value in principal(rate))

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the spherical part of the rate."""
        return spherical(trace(rate) / 3, len(rate))


@dataclass(frozen=True)
class CutOffSet(CoulombSet):
    """The Mohr–Coulomb set, cut off by σ₁ ≤ f below the apex of the Mohr–Coulomb cone.

    :class:`YieldSet` describes the methods.

    Args:
        cohesion: c > 0 (stress).
        sine: sin φ in [0, 1).
        tension: Tensile strength f > 0 (stress), less than c cot φ.
    """

    tension: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return the larger of the gauges of both conditions, which is at least 0."""
        return ufl.max_value(super().gauge(s), principal(s)[0] / self.tension)

    def support(self, rate: Expr) -> Expr:
        """Return (f − h) tr rate + h Σ|ε_i|, if tr rate ≥ sin φ Σ|ε_i| for principal rates ε_i.

        Here h = (c cos φ − f sin φ)/(1 − sin φ) is half of the distance between σ₁ = f and the
        smallest admissible σ₃.
        """
        half = (self.cohesion * self._cosine - self.sine * self.tension) / (1 - self.sine)
        sizes = sum(abs(value) for value in principal(rate))
        return (self.tension - half) * trace(rate) + half * sizes

    def cones(self, size: int) -> Sequence[PrincipalCone]:
        """Return the cone of the principal stresses."""
        bound = 2 * self.cohesion * self._cosine
        return (PrincipalCone(bound, ufl.as_ufl(self.sine), ufl.as_ufl(self.tension)),)


def principal(s: Expr) -> tuple[Expr, Expr, Expr]:
    """Return the principal values of a Mandel vector, the largest value first."""
    return principal_axes(s).ordered
