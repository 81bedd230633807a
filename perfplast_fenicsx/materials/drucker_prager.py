r"""Define associated plasticity with the Drucker–Prager condition, in Hencky's form.

The yield set is the cone K: ‖dev σ‖/√2 + ηp ≤ c with p = tr σ/3. The elastic stress of a strain e
has the deviatoric norm r = 2μ‖dev e‖ and the mean p = κ tr e. With n = dev e/‖dev e‖ and D = μ +
κη²,

    f = r/√2 + ηp − c,     A = ηp − κη² r/(√2 μ) − c

    f ≤ 0           Σ = Ce                                 ψ = ½ e:Ce
    f > 0, A ≤ 0    Σ = Ce − (f/D)(√2 μ n + κη δ)          ψ = ½ e:Ce − ½ f²/D
    f > 0, A > 0    Σ = (c/η) δ, the apex                  ψ = (c/η) tr e − c²/(2κη²)

The stress Σ is the projection of Ce onto K in the norm of C⁻¹ (M. Čermák, S. Sysala, J. Valdman,
Appl. Math. Comput. 355 (2019), 595, section 3.2). Bodies dilate in plastic flow: strain rates are
admissible if tr ε ≥ √2 η‖dev ε‖. The dissipation (c/η) tr ε does not depend on the deviator.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import ufl

from perfplast_fenicsx.errors import InputError, check_choice
from perfplast_fenicsx.materials.elastic import Elastic, require_not_negative
from perfplast_fenicsx.materials.law import Cone, Law, Old, axial_cone
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity, deviator, spherical, trace
from perfplast_fenicsx.materials.nonassociated_flow import (
    Stand,
    associated,
    check_dilatancy,
    reduced,
)
from perfplast_fenicsx.rounding import TINY
from perfplast_fenicsx.spatial_fields import Strength

Match = Literal["plane-strain", "compression", "extension"]
"""States of stress in which the cone has the Mohr–Coulomb strength: collapse in plane strain,
triaxial compression or triaxial extension.
"""


@dataclass(frozen=True)
class DruckerPragerSet:
    """The yield set ‖dev σ‖/√2 + η tr σ/3 ≤ c; :class:`YieldSet` describes the methods.

    Args:
        slope: η > 0.
        strength: c ≥ 0 in pure shear (stress).
    """

    slope: Expr
    strength: Expr

    def gauge(self, s: Expr) -> Expr:
        """Return (‖dev σ‖/√2 + η tr σ/3)/c, or 0 if pressure makes this value negative.

        The value is very large if c = 0.
        """
        size = _size(deviator(s)) / math.sqrt(2) + self.slope * trace(s) / 3
        return ufl.max_value(size, 0.0) / ufl.max_value(self.strength, TINY)

    def support(self, rate: Expr) -> Expr:
        """Return (c/η) tr rate, for tr rate ≥ √2 η‖dev rate‖."""
        return self.strength / self.slope * trace(rate)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b, which no algorithm uses."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """Return the cone ‖dev σ‖ ≤ √2 c − √2 ηp, whose bound decreases with the mean stress p."""
        return (axial_cone(math.sqrt(2) * self.strength, math.sqrt(2) * self.slope, size),)

    def inadmissible(self, rate: Expr) -> None:
        """Return None: admissible rates form a cone, which no linear condition describes."""
        return None


@dataclass(frozen=True)
class DruckerPragerLaw(Law):
    """The law of the yield set ‖dev σ‖/√2 + η tr σ/3 ≤ c; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
        slope: η > 0.
        strength: c ≥ 0 in pure shear (stress).
    """

    bulk: Expr
    shear: Expr
    slope: Expr
    strength: Expr
    projects: ClassVar[bool] = True
    dilates: ClassVar[bool] = True

    @property
    def elastic(self) -> IsotropicElasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    @property
    def _stiffness(self) -> Expr:
        """Return D, the decrease of f per unit of the plastic multiplier."""
        return self.shear + self.bulk * self.slope**2

    def excess(self, e: Expr) -> Expr:
        """Return f of Ce (stress), positive outside K and negative inside."""
        mean = self.slope * self.bulk * trace(e)
        return math.sqrt(2) * self.shear * _size(deviator(e)) + mean - self.strength

    def beyond(self, e: Expr) -> Expr:
        """Return A (stress); a trial stress Ce outside K returns to the apex if A is positive."""
        mean = self.slope * self.bulk * (trace(e) - math.sqrt(2) * self.slope * _size(deviator(e)))
        return mean - self.strength

    def _by_branch(self, e: Expr, elastic: Expr, cone: Expr, apex: Expr) -> Expr:
        """Return the value of the active branch: elastic, cone or apex."""
        flows = ufl.conditional(ufl.gt(self.beyond(e), 0.0), apex, cone)
        return ufl.conditional(ufl.gt(self.excess(e), 0.0), flows, elastic)

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e lies outside the elastic range, else 0."""
        return ufl.conditional(ufl.gt(self.excess(e), 0.0), 1.0, 0.0)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of ψ."""
        flow = self.excess(e) / self._stiffness
        size, mean = 2 * self.shear * _size(deviator(e)), self.bulk * trace(e)
        pressure = self._by_branch(
            e, mean, mean - flow * self.bulk * self.slope, self.strength / self.slope
        )
        share = 1 - flow * math.sqrt(2) * self.shear / ufl.max_value(size, TINY)
        scaled = 2 * self.shear * self._by_branch(e, 1.0, share, 0.0)
        return spherical(pressure, len(e)) + scaled * deviator(e)

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e)."""
        elastic = ufl.dot(self.elastic.hooke(e), e) / 2
        tip = self.strength / self.slope
        cone = elastic - self.excess(e) ** 2 / (2 * self._stiffness)
        return self._by_branch(e, elastic, cone, tip * trace(e) - tip**2 / (2 * self.bulk))

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the terms of :meth:`tangent`: bulk and a, shape (), and P and M, shape (m,).

        Σ°[d] is Cd for elastic strains and 0 at the apex. On the cone, with the reduced deviatoric
        modulus a, P = √(2μ − a) n and M = (√2 μ n + κη δ)/√D, it is

            κ tr(d) δ + a dev d + (P:d) P − (M:d) M.
        """
        size = _size(deviator(e))
        n = deviator(e) / ufl.max_value(size, TINY)
        lost = self.excess(e) / self._stiffness * math.sqrt(2) * self.shear
        lost = lost / ufl.max_value(size, TINY)
        left = self._by_branch(e, 2 * self.shear, 2 * self.shear - lost, 0.0)
        on_cone = ufl.sqrt((1 - rho) * self._by_branch(e, 0.0, 1.0, 0.0))
        along = math.sqrt(2) * self.shear * n + spherical(self.bulk * self.slope, len(e))
        return {
            "bulk": rho * self.bulk + (1 - rho) * self._by_branch(e, self.bulk, self.bulk, 0.0),
            "a": rho * 2 * self.shear + (1 - rho) * left,
            "P": on_cone * ufl.sqrt(ufl.max_value(2 * self.shear - left, 0.0)) * n,
            "M": on_cone / ufl.sqrt(self._stiffness) * along,
        }

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d]."""
        P, M = stored["P"], stored["M"]
        isotropic = spherical(stored["bulk"] * trace(d), len(d)) + stored["a"] * deviator(d)
        return isotropic + ufl.dot(P, d) * P - ufl.dot(M, d) * M

    @property
    def yields(self) -> DruckerPragerSet:
        """Return the set ‖dev σ‖/√2 + η tr σ/3 ≤ c."""
        return DruckerPragerSet(self.slope, self.strength)


