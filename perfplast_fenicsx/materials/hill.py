r"""Perfect plasticity with Hill's condition for rolled and drawn metals, in Hencky's form.

In the axes of the material, in which x is turned about z by an angle, the yield set is

    F(σ_y − σ_z)² + G(σ_z − σ_x)² + H(σ_x − σ_y)² + 2Lτ_yz² + 2Mτ_xz² + 2Nτ_xy² ≤ Y²

(R. Hill, Proc. R. Soc. A 193 (1948), 281). It leaves the mean stress free. In orthonormal
coordinates s of deviators along the form's principal axes it is Σ h_i s_i² ≤ Y², and elasticity is
isotropic: stresses return as in :mod:`quadratic_law`, with B = Qᵀ.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic, require_positive
from perfplast_fenicsx.materials.hill_set import HillForm, HillSet
from perfplast_fenicsx.materials.isotropic_elasticity import IsotropicElasticity
from perfplast_fenicsx.materials.mandel import Expr, spherical, trace
from perfplast_fenicsx.materials.quadratic_law import QuadraticLaw
from perfplast_fenicsx.materials.sheet import Sheet


@dataclass(frozen=True)
class HillLaw(QuadraticLaw):
    """Hill's condition; see :class:`Law` for the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        strength: Y (stress).
        first: See :class:`HillForm`.
        second: As ``first``.
        turn: As ``second``.
        yz: As ``turn``.
        xz: As ``yz``.
        xy: As ``xz``.
        axes: As ``xy``.
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

    def free(self, e: Expr) -> Expr:
        """Mean stress."""
        return spherical(self.bulk * trace(e), len(e))


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
        reduced: Whether F of ``control = "strength"`` divides its strength, as by default.

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
    reduced: bool = True

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

    def divided_by(self, factor: float) -> "Hill":
        """Return the same body with Y/F.

        Args:
            factor: F > 0.
        """
        return replace(self, yield_stress=self.yield_stress / factor)

    def in_plane_stress(self) -> Sheet:
        """Gσ_x² + Fσ_y² + H(σ_x − σ_y)² + 2Nτ² ≤ Y² in the axes of the material."""
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
