"""The curve of the strength reduction factor over the work of the loads."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class PathPoint:
    """An equilibrium with reduced strengths.

    Attributes:
        factor: F, by which strengths are divided.
        work: Work of all loads, L(u) (energy).
        displacement: The largest (length).
        duality_gap: Duality gap of the equilibrium, relative.
        newton_iterations: Newton iterations that led to it from the point before, those of other F
            at its work too.
        linear_solves: As ``newton_iterations``.
    """

    factor: float
    work: float
    displacement: float
    duality_gap: float
    newton_iterations: int
    linear_solves: int


@dataclass(frozen=True)
class StrengthPath:
    """F over work, from the first point to where it has levelled off.

    Attributes:
        points: Points by work, which grows.
        levelled_off: Whether F hardly rises any more.
        reason: How it ended.
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
