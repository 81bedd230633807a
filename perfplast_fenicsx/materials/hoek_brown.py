r"""Define rock with the Hoek–Brown criterion for a = ½ in plane strain, in Hencky's form.

Let p = (σ₁ + σ₃)/2 and R = (σ₁ − σ₃)/2 for the in-plane principal stresses σ₁ ≥ σ₃, tension
positive. The criterion (σ₁ − σ₃)² ≤ σ_ci (sσ_ci − m_b σ₁) is then R² ≤ k (f − p − R), with k =
m_b σ_ci/4 and the biaxial tensile strength f = sσ_ci/m_b. Its boundary is a parabola. The
out-of-plane stress is the intermediate principal stress, and no condition contains it (E. Hoek,
C. Carranza-Torres, B. Corkum, Hoek–Brown failure criterion – 2002 edition, NARMS-TAC, 2002).

The projection of an elastic stress (p, R) in the norm of C⁻¹ changes the stress along the normal
(k, 2R + k). With K = κ + μ/3, the multiplier λ and x = 1 + 2μλ,

    p' = p − (Kk/2μ)(x − 1),    R' + k/2 = (R + k/2)/x.

With G = Kk²/2μ, A = R + k/2 and B = k²/4 + k (f − p), y = 1/x is the only positive root of

    A² y³ + (G − B) y = G.

If R' would be negative, K R ≤ μ (p − f), the stress returns to the apex (f, 0). Rates with v = tr ε
> 0 and g = ε₁ − ε₃ dissipate fv + (k/4) (g − v)₊²/v.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.law import Law, Old, ParabolicCone
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity
from perfplast_fenicsx.rounding import TINY

STEPS = 8
"""Number of Newton steps for the root y. The start is at most twice the root; the last steps change
only rounding errors."""


@dataclass(frozen=True)
class HoekBrownSet:
    """The in-plane yield set R² ≤ k (f − p − R); :class:`YieldSet` describes the methods.

    Args:
        curvature: k > 0 (stress).
        tension: f > 0 (stress).
    """

    curvature: Expr
    tension: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return the positive root of kfg² − kσ₁g − R² = 0."""
        mean, radius = in_plane(s)
        k, f = self.curvature, self.tension
        along = k * (mean + radius)
        root = ufl.sqrt(along**2 + 4 * k * f * radius**2)
        pressed = 2 * radius**2 / ufl.max_value(root - along, TINY)
        return ufl.conditional(ufl.lt(along, 0.0), pressed, (along + root) / (2 * k * f))

    def support(self, rate: Expr) -> Expr:
        """Return fv + (k/4) (g − v)₊²/v, for v = tr rate > 0 and g = ε₁ − ε₃."""
        half, radius = in_plane(rate)
        growth, shear = 2 * half, 2 * radius
        over = ufl.max_value(shear - growth, 0.0)
        bent = over**2 / ufl.max_value(growth, TINY)
        return self.tension * growth + self.curvature / 4 * bent

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b, which no algorithm uses."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[ParabolicCone]:
        """Return the parabolic cone, which bounds only in-plane stresses."""
        return (ParabolicCone(self.curvature, self.tension),)

    def inadmissible(self, rate: Expr) -> None:
        """Return None: admissible rates form a cone, which no linear condition describes."""
        return None


