"""Define a law that the package lacks: yield at a strain energy, relative to a pressure.

Ground and foams also yield under pressure alone. The stress satisfies ½(σ − σ_c):C⁻¹(σ − σ_c) ≤
½Y²/E with σ_c = −p_c δ, which is E. Beltrami's criterion relative to σ_c. Its projection in the
norm of C⁻¹ is radial, Σ(e) = σ_c + θ(Ce − σ_c), so the law is as short as von Mises' law.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.materials import Cone, Expr, IsotropicElasticity, Law, spherical

Old = Mapping[str, Expr]


@dataclass(frozen=True)
class EnergyCap(Law):
    """The law, with its yield set.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        energy: Y²/E (stress).
        centre: p_c (stress), a pressure with p_c² < κY²/E.
    """

    bulk: Expr
    shear: Expr
    energy: Expr
    centre: Expr
    projects: ClassVar[bool] = True

    @property
    def elastic(self) -> IsotropicElasticity:
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def yields(self) -> "EnergyCap":
        return self

    def gauge(self, s: Expr) -> Expr:
        cone = self.cones(len(s))[0]
        y = ufl.dot(cone.matrix, s)
        return ufl.max_value(ufl.sqrt(ufl.dot(y, y)) + ufl.dot(cone.slope, s), 0.0) / cone.bound

    def support(self, rate: Expr) -> Expr:
        size = ufl.sqrt(ufl.dot(self.elastic.hooke(rate), rate))
        pressed = -self.centre * (rate[0] + rate[1] + rate[2])
        return pressed + ufl.sqrt(self.energy) * size

    def resistance(self, a: Expr, b: Expr) -> Expr:
        return ufl.dot(self.elastic.hooke(a), b)

    def cones(self, size: int) -> Sequence[Cone]:
        """‖y − y_c‖ ≤ √(Y²/E) in y = C^(−½)σ is ‖By‖ ≤ c + y_c·y/c, B² = 1 + y_c ⊗ y_c/c²."""
        bound = ufl.sqrt(self.energy - self.centre**2 / self.bulk)
        tilt = self.centre / (ufl.sqrt(self.bulk) * bound)
        unit = [1 / math.sqrt(3)] * 3 + [0.0] * (size - 3)
        along = ufl.sqrt(1 + tilt**2) / ufl.sqrt(3 * self.bulk)
        across = 1 / ufl.sqrt(2 * self.shear)
        rows = [
            [(along - across) * unit[i] * unit[j] + across * float(i == j) for j in range(size)]
            for i in range(size)
        ]
        slope = ufl.as_vector([tilt / ufl.sqrt(3 * self.bulk) * a for a in unit])
        return (Cone(bound, slope, ufl.as_matrix(rows)),)

    def inadmissible(self, rate: Expr) -> None:
        """Return None, since all rates are admissible."""
        return None

    def from_centre(self, e: Expr) -> Expr:
        return self.elastic.hooke(e) + spherical(self.centre, len(e))

    def secant(self, e: Expr) -> Expr:
        """θ."""
        off = self.from_centre(e)
        size = ufl.sqrt(ufl.dot(self.elastic.compliance(off), off) / self.energy)
        return 1 / ufl.max_value(1.0, size)

    def plastic(self, e: Expr, old: Old) -> Expr:
        return ufl.conditional(ufl.lt(self.secant(e), 1.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        return self.secant(e) * self.from_centre(e) - spherical(self.centre, len(e))

    def potential(self, e: Expr, old: Old) -> Expr:
        off = self.from_centre(e)
        beyond = (1 - self.secant(e)) ** 2 * ufl.dot(self.elastic.compliance(off), off)
        return (ufl.dot(self.elastic.hooke(e), e) - beyond) / 2

    def conjugate(self, s: Expr, old: Old) -> Expr:
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        theta, off = self.secant(e), self.from_centre(e)
        squared = ufl.max_value(ufl.dot(self.elastic.compliance(off), off), self.energy)
        along = self.plastic(e, old) * ufl.sqrt((1 - rho) * theta / squared)
        return {"a": rho + (1 - rho) * theta, "N": along * off}

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        N = stored["N"]
        return stored["a"] * self.elastic.hooke(d) - ufl.dot(N, d) * N


@dataclass(frozen=True)
class Foam:
    """The parameters of a foam.

    Args:
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        strength: Y (stress), the strength in tension and compression about the centre.
        centre: p_c, the pressure at the centre of the set (stress).
    """

    law: ClassVar[type[EnergyCap]] = EnergyCap

    young: float
    poisson: float
    strength: float
    centre: float = 0.0

    def parameters(self) -> dict[str, float]:
        return {
            "bulk": self.young / (3 * (1 - 2 * self.poisson)),
            "shear": self.young / (2 * (1 + self.poisson)),
            "energy": self.strength**2 / self.young,
            "centre": self.centre,
        }

    def pressed_flat(self) -> tuple[float, float]:
        """Return the pressure and tension of a block between smooth platens in plane strain.

        Among admissible σ = (0, −λ, σ_zz), with a = p_c, b = p_c − λ and the best σ_zz, (1 − ν²)(a²
        + b²) − 2ν(1 + ν)ab = Y².
        """
        nu, a = self.poisson, self.centre
        quadratic = [1 - nu**2, -2 * nu * (1 + nu) * a, (1 - nu**2) * a**2 - self.strength**2]
        half, whole = -quadratic[1] / (2 * quadratic[0]), quadratic[2] / quadratic[0]
        root = math.sqrt(half**2 - whole)
        return a - (half - root), half + root - a

    def pressed(self) -> float:
        """Return the pressure that a bar carries in 3D, for σ = (0, 0, −λ)."""
        nu, a = self.poisson, self.centre
        # b² − 4νab + (2 − 2ν)a² = Y² for b = a − λ
        half, whole = 2 * nu * a, (2 - 2 * nu) * a**2 - self.strength**2
        return a - (half - math.sqrt(half**2 - whole))