def _size(d: Expr) -> Expr:
    return ufl.sqrt(ufl.dot(d, d))


@dataclass(frozen=True)
class DruckerPrager:
    """Ground with the Drucker–Prager cone and associated flow.

    The cone approximates the Mohr–Coulomb pyramid, and touches the pyramid only in some states of
    stress. In 3D, the strengths of the three matches differ by up to a factor of two. In plane
    strain, the match ``"plane-strain"`` gives exactly the limit loads of Mohr–Coulomb.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        cohesion: Mohr–Coulomb cohesion (stress), zero for clean sand; a number, or a field that is
            positive everywhere.
        friction_angle: Mohr–Coulomb friction angle (degrees), between 0 and 90.
        match: States of stress in which the cone has the Mohr–Coulomb strength.
        expansion: Thermal strain per degree (1/temperature).
        dilatancy_angle: Dilatancy angle (degrees), between 0 and the friction angle, which is
            the default.
        nonassociated: Treatment of ground with ψ < φ: ``"radenkovic"`` bounds all its possible
            collapse loads; ``"davis-a"``, ``"davis-b"`` or ``"davis-c"`` replaces it by associated
            ground, which gives an estimate.
        reduced: Whether F of ``control = "strength"`` divides the strength; true by default.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    cohesion: Strength
    friction_angle: float
    match: Match
    expansion: float = 0.0
    dilatancy_angle: float | None = None
    nonassociated: Stand | None = None
    reduced: bool = True

    @property
    def law(self) -> type[DruckerPragerLaw]:
        """Return the class of the law."""
        return DruckerPragerLaw

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_not_negative("cohesion", self.cohesion)
        if not 0 < self.friction_angle < 90:
            raise InputError(
                f"friction_angle = {self.friction_angle} is not between 0 and 90 degrees; give the"
                " friction angle, or law = 'von-mises' for ground without friction, with"
                " yield_stress = √3 times its cohesion."
            )
        check_choice("match", self.match, ("plane-strain", "compression", "extension"))
        check_dilatancy(self)

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    @property
    def cone(self) -> tuple[float, Strength]:
        """Return η and the strength c in pure shear (stress).

        For ``"compression"`` and ``"extension"`` the cone passes through the pyramid's edges of
        triaxial compression or extension. For ``"plane-strain"`` its projection along σ_zz equals
        the projection of the Mohr–Coulomb set (D. C. Drucker, W. Prager, Q. Appl. Math. 10 (1952),
        157).
        """
        phi = math.radians(self.friction_angle)
        if self.match == "plane-strain":
            size = math.sqrt(9 + 12 * math.tan(phi) ** 2)
            return 3 * math.tan(phi) / size, 3 * self.cohesion / size
        sign = -1 if self.match == "compression" else 1
        size = math.sqrt(3) * (3 + sign * math.sin(phi))
        return 6 * math.sin(phi) / size, 6 * self.cohesion * math.cos(phi) / size

    def divided_by(self, factor: float) -> "DruckerPrager":
        """Return the same ground with c/F and tan φ/F; ``nonassociated`` determines ψ.

        Args:
            factor: F > 0.
        """
        return reduced(self, factor)

    def parameters(self) -> dict[str, Strength]:
        """Return κ, μ, η and c of :class:`DruckerPragerLaw`."""
        slope, strength = associated(self).cone
        return {"bulk": self.bulk, "shear": self.shear, "slope": slope, "strength": strength}
