"""Write the limit load of a mesh in words: an estimate for the body, and no bound of it.

A mesh has a static side, the load of a stress in equilibrium and within yield at its points. Its
kinematic side is the power of a mechanism. They bound the limit load of the finite elements from
below and above, but bound that of the body on neither side. So only their distance is printed, and
the estimate in few digits.
"""

import math
from dataclasses import dataclass

from perfplast_fenicsx.rounding import rounded_down


@dataclass(frozen=True)
class MeshEstimate:
    """Loads that bracket or estimate the limit load of a mesh.

    Attributes:
        static: Load factor ζ of the static side, or the largest one that a loading path has
            reached; −∞ if none is known.
        estimate: The limit load; None if none was found.
        kinematic: Load factor of the kinematic side; None if no mechanism was found.
    """

    static: float
    estimate: float | None
    kinematic: float | None

    @property
    def apart(self) -> float | None:
        """Distance of the two sides, relative to the static one.

        None with one side, or if that is 0.
        """
        if self.kinematic is None or self.static == 0 or not math.isfinite(self.static):
            return None
        return abs((self.kinematic - self.static) / self.static)

    @property
    def shown(self) -> str:
        """The estimate in a few digits; "none" without one."""
        if self.estimate is None:
            return "none"
        # Relative distance of the sides above which an estimate has one digit less.
        widest = 0.01
        wide = self.apart is not None and self.apart > widest
        # Number of significant digits of an estimate; a mesh is hardly ever fine enough for more.
        digits = 4
        return f"{self.estimate:.{digits - wide}g}"

    def in_words(self, zeta: str = "") -> str:
        """Return the estimate and its reliability, as the rest of a sentence about the mesh.

        Args:
            zeta: Text before loads, such as "ζ = ".
        """
        if self.estimate is None:
            known = self.static != 0 and math.isfinite(self.static)
            carried = f", but not below {zeta}{rounded_down(self.static)}" if known else ""
            beyond = "" if self.kinematic is None else f", nor above {zeta}{self.kinematic:.6g}"
            return f"not found{carried}{beyond}; no bound of the body"
        apart = self.apart
        if apart is None:
            side = "static" if self.kinematic is None else "kinematic"
            return f"{zeta}{self.shown}, known only from its {side} side; no bound of the body"
        sides = f"its static and kinematic sides {percent(apart)} apart"
        return f"{zeta}{self.shown}, {sides}; no bound of the body"


def percent(share: float) -> str:
    """Return a share in percent with two digits: "0.74 %", "430 %"."""
    touching = 1e-5  # relative distance of the sides below which its number has no meaning
    if share < touching:
        return f"less than {100 * touching:g} %"
    return f"{float(f'{100 * share:.2g}'):g} %"
