"""Define materials with the Mohr–Coulomb or Tresca condition."""

import math
from dataclasses import dataclass, replace

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import (
    Elastic,
    require_not_negative,
    require_positive,
)
from perfplast_fenicsx.materials.mohr_coulomb import MohrCoulombLaw, TrescaLaw
from perfplast_fenicsx.materials.nonassociated_flow import (
    Stand,
    associated,
    check_dilatancy,
    reduced,
)
from perfplast_fenicsx.materials.tension_cut_off import CutOffLaw
from perfplast_fenicsx.materials.varying_friction import (
    FrictionSine,
    FrictionStrength,
    friction_of,
)
from perfplast_fenicsx.spatial_fields import SpatialField, Strength


@dataclass(frozen=True)
class Tresca:
    """A metal or undrained ground, whose shear strength is the cohesion.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        cohesion: Largest shear stress (stress), positive, a number or a field; half of the
            uniaxial yield stress.
        expansion: Thermal strain per degree (1/temperature).
        tensile_strength: Largest tension f in any direction (stress), positive; by default, the
            tension has no separate limit.
        reduced: Whether F of ``control = "strength"`` divides the strength; true by default.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    cohesion: Strength
    expansion: float = 0.0
    tensile_strength: float | None = None
    reduced: bool = True

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("cohesion", self.cohesion)
        check_tension(self.tensile_strength, self.cohesion)

    @property
    def law(self) -> type[MohrCoulombLaw]:
        """Return the class of the law, with or without a tensile strength."""
        return TrescaLaw if self.tensile_strength is None else CutOffLaw

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def divided_by(self, factor: float) -> "Tresca":
        """Return the same material with c/F and f/F.

        Args:
            factor: F > 0.
        """
        tension = divided(self.tensile_strength, factor)
        return replace(self, cohesion=self.cohesion / factor, tensile_strength=tension)

    def parameters(self) -> dict[str, Strength]:
        """Return κ, μ, s and b of :class:`TrescaLaw`, and f if there is a tensile strength."""
        numbers: dict[str, Strength] = {"bulk": self.bulk, "shear": self.shear, "sine": 0.0}
        return {**numbers, "strength": 2 * self.cohesion, **of_tension(self.tensile_strength)}


@dataclass(frozen=True)
class MohrCoulomb:
    """Ground with the Mohr–Coulomb condition and associated flow.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        cohesion: Cohesion (stress), zero for clean sand; a number, or a field that is positive
            everywhere.
        friction_angle: Friction angle (degrees), between 0 and 90; a number, or in plane strain
            a field.
        expansion: Thermal strain per degree (1/temperature).
        dilatancy_angle: Dilatancy angle (degrees), between 0 and the friction angle, which is
            the default.
        nonassociated: Treatment of ground with ψ < φ: ``"radenkovic"`` bounds all its possible
            collapse loads; ``"davis-a"``, ``"davis-b"`` or ``"davis-c"`` replaces it by associated
            ground, which gives an estimate.
        tensile_strength: Largest tension f in any direction (stress), positive. By default, and for
            values from c cot φ on, only cohesion and friction limit the tension.
        reduced: Whether F of ``control = "strength"`` divides the strength; true by default.

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    cohesion: Strength
    friction_angle: Strength
    expansion: float = 0.0
    dilatancy_angle: float | None = None
    nonassociated: Stand | None = None
    tensile_strength: float | None = None
    reduced: bool = True

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_not_negative("cohesion", self.cohesion)
        if isinstance(self.friction_angle, SpatialField):
            self._check_field()
            return
        if not 0 < self.friction_angle < 90:
            raise InputError(
                f"friction_angle = {self.friction_angle} is not between 0 and 90 degrees; give the"
                " friction angle, or law = 'tresca' for ground without friction."
            )
        check_dilatancy(self)
        check_tension(self.tensile_strength, self.cohesion)
        if self.tensile_strength is not None and self.nonassociated == "radenkovic":
            raise InputError(
                f"tensile_strength = {self.tensile_strength:g} with nonassociated = 'radenkovic': "
                "Radenkovic's bounds need ground without a tensile strength; remove it, or give "
                "nonassociated = 'davis-a' for an estimate."
            )

    def _check_field(self) -> None:
        """Refuse parameters that a spatially varying friction angle does not allow.

        Raises:
            InputError: If there is such a parameter; the message names the first one.
        """
        for key in ("dilatancy_angle", "nonassociated", "tensile_strength"):
            if (given := getattr(self, key)) is not None:
                raise InputError(
                    f"{key} = {given} with a friction_angle that varies in space is not supported;"
                    " remove it, or give each body a friction_angle that is a number."
                )

    @property
    def law(self) -> type[MohrCoulombLaw]:
        """Return the class of the law, with or without a tensile strength below the apex."""
        return CutOffLaw if self._tension is not None else MohrCoulombLaw

    @property
    def _tension(self) -> float | None:
        """Return the tensile strength f; None if no f is given, or if f is not below the apex."""
        given = self.tensile_strength
        if given is None or isinstance(self.cohesion, SpatialField):
            return None
        apex = self.cohesion / math.tan(math.radians(self.friction_angle))
        return given if given < apex else None

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def divided_by(self, factor: float) -> "MohrCoulomb":
        """Return the same ground with c/F, tan φ/F and f/F; ``nonassociated`` determines ψ.

        Args:
            factor: F > 0.
        """
        ground: MohrCoulomb = reduced(self, factor)
        return replace(ground, tensile_strength=divided(self.tensile_strength, factor))

    def parameters(self) -> dict[str, Strength]:
        """Return κ, μ, s and b of :class:`MohrCoulombLaw`, and f if it is below the apex."""
        angle = self.friction_angle
        if isinstance(angle, SpatialField):
            friction = friction_of(angle)
            sine = FrictionSine(friction)
            varies = isinstance(self.cohesion, SpatialField) or self.cohesion > 0
            bound = FrictionStrength(self.cohesion, friction) if varies else 0.0
            return {"bulk": self.bulk, "shear": self.shear, "sine": sine, "strength": bound}
        ground = associated(self)
        phi = math.radians(ground.friction_angle)
        strength = 2 * ground.cohesion * math.cos(phi)
        return {
            "bulk": self.bulk,
            "shear": self.shear,
            "sine": math.sin(phi),
            "strength": strength,
            **of_tension(self._tension),
        }


def check_tension(tension: float | None, cohesion: Strength) -> None:
    """Refuse a tensile strength that is not positive, or that is given with a varying cohesion.

    Raises:
        InputError: If the tensile strength is refused.
    """
    if tension is None:
        return
    if isinstance(cohesion, SpatialField):
        raise InputError(
            f"tensile_strength = {tension:g} is not supported with a cohesion that varies in "
            "space; remove tensile_strength, or give each body a constant cohesion."
        )
    if not (tension > 0 and math.isfinite(tension)):
        raise InputError(
            f"tensile_strength = {tension} is not a positive stress; give a small one, "
            f"such as {1e-3 * cohesion or 1e-3:g}, for ground that bears no tension, or "
            "remove it."
        )


def divided(tension: float | None, factor: float) -> float | None:
    """Return a tensile strength divided by a factor; None without a tensile strength."""
    return None if tension is None else tension / factor


def of_tension(tension: float | None) -> dict[str, float]:
    """Return the parameter f of :class:`CutOffLaw`; an empty dict without a tensile strength."""
    return {} if tension is None else {"tension": tension}
