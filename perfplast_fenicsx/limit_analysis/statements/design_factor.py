"""Compare the limit load with the design load of the bodies."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class DesignFactor:
    """The multiple of the design load that is carried.

    Attributes:
        zeta: Load factor of the design load.
        lower: Multiple that is proven to be carried; None without a proof.
        upper: Multiple at which the bodies are proven to collapse; None without a proof.
        estimate: Multiple that the mesh carries; None if its limit load was not found.
        name: Name of the load combination, if it has one.
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
        """Return the multiples for a limit load and its bounds, given as load factors."""

        def over(value: float | None) -> float | None:
            return None if value is None else value / zeta

        return DesignFactor(zeta, over(lower), over(upper), over(estimate), name)

    @property
    def carried(self) -> bool:
        """Whether the design load is proven to be carried."""
        return self.lower is not None and bool(self.lower >= 1)

    @property
    def refused(self) -> bool:
        """Whether the design load is proven not to be carried."""
        return self.upper is not None and bool(self.upper < 1)

    @property
    def decided(self) -> bool:
        """Whether either is proven."""
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
    """Refuse an invalid load factor of a design load.

    Raises:
        InputError: If it is not a positive number.
    """
    if design is not None and not (design > 0 and math.isfinite(design)):
        raise InputError(f"design = {design} is not a load factor; give a positive one, often 1.0.")
