"""Define Drucker's two bounds of the load that bodies with Coulomb's friction carry."""

import math
from dataclasses import dataclass
from typing import Any

from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class DruckerBounds:
    """Drucker's two bounds for a mesh with Coulomb's friction.

    Attributes:
        lower: Lower bound of the limit load without friction; 0 if only friction holds the bodies.
        upper: Upper bound of the limit load if surfaces neither slip nor separate. It is infinite
            if nothing seems to bound that load, None if it was not found.
    """

    lower: float
    upper: float | None

    def in_words(self) -> str:
        """Return the bounds in a sentence."""
        least = f"collapse or slide at no load below {rounded_down(self.lower)}, the limit load"
        least += " without friction"
        finite = self.upper is not None and math.isfinite(self.upper)
        # A lower bound below this share of the upper one is zero to rounding: the interior point
        # method ends when both sides are this close.
        rounding = 1e-6
        if self.lower <= rounding * (self.upper if finite and self.upper else 0.0):
            least = "may slide at any load, as without friction they carry none"
        tied = "if nothing slipped or separated where there is friction"
        if self.upper is None:
            most = f"; the limit load {tied} was not found"
        elif not finite:
            most = f", and would carry any load {tied}"
        else:
            most = (
                f", and collapse at {rounded_up(self.upper)} at the latest, the limit load {tied}"
            )
        return (
            f"with Coulomb's friction the bodies of this mesh {least}{most} (Drucker); no other"
            " limit theorem holds"
        )

    def table(self) -> dict[str, Any]:
        """Return the bounds and their words, in the form of ``summary.json``."""
        return {"lower": self.lower, "upper": self.upper, "words": self.in_words()}
