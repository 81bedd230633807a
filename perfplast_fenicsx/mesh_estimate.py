"""The limit load of a mesh in words: an estimate of that of the body, and no bound of it.

A mesh has a static side, the load of a stress in equilibrium and within yield at its points, and a
kinematic one, the power of a mechanism. They bound the limit load of the finite elements from below
and above, and that of the body, where it is coarse, on neither side. So both are told by their
distance alone, in no more digits than that supports.
"""

import math
from dataclasses import dataclass

from perfplast_fenicsx.rounding import rounded_down

MOST_DIGITS = 6
"""Significant digits of an estimate whose sides have met."""

FEWEST_DIGITS = 3
"""Significant digits of an estimate whose sides are far apart."""

UNTESTED_DIGITS = 4
"""Significant digits of an estimate that has one side only."""


@dataclass(frozen=True)
class MeshEstimate:
    """What is known of the limit load of a mesh.

    Attributes:
        static: Load of the static side (ζ), or the largest that a loading path has reached.
        estimate: The limit load; None where none was found.
        kinematic: Load of the kinematic side; None where no mechanism was found.
    """

    static: float
    estimate: float | None
    kinematic: float | None

    @property
    def apart(self) -> float | None:
        """Distance of the two sides, relative to the static one; None of one side, or of 0."""
        if self.kinematic is None or not self.static > 0:
            return None
        return abs(self.kinematic - self.static) / self.static

    @property
    def shown(self) -> str:
        """The estimate in as many digits as it is known to; "none" without one."""
        if self.estimate is None:
            return "none"
        return f"{self.estimate:.{self._digits()}g}"

    def sides(self) -> str:
        """How far the sides are apart, as part of a sentence."""
        apart = self.apart
        if apart is None:
            return "known from its static side alone"
        return f"its static and kinematic sides {percent(apart)} apart"

    def in_words(self) -> str:
        """The estimate and what it is worth, as the rest of a sentence that names the mesh."""
        if self.estimate is not None:
            return f"{self.shown}, {self.sides()}; no bound of the body"
        if self.static > 0:
            return f"not found, {rounded_down(self.static)} is carried; no bound of the body"
        return "not found"

    def _digits(self) -> int:
        apart = self.apart
        if apart is None:
            return UNTESTED_DIGITS
        if apart <= 10.0**-MOST_DIGITS:
            return MOST_DIGITS
        return min(max(FEWEST_DIGITS, 1 + math.ceil(-math.log10(apart))), MOST_DIGITS)


def percent(share: float) -> str:
    """A share in percent, in two digits: "0.74 %"."""
    return f"{100 * share:.2g} %"
