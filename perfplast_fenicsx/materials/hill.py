r"""Perfect plasticity with Hill's condition for rolled and drawn metals, in Hencky's form.

In the axes of the material, in which x is turned about z by an angle, the yield set is

    F(σ_y − σ_z)² + G(σ_z − σ_x)² + H(σ_x − σ_y)² + 2Lτ_yz² + 2Mτ_xz² + 2Nτ_xy² ≤ Y²

(R. Hill, Proc. R. Soc. A 193 (1948), 281). It leaves the mean stress free. In orthonormal
coordinates s of deviators along the form's principal axes it is Σ h_i s_i² ≤ Y², and since
elasticity is isotropic a trial stress t = 2μe outside returns to

    s_i = t_i/(1 + xh_i),    Σ h_i t_i²/(1 + xh_i)² = Y²,    x > 0,

by Newton's method on the inverse of the root of the left-hand side, which rises to x from zero
without overshooting (J. J. Moré, D. C. Sorensen, SIAM J. Sci. Stat. Comput. 4 (1983), 553). With
D_i = 2μ/(1 + xh_i) and q_i = D_i h_i s_i the derivative there is diag(D) − q⊗q/Σ h_i s_i q_i.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import ClassVar

import numpy as np
import ufl

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.hill_set import HillForm, HillSet
from perfplast_fenicsx.materials.isotropic_elasticity import IsotropicElasticity
from perfplast_fenicsx.materials.law import Law, Old
from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.rounding import TINY


@dataclass(frozen=True)
class HillLaw(Law):
    """Hill's condition; see :class:`Law` for the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        strength: Y (stress).
        first: See :class:`HillForm`.
        second: The same.
        turn: The same.
        yz: The same.
        xz: The same.
        xy: The same.
        axes: The same.
    """

    bulk: Expr
    shear: Expr
    strength: Expr
    first: Expr
    second: Expr
    turn: Expr
    yz: Expr
    xz: Expr
    xy: Expr
    axes: Expr
    projects: ClassVar[bool] = True

    @property
    def elastic(self) -> IsotropicElasticity:
        """C."""
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def form(self) -> HillForm:
        """Σ h_i s_i²."""
        angles = self.turn, self.yz, self.xz, self.xy, self.axes
        return HillForm(self.first, self.second, *angles)

    @property
    def yields(self) -> HillSet:
        """Σ h_i s_i² ≤ Y²."""
        return HillSet(self.form, self.strength)

    def trial(self, e: Expr) -> list[Expr]:
        """The elastic stress in the form's coordinates, over Y."""
        parts = ufl.dot(self.form.frame(len(e)), e)
        return [2 * self.shear / self.strength * parts[i] for i in range(len(e) - 1)]

    def returned(self, e: Expr) -> list[Expr]:
        """1/(1 + xh_i): what is left of the elastic stress."""
        t, weights = self.trial(e), self.form.weights(len(e))

        def nearer(x: Expr, _: int) -> Expr:
            w = [1 + x * h for h in weights]
            square = sum(h * (a / b) ** 2 for h, a, b in zip(weights, t, w, strict=True))
            slope = sum(h**2 * a**2 / b**3 for h, a, b in zip(weights, t, w, strict=True))
            size = ufl.sqrt(ufl.max_value(square, 1.0))
            return x + (size - 1) * square / ufl.max_value(slope, TINY)

        # Newton steps of a return: they leave rounding alone at ratios of shear stresses of 9 and
        # strains of 3e6 times those at yield.
        steps = 10
        x = reduce(nearer, range(steps), ufl.as_ufl(0.0))
        return [1 / (1 + x * h) for h in weights]

    def plastic(self, e: Expr, old: Old) -> Expr:
        """1 where e lies outside the elastic range, else 0."""
        beyond = self.yields.gauge(self.elastic.hooke(e))
        return ufl.conditional(ufl.gt(beyond, 1.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Σ(e), the derivative of ψ."""
        left = zip(self.trial(e), self.returned(e), strict=True)
        parts = ufl.as_vector([self.strength * t * share for t, share in left])
        deviator = ufl.dot(parts, self.form.frame(len(e)))
        return spherical(self.bulk * trace(e), len(e)) + deviator

    def potential(self, e: Expr, old: Old) -> Expr:
        """ψ(e) = ½ e:Ce less half of the square of the way to the yield set."""
        left = zip(self.trial(e), self.returned(e), strict=True)
        shape = sum(t**2 * share * (2 - share) for t, share in left)
        return self.bulk * trace(e) ** 2 / 2 + self.strength**2 / (4 * self.shear) * shape

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """D, shape (m − 1,), and N, shape (m,): Σ^{o,ρ}[d] = κ tr d δ + Qᵀ(D ∘ Qd) − (N:d) N."""
        shares, weights = self.returned(e), self.form.weights(len(e))
        s = [t * share for t, share in zip(self.trial(e), shares, strict=True)]
        D = [2 * self.shear * share for share in shares]
        q = [a * h * b for a, h, b in zip(D, weights, s, strict=True)]
        length = sum(h * a * b for h, a, b in zip(weights, s, q, strict=True))
        root = self.plastic(e, old) * ufl.sqrt((1 - rho) / ufl.max_value(length, TINY))
        normal = ufl.dot(ufl.as_vector([root * a for a in q]), self.form.frame(len(e)))
        return {
            "D": ufl.as_vector([rho * 2 * self.shear + (1 - rho) * a for a in D]),
            "N": normal,
        }

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Σ^{o,ρ}(e)[d]."""
        D, N, frame = stored["D"], stored["N"], self.form.frame(len(d))
        parts = ufl.dot(frame, d)
        scaled = ufl.as_vector([D[i] * parts[i] for i in range(len(d) - 1)])
        isotropic = spherical(self.bulk * trace(d), len(d))
        return isotropic + ufl.dot(scaled, frame) - ufl.dot(N, d) * N


@dataclass(frozen=True)
class Hill:
    """A rolled or drawn metal, elastic–perfectly plastic with Hill's condition of 1948.

    Ratios are of the yield stress in a direction of the material's axes, or of the shear stress
    times √3, to ``yield_stress``; all 1 is von Mises' condition. R₁₁ = 1 makes ``yield_stress``
    that of the first axis, as tests in the direction of rolling have it.

    Args:
        young: Young's modulus E > 0 (stress); elasticity is isotropic.
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Y > 0 (stress).
        r11: Ratio of tension along the first axis, positive.
        r22: The same along the second one.
        r33: The same along the third one, z.
        r12: Of shear in the plane of the first two.
        r13: Of shear in that of the first and the third.
        r23: Of shear in that of the second and the third.
        angle: From x to the first axis (degrees), about z.
        expansion: Strain of a change of temperature by one degree (1/temperature).

    Raises:
        InputError: If a number is out of its range, or ratios of tension let some stress grow
            without end.
    """

    law: ClassVar[type[HillLaw]] = HillLaw

    young: float
    poisson: float
    yield_stress: float
    r11: float = 1.0
    r22: float = 1.0
    r33: float = 1.0
    r12: float = 1.0
    r13: float = 1.0
    r23: float = 1.0
    angle: float = 0.0
    expansion: float = 0.0

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("yield_stress", self.yield_stress)
        for name in ("r11", "r22", "r33", "r12", "r13", "r23"):
            ratio = getattr(self, name)
            if not (ratio > 0 and math.isfinite(ratio)):
                raise InputError(f"{name} = {ratio} is not a positive number; give a ratio.")
        if not math.isfinite(self.angle):
            raise InputError(f"angle = {self.angle} is not finite; give degrees, or none.")
        # Ratio of the smaller h of normal stresses to the larger one,
        # below which it counts as none.
        least_ratio = 1e-6
        if not self.spectrum[1] > least_ratio * self.spectrum[0]:
            raise InputError(
                f"r11 = {self.r11}, r22 = {self.r22}, r33 = {self.r33} let a stress grow without"
                " yield, as one of them is too large beside the others; each 1/r has to be less"
                " than the sum of the other two."
            )

    @property
    def coefficients(self) -> tuple[float, float, float, float, float, float]:
        """F, G, H, L, M, N."""
        x, y, z = (1 / ratio**2 for ratio in (self.r11, self.r22, self.r33))
        yz, xz, xy = (1.5 / ratio**2 for ratio in (self.r23, self.r13, self.r12))
        return ((y + z - x) / 2, (z + x - y) / 2, (x + y - z) / 2, yz, xz, xy)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """Larger and smaller h of normal stresses, and angle of the first (:class:`HillForm`)."""
        F, G, H, *_ = self.coefficients
        form = np.array([[G + H, -H, -G], [-H, F + H, -F], [-G, -F, F + G]])
        basis = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
        values, vectors = np.linalg.eigh(basis @ form @ basis.T)
        turn = math.atan2(vectors[1, 1], vectors[0, 1])
        return float(values[1]), float(values[0]), turn

    @property
    def bulk(self) -> float:
        """κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def reduced(self, factor: float) -> "Hill":
        """The same body with Y/F.

        Args:
            factor: F > 0.
        """
        return replace(self, yield_stress=self.yield_stress / factor)

    def parameters(self) -> dict[str, float]:
        """κ, μ, Y and the form of :class:`HillLaw`."""
        first, second, turn = self.spectrum
        *_, L, M, N = self.coefficients
        return {
            "bulk": self.bulk,
            "shear": self.shear,
            "strength": self.yield_stress,
            "first": first,
            "second": second,
            "turn": turn,
            "yz": L,
            "xz": M,
            "xy": N,
            "axes": math.radians(self.angle),
        }
