"""Materials with the condition of Mohr and Coulomb, or of Tresca."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

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


@dataclass(frozen=True)
class Tresca:
    """A metal, or ground that cannot drain: shear stresses up to the cohesion.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        cohesion: Largest shear stress (stress), positive; half of the uniaxial yield stress.
        expansion: Strain of a change of temperature by one degree (1/temperature).

    Raises:
        InputError: If a number is out of its range.
    """

    law: ClassVar[type[MohrCoulombLaw]] = TrescaLaw

    young: float
    poisson: float
    cohesion: float
    expansion: float = 0.0

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_positive("cohesion", self.cohesion)

    @property
    def bulk(self) -> float:
        """κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def reduced(self, factor: float) -> "Tresca":
        """The same with c/F.

        Args:
            factor: F > 0.
        """
        return replace(self, cohesion=self.cohesion / factor)

    def parameters(self) -> dict[str, float]:
        """κ, μ, s and b of :class:`TrescaLaw`."""
        strength = 2 * self.cohesion
        return {"bulk": self.bulk, "shear": self.shear, "sine": 0.0, "strength": strength}


@dataclass(frozen=True)
class MohrCoulomb:
    """Ground with cohesion and an angle of friction: Mohr and Coulomb, associated.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        cohesion: Stress, zero of clean sand.
        friction_angle: Degrees, between 0 and 90.
        expansion: Strain of a change of temperature by one degree (1/temperature).
        dilatancy_angle: Degrees, between 0 and that of friction, which it is where it is left out.
        nonassociated: What is made of ground that dilates by less: ``"radenkovic"`` for bounds of
            all that it may carry, ``"davis-a"``, ``"davis-b"`` or ``"davis-c"`` for associated
            ground that stands for it, an estimate.

    Raises:
        InputError: If a number is out of its range.
    """

    law: ClassVar[type[MohrCoulombLaw]] = MohrCoulombLaw

    young: float
    poisson: float
    cohesion: float
    friction_angle: float
    expansion: float = 0.0
    dilatancy_angle: float | None = None
    nonassociated: Stand | None = None

    def __post_init__(self) -> None:
        Elastic(self.young, self.poisson, self.expansion)
        require_not_negative("cohesion", self.cohesion)
        if not 0 < self.friction_angle < 90:
            raise InputError(
                f"friction_angle = {self.friction_angle} is not between 0 and 90 degrees; give the"
                " angle of friction, or law = 'tresca' for ground without friction."
            )
        check_dilatancy(self)

    @property
    def bulk(self) -> float:
        """κ = E / (3(1 − 2ν))."""
        return Elastic(self.young, self.poisson).bulk

    @property
    def shear(self) -> float:
        """μ = E / (2(1 + ν))."""
        return Elastic(self.young, self.poisson).shear

    def reduced(self, factor: float) -> "MohrCoulomb":
        """The same ground with c/F and tan φ/F, and ψ by what is made of it.

        Args:
            factor: F > 0.
        """
        return reduced(self, factor)

    def parameters(self) -> dict[str, float]:
        """κ, μ, s and b of :class:`MohrCoulombLaw`."""
        ground = associated(self)
        phi = math.radians(ground.friction_angle)
        strength = 2 * ground.cohesion * math.cos(phi)
        return {
            "bulk": self.bulk,
            "shear": self.shear,
            "sine": math.sin(phi),
            "strength": strength,
        }
