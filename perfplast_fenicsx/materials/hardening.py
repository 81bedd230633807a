"""Define a metal that hardens linearly."""

import math
from dataclasses import dataclass
from typing import ClassVar

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.materials.hardening_flow import HardeningFlowLaw
from perfplast_fenicsx.materials.hardening_law import HardeningLaw
from perfplast_fenicsx.materials.plastic_flow import Flow
from perfplast_fenicsx.materials.von_mises import VonMises


@dataclass(frozen=True)
class Hardening:
    """A body with von Mises' condition and linear hardening, which has no limit load.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        yield_stress: Initial uniaxial yield stress σ_y > 0.
        isotropic: Isotropic modulus H: growth of the yield stress per equivalent plastic strain
            (stress).
        kinematic: Kinematic modulus H: growth of the back stress per plastic strain (stress), in
            uniaxial stress. The yield stress rises in one direction and falls in the opposite one.
        expansion: Thermal strain per degree (1/temperature).

    Raises:
        InputError: If a number is out of its range, or if neither modulus is positive.
    """

    law: ClassVar[type[HardeningLaw]] = HardeningLaw
    flow_law: ClassVar[type[HardeningFlowLaw]] = HardeningFlowLaw

    young: float
    poisson: float
    yield_stress: float
    isotropic: float = 0.0
    kinematic: float = 0.0
    expansion: float = 0.0

    def __post_init__(self) -> None:
        VonMises(self.young, self.poisson, self.yield_stress, self.expansion)
        for field in ("isotropic", "kinematic"):
            value = getattr(self, field)
            if not (value >= 0 and math.isfinite(value)):
                raise InputError(
                    f"{field} = {value} is not a valid hardening modulus; give a number >= 0 in"
                    " stress units (softening is not possible)."
                )
            check_magnitude(field, value)
        if not self.isotropic + self.kinematic > 0:
            raise InputError(
                "isotropic and kinematic hardening are both zero; give one of them, or law ="
                " 'von-mises'."
            )

    def parameters(self) -> dict[str, float]:
        """Return the parameters of :class:`VonMisesLaw`, and ⅔H of both kinds."""
        perfect = VonMises(self.young, self.poisson, self.yield_stress).parameters()
        return perfect | {"isotropic": 2 / 3 * self.isotropic, "kinematic": 2 / 3 * self.kinematic}

    def remembering(self) -> Flow:
        """Return the material with plastic flow, for a history."""
        return Flow(self)