@dataclass(frozen=True)
class HoekBrownLaw(Law):
    """The law of the in-plane yield set R² ≤ k (f − p − R); :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        curvature: k > 0 (stress).
        tension: f > 0 (stress).
    """

    bulk: Expr
    shear: Expr
    curvature: Expr
    tension: Expr
    projects: ClassVar[bool] = True
    dilates: ClassVar[bool] = True
    plane_strain_only: ClassVar[bool] = True

    @property
    def elastic(self) -> IsotropicElasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def _plane(self) -> Expr:
        """Return K, the ratio of the in-plane mean stress to the in-plane trace."""
        return self.bulk + self.shear / 3

    def _returned(self, e: Expr) -> tuple[Expr, Expr, Expr, Expr]:
        """Return p and R of Ce, and p' and R' of its projection."""
        k, f, mu = self.curvature, self.tension, self.shear
        p, radius = in_plane(self.elastic.hooke(e))
        g, a = self._plane * k**2 / (2 * mu), radius + k / 2
        linear = g - k**2 / 4 - k * (f - p)
        y = (g / a**2) ** (1 / 3) + ufl.sqrt(ufl.max_value(-linear, 0.0)) / a
        y = ufl.min_value(y, 1.0)
        for _ in range(STEPS):
            y = (2 * a**2 * y**3 + g) / (3 * a**2 * y**2 + linear)
        yields = ufl.gt(self._excess(e), 0.0)
        tip = ufl.lt(self._plane * radius, mu * (p - f))
        mean = p - self._plane * k / (2 * mu) * (1 / y - 1)
        mean = ufl.conditional(yields, ufl.conditional(tip, f, mean), p)
        size = ufl.conditional(tip, 0.0, ufl.max_value(a * y - k / 2, 0.0))
        return p, radius, mean, ufl.conditional(yields, size, radius)

    def _excess(self, e: Expr) -> Expr:
        """Return R² + k (p + R − f) of Ce, negative inside the yield set."""
        p, radius = in_plane(self.elastic.hooke(e))
        tip = p - self.tension
        return radius**2 + self.curvature * (tip + radius)

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        return ufl.conditional(ufl.gt(self._excess(e), 0.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of ψ."""
        trial = self.elastic.hooke(e)
        p, radius, mean, size = self._returned(e)
        share = size / ufl.max_value(radius, TINY)
        across = (self.bulk - 2 * self.shear / 3) / self._plane
        rest = [trial[i] - p if i < 2 else trial[i] for i in range(len(trial))]
        found = [mean + share * rest[0], mean + share * rest[1], rest[2] + across * (mean - p)]
        return ufl.as_vector([*found, share * rest[3]])

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e) = Σ:e − ½ Σ:C⁻¹Σ."""
        stress = self.stress(e, old)
        return ufl.dot(stress, e) - self.conjugate(stress, old)

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the terms of :meth:`tangent`: i and a, shape (), and w and n, shape (m,).

        The number i multiplies the elastic mean stress. On the parabola Σ°[d] is β (w:d) w, with
        w = (2R' + k) i − √2 k n and β = μK/(K k² x + μ(2R' + k)²). Here i is the vector of
        ``_unit``, and n is the unit in-plane deviator of the stress. Perpendicular to n the
        deviatoric modulus is 2μR'/R. Plastic flow does not change the part of σ_zz that depends
        on ε_zz but not on p.
        """
        k, mu = self.curvature, self.shear
        trial = self.elastic.hooke(e)
        p, radius, _, size = self._returned(e)
        flows = self.plastic(e, old)
        tip = ufl.lt(self._plane * radius, mu * (p - self.tension))
        big = ufl.max_value(radius, TINY)
        half = 1 / (math.sqrt(2) * big)
        n = ufl.as_vector([half * (trial[0] - p), half * (trial[1] - p), 0.0, half * trial[3]])
        slope = 2 * size + k
        stretch = (2 * radius + k) / slope
        along = slope * self._unit() - math.sqrt(2) * k * n
        beta = mu * self._plane / (self._plane * k**2 * stretch + mu * slope**2)
        on_parabola = flows * ufl.conditional(tip, 0.0, 1.0)
        stays = 1 - flows
        return {
            "i": rho + (1 - rho) * stays,
            "a": 2 * mu * (rho + (1 - rho) * (stays + flows * size / big)),
            "n": ufl.sqrt(2 * mu * (1 - rho) * flows * size / big) * n,
            "w": ufl.sqrt((1 - rho) * beta * on_parabola) * along,
        }

    def _unit(self) -> Expr:
        """Return i = (1, 1, λ/K, 0); the mean stress p of Cd is K i:d."""
        across = (self.bulk - 2 * self.shear / 3) / self._plane
        return ufl.as_vector([1.0, 1.0, across, 0.0])

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d]."""
        i, n, w = self._unit(), stored["n"], stored["w"]
        across = self.bulk + 4 * self.shear / 3 - self._plane * i[2] ** 2
        half = (d[0] - d[1]) / 2
        plain = ufl.as_vector([half, -half, 0.0, d[3]])
        out = ufl.as_vector([0.0, 0.0, across * d[2], 0.0])
        mean = stored["i"] * self._plane * ufl.dot(i, d) * i
        return out + mean + stored["a"] * plain - ufl.dot(n, d) * n + ufl.dot(w, d) * w

    @property
    def yields(self) -> HoekBrownSet:
        """Return the set R² ≤ k (f − p − R)."""
        return HoekBrownSet(self.curvature, self.tension)


def in_plane(s: Expr) -> tuple[Expr, Expr]:
    """Return the mean of the two in-plane principal values, and half of their difference."""
    return (s[0] + s[1]) / 2, ufl.sqrt(((s[0] - s[1]) / 2) ** 2 + s[3] ** 2 / 2)


@dataclass(frozen=True)
class HoekBrown:
    """Rock with the Hoek–Brown criterion for a = ½ and associated flow, in plane strain.

    The criterion of the rock mass is σ₁' = σ₃' + √(m_b σ_ci σ₃' + s σ_ci²), with pressure positive.
    The uniaxial compressive strength is √s σ_ci, and the biaxial tensile strength is s σ_ci/m_b.
    The exponent a of rock masses of low quality is usually above ½; the program does not support
    exponents other than ½.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        compressive_strength: Uniaxial compressive strength σ_ci of the intact rock (stress).
        m_b: Parameter m_b > 0 of the rock mass. The parameter m_i of intact rock is between 4 and
            35.
        s: Parameter s of the rock mass, above 0 and at most 1; 1 for intact rock.
        expansion: Thermal strain per degree (1/temperature).
        reduced: Whether F of ``control = "strength"`` divides the strength. F cannot divide a
            parabola: give false to reduce only the strength of other ground.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    compressive_strength: float
    m_b: float
    s: float
    expansion: float = 0.0
    reduced: bool = True

    @property
    def law(self) -> type[HoekBrownLaw]:
        """Return the class of the law."""
        return HoekBrownLaw

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("compressive_strength", self.compressive_strength)
        for name, value, most in (("m_b", self.m_b, 100.0), ("s", self.s, 1.0)):
            if not 0 < value <= most:
                raise InputError(
                    f"{name} = {value}, but it must be above 0 and at most {most:g}; give the "
                    "value of the rock mass (m_b = m_i and s = 1 for intact rock)."
                )

    @property
    def curvature(self) -> float:
        """Return k = m_b σ_ci/4."""
        return self.m_b * self.compressive_strength / 4

    @property
    def tension(self) -> float:
        """Return the biaxial tensile strength f = sσ_ci/m_b."""
        return self.s * self.compressive_strength / self.m_b

    def divided_by(self, factor: float) -> "HoekBrown":
        """Return the rock itself, which F does not weaken.

        Args:
            factor: F > 0.

        Raises:
            InputError: If ``reduced`` is true.
        """
        if self.reduced:
            raise InputError(
                "law = 'hoek-brown' has no strength that F can divide: the criterion with its "
                "strength divided by F is not a parabola. Give reduced = false to reduce only "
                "other ground, law = 'mohr-coulomb', or control = 'bounds' for a load factor."
            )
        return self

    def parameters(self) -> dict[str, float]:
        """Return κ, μ, k and f of :class:`HoekBrownLaw`."""
        of = Elastic(self.young, self.poisson)
        strength = {"curvature": self.curvature, "tension": self.tension}
        return {"bulk": of.bulk, "shear": of.shear, **strength}
