"""Define one bound of a limit load: its value, its scope, and why it is not strict."""

from dataclasses import dataclass, replace
from enum import StrEnum

from perfplast_fenicsx.rounding import rounded_down, rounded_up


def measure_of(dissipation: float, load: float, loose: bool = False) -> float:
    """Return the size that differences of load factors are relative to.

    Args:
        dissipation: Dissipation of a mechanism with L(v) = 1; it is λ without permanent loads.
        load: Load factor λ.
        loose: Whether some of the ground has no cohesion, or a joint no adhesion, and dissipates
            nothing.
    """
    # Least size relative to the load factor. If bodies that permanent loads hold together separate,
    # nothing is dissipated, as without cohesion.
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
    """A bound of a limit load, and its scope.

    Attributes:
        value: The bound; None without one.
        kind: "lower" or "upper".
        of: Whether it bounds the limit load of the body that the mesh fills, or only that of the
            finite elements.
        why_not: Reasons why it does not hold for the body; empty if it does.
        of_rounding: Share of an upper bound that may be rounding, in bodies that hardly strain.
        doubts: Reasons why it may not hold, until the proof checker has judged it.
    """

    value: float | None
    kind: str
    of: Scope
    why_not: tuple[str, ...] = ()
    of_rounding: float = 0.0
    doubts: tuple[str, ...] = ()

    @property
    def strict(self) -> bool:
        """Whether it holds for the body, up to rounding."""
        return self.can_be_strict and not self.doubts

    @property
    def can_be_strict(self) -> bool:
        """Whether the proof checker has to judge it."""
        return self.value is not None and self.of is Scope.BODY

    def proven(self, value: float | None = None) -> "Bound":
        """Return the bound as the checker has proven it, with the value that the checker proves."""
        return replace(self, value=self.value if value is None else value, doubts=())

    def refused(self, why: str) -> "Bound":
        """Return it as one of the mesh; without a value where a stress balances too little."""
        value = None if self.doubts and self.kind == "lower" else self.value
        reasons = (*self.why_not, *self.doubts, why)
        return replace(self, value=value, of=Scope.MESH, why_not=reasons, doubts=())

    @property
    def shown(self) -> str:
        """The value in a few digits, rounded so that it remains a bound."""
        if self.value is None:
            return "none"
        return rounded_down(self.value) if self.kind == "lower" else rounded_up(self.value)

    def apart(self, upper: "Bound") -> float | None:
        """Return the distance to an upper bound, relative to the smaller magnitude of both.

        None if one of them is missing, or 0 lies between them.
        """
        if self.value is None or upper.value is None or not self.value * upper.value > 0:
            return None
        return (upper.value - self.value) / min(abs(self.value), abs(upper.value))

    def improves(self, old: "Bound") -> bool:
        """Return whether it is better than an old bound; bounds of meshes replace each other."""
        if self.value is None or old.value is None:
            return self.value is not None
        if self.strict and old.strict:
            return self.value > old.value if self.kind == "lower" else self.value < old.value
        return self.strict or not old.strict

    def __repr__(self) -> str:
        value = self.shown
        reasons = (*self.why_not, *self.doubts)
        told = f"; not strict: {', '.join(reasons)}" if reasons else ""
        return f"Bound({self.kind} {value} of the {self.of}{told})"
