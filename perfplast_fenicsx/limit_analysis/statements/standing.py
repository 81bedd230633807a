"""Define whether bodies are stable under their permanent loads, for any factor of the live ones."""

from dataclasses import dataclass

from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class Standing:
    """The multiple of the permanent loads that is carried, with the best factor of the live ones.

    It is the largest μ for which μL₀ + λL₁ is carried with any λ (:class:`question.Question`). If
    it is below 1, no load factor is carried, and yield stresses and cohesions are too small by 1/μ.

    Attributes:
        lower: Multiple that a stress carries; None if no stress was found.
        upper: Multiple beyond which a mechanism exists; None if no mechanism was found.
    """

    lower: float | None
    upper: float | None

    @property
    def falls(self) -> bool:
        """Whether a mechanism shows that the permanent loads are too large."""
        return self.upper is not None and self.upper < 1

    @property
    def stands(self) -> bool:
        """Whether a stress shows that the permanent loads are carried."""
        return self.lower is not None and self.lower >= 1

    @property
    def verdict(self) -> str:
        """The verb of a sentence about the stability of the bodies."""
        if self.falls:
            return "does not stand"
        return "stands" if self.stands else "may stand or not"

    def in_words(self) -> str:
        """Return the result in a clause."""
        if self.upper is not None and self.upper <= 0:
            return "no part of the constant loads, however small, is carried at any load factor"
        sides = []
        if self.lower is not None:
            sides.append(f"{rounded_down(self.lower)} times at least")
        if self.upper is not None:
            sides.append(f"{rounded_up(self.upper)} times at most")
        if not sides:
            return "whether the constant loads are carried was not found"
        words = f"the constant loads are carried {' and '.join(sides)}, at any load factor"
        if self.upper is None or self.upper >= 1:
            return words
        most = f" and at most {rounded_up(1 / self.lower)}" if self.lower else ""
        least = rounded_down(1 / self.upper)
        short = f"yield stresses and cohesions fall short by a factor of at least {least}{most}"
        return f"{words}; {short}"
