"""Define perfect plasticity with Hill's condition for rolled and drawn metals, in Hencky's form.

In the axes of the material, whose x axis is rotated about z by an angle, the yield set is

    F(σ_y − σ_z)² + G(σ_z − σ_x)² + H(σ_x − σ_y)² + 2Lτ_yz² + 2Mτ_xz² + 2Nτ_xy² ≤ Y²

(R. Hill, Proc. R. Soc. A 193 (1948), 281). The condition does not bound the mean stress. Elasticity
is isotropic. Let s be orthonormal coordinates of the deviator along the principal axes of the form.
The yield set is then Σ h_i s_i² ≤ Y². Stresses outside the set return to it as in
:mod:`quadratic_law`, with B = Qᵀ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import ufl

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.law import Cone
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity, spherical, trace
from perfplast_fenicsx.materials.quadratic_law import QuadraticLaw
from perfplast_fenicsx.materials.sheet import Sheet


@dataclass(frozen=True)
class HillForm:
    """The form Σ h_i s_i², with s = Q dev σ.

    Args:
        first: The larger h_i for normal stresses.
        second: The smaller h_i for normal stresses.
        turn: Angle (radians) from (1, −1, 0)/√2 to the principal axis of ``first``, towards (1, 1,
            −2)/√6.
        yz: Coefficient L.
        xz: Coefficient M.
        xy: Coefficient N.
        axes: Angle about z (radians), from x to the first axis of the material.
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
        """Return Q, whose rows are orthonormal deviators, shape (m − 1, m)."""
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
    """The yield set Σ h_i s_i² ≤ Y²; :class:`YieldSet` describes the methods.

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
        """Return Σ a_i b_i/h_i + ⅓ tr a tr b."""
        frame, weights = self.form.frame(len(a)), self.form.weights(len(a))
        left, right = ufl.dot(frame, a), ufl.dot(frame, b)
        shape = sum(left[i] * right[i] / h for i, h in enumerate(weights))
        return shape + trace(a) * trace(b) / 3

    def _sum(self, s: Expr, power: int) -> Expr:
        parts, weights = ufl.dot(self.form.frame(len(s)), s), self.form.weights(len(s))
        return sum(h**power * parts[i] ** 2 for i, h in enumerate(weights))

    def cones(self, size: int) -> Sequence[Cone]:
        """Return one cone with zero slope."""
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


@dataclass(frozen=True)
class HillLaw(QuadraticLaw):
    """The law of Hill's condition; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        strength: Y (stress).
        first: See :class:`HillForm`.
        second: See :class:`HillForm`.
        turn: See :class:`HillForm`.
        yz: See :class:`HillForm`.
        xz: See :class:`HillForm`.
        xy: See :class:`HillForm`.
        axes: See :class:`HillForm`.
    """

    first: Expr
    second: Expr
    turn: Expr
    yz: Expr
    xz: Expr
    xy: Expr
    axes: Expr

    @property
    def elastic(self) -> IsotropicElasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def form(self) -> HillForm:
        """Return the form Σ h_i s_i²."""
        angles = self.turn, self.yz, self.xz, self.xy, self.axes
        return HillForm(self.first, self.second, *angles)

    @property
    def yields(self) -> HillSet:
        """Return the set Σ h_i s_i² ≤ Y²."""
        return HillSet(self.form, self.strength)

    def free(self, e: Expr) -> Expr:
        """Return the spherical part of Ce, shape (m,)."""
        return spherical(self.bulk * trace(e), len(e))


@dataclass(frozen=True)
class Hill:
    """A rolled or drawn metal, elastic–perfectly plastic with Hill's condition of 1948.

    A ratio of tension is the yield stress along an axis of the material divided by
    ``yield_stress``. A ratio of shear is √3 times the shear yield stress divided by
    ``yield_stress``. If all ratios are 1, the condition is von Mises' condition. With R₁₁ = 1,
    ``yield_stress`` is the yield stress along the first axis, as in tests in the rolling direction.

    Args:
        young: Young's modulus E > 0 (stress); elasticity is isotropic.
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Reference yield stress Y > 0 (stress), to which the ratios refer.
        r11: Ratio of tension along the first axis, positive.
        r22: Ratio of tension along the second axis, positive.
        r33: Ratio of tension along the third axis z, positive.
        r12: Ratio of shear in the plane of the first two axes.
        r13: Ratio of shear in the plane of the first and third axes.
        r23: Ratio of shear in the plane of the second and third axes.
        angle: Angle about z from x to the first axis (degrees).
        expansion: Thermal strain per degree (1/temperature).
        reduced: Whether F of ``control = "strength"`` divides the strength; true by default.

    Raises:
        InputError: If a number is out of its range, or if the ratios of tension leave a stress
            unbounded.
    """

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
    reduced: bool = True

    @property
    def law(self) -> type[HillLaw]:
        """Return the class of the law."""
        return HillLaw

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("yield_stress", self.yield_stress)
        for name in ("r11", "r22", "r33", "r12", "r13", "r23"):
            ratio = getattr(self, name)
            if not (ratio > 0 and math.isfinite(ratio)):
                raise InputError(
                    f"{name} = {ratio} is not a positive number; give a positive ratio."
                )
        if not math.isfinite(self.angle):
            raise InputError(f"angle = {self.angle} is not finite; give degrees, or remove it.")
        # Smallest allowed ratio of the smaller h_i for normal stresses to the larger h_i.
        least_ratio = 1e-6
        if not self.spectrum[1] > least_ratio * self.spectrum[0]:
            raise InputError(
                f"r11 = {self.r11}, r22 = {self.r22}, r33 = {self.r33} leave some stresses "
                "unbounded, because one ratio is too small compared with the others; each 1/r "
                "must be less than the sum of the other two."
            )

    @property
    def coefficients(self) -> tuple[float, float, float, float, float, float]:
        """Return the coefficients F, G, H, L, M and N of Hill's condition."""
        x, y, z = (1 / ratio**2 for ratio in (self.r11, self.r22, self.r33))
        yz, xz, xy = (1.5 / ratio**2 for ratio in (self.r23, self.r13, self.r12))
        return ((y + z - x) / 2, (z + x - y) / 2, (x + y - z) / 2, yz, xz, xy)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """Return ``first``, ``second`` and ``turn`` of :class:`HillForm`."""
        F, G, H, *_ = self.coefficients
        form = np.array([[G + H, -H, -G], [-H, F + H, -F], [-G, -F, F + G]])
        basis = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
        values, vectors = np.linalg.eigh(basis @ form @ basis.T)
        turn = math.atan2(vectors[1, 1], vectors[0, 1])
        return float(values[1]), float(values[0]), turn

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def divided_by(self, factor: float) -> "Hill":
        """Return the same body with Y/F.

        Args:
            factor: F > 0.
        """
        return replace(self, yield_stress=self.yield_stress / factor)

    def in_plane_stress(self) -> Sheet:
        """Return the sheet with Gσ_x² + Fσ_y² + H(σ_x − σ_y)² + 2Nτ² ≤ Y² in its material axes."""
        F, G, H, *_, N = self.coefficients
        own = np.array([[G + H, -H, 0.0], [-H, F + H, 0.0], [0.0, 0.0, N]])
        c, s = math.cos(math.radians(self.angle)), math.sin(math.radians(self.angle))
        root = math.sqrt(2)
        turn = np.array(
            [
                [c * c, s * s, root * c * s],
                [s * s, c * c, -root * c * s],
                [-root * c * s, root * c * s, c * c - s * s],
            ]
        )
        form: Floats = np.asarray(turn.T @ own @ turn, dtype=np.float64)
        return Sheet(self.bulk, self.shear, self.yield_stress, form)

    def parameters(self) -> dict[str, float]:
        """Return κ, μ, Y and the parameters of the form, by the names of :class:`HillLaw`."""
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
