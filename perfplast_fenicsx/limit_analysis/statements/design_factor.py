"""The limit load against the load that the bodies are designed for."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class DesignFactor:
    """How many times the design load is carried.

    Attributes:
        zeta: Load factor of the design load.
        lower: So many times it is carried for certain; None where nothing is proven.
        upper: So many times it the bodies collapse for certain; None where nothing is proven.
        estimate: So many times it the mesh carries; None where its limit load was not found.
        name: Name of the combination of loads that it is, where it has one.
    """

    zeta: float
    lower: float | None
    upper: float | None
    estimate: float | None
    name: str = ""

    @staticmethod
    def of(
        zeta: float,
        lower: float | None,
        upper: float | None,
        estimate: float | None,
        name: str = "",
    ) -> "DesignFactor":
        """From the limit load and its bounds, as load factors."""

        def over(value: float | None) -> float | None:
            return None if value is None else value / zeta

        return DesignFactor(zeta, over(lower), over(upper), over(estimate), name)

    @property
    def carried(self) -> bool:
        """Whether the design load is carried for certain."""
        return self.lower is not None and bool(self.lower >= 1)

    @property
    def refused(self) -> bool:
        """Whether it is for certain not carried."""
        return self.upper is not None and bool(self.upper < 1)

    @property
    def decided(self) -> bool:
        """Whether one of both is proven."""
        return self.carried or self.refused

    def in_words(self) -> str:
        """Return the result in a sentence."""
        what = f"'{self.name}'" if self.name else "The design load"
        load = f"{what} (zeta = {self.zeta:.6g})"
        if self.carried and self.lower is not None:
            beyond = "" if self.upper is None else f"; {rounded_up(self.upper)} times it is not"
            spare = float(rounded_down(100 * (self.lower - 1), 2))
            return (
                f"{load} is carried for certain, {rounded_down(self.lower)} times: the proof leaves"
                f" {spare:g} % to spare{beyond}."
            )
        if self.refused and self.upper is not None:
            return (
                f"{load} is not carried: the bodies collapse at {rounded_up(self.upper)} times it"
                " at the latest."
            )
        proven = [
            f"{rounded_down(self.lower)} times it is carried" if self.lower is not None else "",
            f"{rounded_up(self.upper)} times it is not" if self.upper is not None else "",
        ]
        known = "; ".join(filter(None, proven)) or "nothing is proven of the bodies"
        guess = "" if self.estimate is None else f" (estimate: {self.estimate:.3g} times)"
        open_ = f"Whether {load[0].lower()}{load[1:]} is carried is not decided by this mesh"
        return f"{open_}: {known}{guess}{'; refine it' if all(proven) else ''}."


def check_design(design: float | None) -> None:
    """Refuse what is no load factor of a design load.

    Raises:
        InputError: If it is not a positive number.
    """
    if design is not None and not (design > 0 and math.isfinite(design)):
        raise InputError(f"design = {design} is not a load factor; give a positive one, often 1.0.")
