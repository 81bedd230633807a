"""One bound of a limit load: its value, its scope, and why it is not strict."""

from dataclasses import dataclass
from enum import StrEnum

from perfplast_fenicsx.rounding import rounded_down, rounded_up


def measure_of(dissipation: float, load: float, loose: bool = False) -> float:
    """Return the measure of differences of load factors.

    Args:
        dissipation: Dissipation of a mechanism with L(v) = 1, which is λ without dead loads.
        load: λ.
        loose: Whether some of the ground has no cohesion, or a joint no adhesion, and dissipates
            nothing.
    """
    # What differences of bounds are measured by at least, relative to the load factor: where bodies
    # that dead loads hold together part, nothing is dissipated, as without cohesion.
    least_share = 1.0 if loose else 1e-3
    return max(abs(dissipation), least_share * abs(load))


class Scope(StrEnum):
    """The object of a bound: the body or its mesh."""

    BODY = "body"
    MESH = "mesh"


NO_MECHANISM = "no admissible mechanism was found"

CONFINED = (
    f"{NO_MECHANISM}: bodies that dilate may be confined, so that they carry any load, or cells"
    " are too large to let them grow; leave them room, or refine the mesh"
)


@dataclass(frozen=True)
class Bound:
    """A bound of a limit load, and what it is worth.

    Attributes:
        value: The bound; None where there is none.
        kind: "lower" or "upper".
        of: Whether it bounds the limit load of the body that the mesh fills, or that of the finite
            elements alone.
        why_not: Why it does not hold for the body; nothing where it does.
        of_rounding: Share of an upper one that rounding can have, in bodies that hardly strain.
    """

    value: float | None
    kind: str
    of: Scope
    why_not: tuple[str, ...] = ()
    of_rounding: float = 0.0

    @property
    def strict(self) -> bool:
        """Whether it holds for the body, but for rounding."""
        return self.value is not None and self.of is Scope.BODY

    @property
    def shown(self) -> str:
        """The value in a few digits, rounded so that it is a bound as well."""
        if self.value is None:
            return "none"
        return rounded_down(self.value) if self.kind == "lower" else rounded_up(self.value)

    def apart(self, upper: "Bound") -> float | None:
        """By how much an upper bound exceeds this lower one, relative to the smaller magnitude.

        None where one of them is missing, or 0 is between them.
        """
        if self.value is None or upper.value is None or not self.value * upper.value > 0:
            return None
        return (upper.value - self.value) / min(abs(self.value), abs(upper.value))

    def improves(self, old: "Bound") -> bool:
        """Whether it is the better one of the body: of those of meshes alone the new one is."""
        if self.value is None or old.value is None:
            return self.value is not None
        if self.strict and old.strict:
            return self.value > old.value if self.kind == "lower" else self.value < old.value
        return self.strict or not old.strict

    def __repr__(self) -> str:
        value = self.shown
        told = f"; not strict: {', '.join(self.why_not)}" if self.why_not else ""
        return f"Bound({self.kind} {value} of the {self.of}{told})"
