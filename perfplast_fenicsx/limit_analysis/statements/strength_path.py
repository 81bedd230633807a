"""Define the curve of the strength reduction factor over the work of the loads."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class PathPoint:
    """An equilibrium with reduced strengths.

    Attributes:
        factor: Factor F by which strengths are divided.
        work: Work L(u) of all loads (energy).
        displacement: Largest displacement (length).
        duality_gap: Relative duality gap of the equilibrium.
        newton_iterations: Newton iterations since the previous point, including those with other F
            at this work.
        linear_solves: Linear solves since the previous point, counted in the same way.
    """

    factor: float
    work: float
    displacement: float
    duality_gap: float
    newton_iterations: int
    linear_solves: int


@dataclass(frozen=True)
class StrengthPath:
    """F over work, from the first point until it has levelled off.

    Attributes:
        points: Points in the order of growing work.
        levelled_off: Whether F hardly rises any more.
        reason: Reason for the end.
    """

    points: tuple[PathPoint, ...]
    levelled_off: bool
    reason: str

    @property
    def factor(self) -> float | None:
        """The last F; None without any point."""
        return self.points[-1].factor if self.points else None

    def in_words(self) -> str:
        """Return the result in a sentence."""
        worth = "an estimate from a mesh, and no bound of the body"
        if not self.points:
            return f"No curve of F over work was found: {self.reason}."
        last = self.points[-1]
        if not self.levelled_off:
            return f"F over work has come to {last.factor:.5g} ({self.reason}): {worth}."
        return f"F over work levels off at {last.factor:.5g} ({len(self.points)} points): {worth}."

    def table(self) -> dict[str, Any]:
        """Return the table for ``summary.json``."""
        told = {"factor": self.factor, "levelled_off": self.levelled_off, "reason": self.reason}
        points = [asdict(point) for point in self.points]
        return told | {"in_words": self.in_words(), "points": points}
