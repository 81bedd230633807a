"""The yield sets of Mohr and Coulomb, and of Tresca, as limit analysis knows them.

With the cohesion c and the angle φ stresses are admissible where their extreme principal values
fulfil σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ. In plane strain the one out of the plane is in no
equation of equilibrium, and is between those in the plane where it leaves them the most room, so
that

    √(¼(σ_x − σ_y)² + τ²) ≤ c cos φ − ½(σ_x + σ_y) sin φ,

one second-order cone. In space, and around an axis, it is one of principal stresses, and with a
tensile strength in plane strain too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import ufl

from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.materials.principal_axes import principal_axes
from perfplast_fenicsx.materials.yield_set import PrincipalCone
from perfplast_fenicsx.rounding import TINY


@dataclass(frozen=True)
class CoulombSet:
    """σ₁ − σ₃ ≤ 2c cos φ − (σ₁ + σ₃) sin φ; see :class:`YieldSet` for the methods.

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
        """(σ₁ − σ₃ + (σ₁ + σ₃) sin φ)/(2c cos φ), and 0 where pressure makes it negative.

        Huge where c = 0.
        """
        most, _, least = principal(s)
        size = (most - least) + (most + least) * self.sine
        return ufl.max_value(size, 0.0) / ufl.max_value(2 * self.cohesion * self._cosine, TINY)

    def support(self, rate: Expr) -> Expr:
        """C cot φ tr rate, where tr rate ≥ sin φ Σ|ε_i| with the principal rates ε_i.

        Where φ is zero it is c Σ|ε_i|, and tr rate has to vanish.
        """
        least_sine = 1e-12  # sine of φ below which ground does not dilate
        angle = ufl.max_value(self.sine, least_sine)
        grows = self.cohesion * self._cosine / angle * trace(rate)
        keeps = self.cohesion * sum(abs(value) for value in principal(rate))
        return ufl.conditional(ufl.gt(self.sine, least_sine), grows, keeps)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """a:b, though the square of the power is no form."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[PrincipalCone]:
        """Return the cone of the principal stresses."""
        return (PrincipalCone(2 * self.cohesion * self._cosine, ufl.as_ufl(self.sine)),)

    def inadmissible(self, rate: Expr) -> Expr:
        """None: admissible rates are a cone, which no linear condition says."""
        return None


@dataclass(frozen=True)
class TrescaSet(CoulombSet):
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
        """Return the spherical part."""
        return spherical(trace(rate) / 3, len(rate))


@dataclass(frozen=True)
class CutOffSet(CoulombSet):
    """The same with σ₁ ≤ f as well, below the apex; see :class:`YieldSet` for the methods.

    Args:
        cohesion: c > 0 (stress).
        sine: sin φ in [0, 1).
        tension: f > 0 (stress), less than c cot φ.
    """

    tension: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return the larger one of both conditions, 0 where pressure makes it negative."""
        return ufl.max_value(super().gauge(s), principal(s)[0] / self.tension)

    def support(self, rate: Expr) -> Expr:
        """(f − h) tr rate + h Σ|ε_i|, where tr rate ≥ sin φ Σ|ε_i| with the principal rates ε_i.

        Half of the room between σ₁ = f and the least σ₃ is h = (c cos φ − f sin φ)/(1 − sin φ).
        """
        half = (self.cohesion * self._cosine - self.sine * self.tension) / (1 - self.sine)
        sizes = sum(abs(value) for value in principal(rate))
        return (self.tension - half) * trace(rate) + half * sizes

    def cones(self, size: int) -> Sequence[PrincipalCone]:
        """Return the cone of the principal stresses."""
        bound = 2 * self.cohesion * self._cosine
        return (PrincipalCone(bound, ufl.as_ufl(self.sine), ufl.as_ufl(self.tension)),)


def principal(s: Expr) -> tuple[Expr, Expr, Expr]:
    """Principal values of a Mandel vector, the largest first."""
    return principal_axes(s).ordered
