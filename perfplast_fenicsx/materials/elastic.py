"""Linear elasticity."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, check_magnitude


@dataclass(frozen=True)
class Elastic:
    """A linear elastic body.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float

    def __post_init__(self) -> None:
        require_positive("young", self.young)
        if not -1.0 < self.poisson < 0.5:
            raise InputError(
                f"poisson = {self.poisson} is outside (-1, 1/2); give Poisson's ratio strictly"
                " between these (0.499 is fine for a nearly incompressible body)."
            )

    @property
    def bulk(self) -> float:
        """κ = E / (3(1 − 2ν))."""
        return self.young / (3 * (1 - 2 * self.poisson))

    @property
    def shear(self) -> float:
        """μ = E / (2(1 + ν))."""
        return self.young / (2 * (1 + self.poisson))

    @property
    def yield_radius(self) -> float:
        """γ = ∞: never yields."""
        return math.inf


def require_positive(field: str, value: float) -> None:
    """Refuse a number of a material that is not positive.

    Raises:
        InputError: Naming the field and the value.
    """
    if not (value > 0 and math.isfinite(value)):
        raise InputError(f"{field} = {value} is not a positive number; give it in stress units.")
    check_magnitude(field, value)
