"""Define the load factor that is sought, its bounds, and results beside them."""

import math
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from petsc4py import PETSc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.tables import NotebookResult, Row


class Question(StrEnum):
    """The question of a limit analysis.

    If permanent loads L₀ are too large by themselves, no factor of the live loads L₁ is carried. A
    limit load measures the excess: the largest μ for which μL₀ + λL₁ is carried with any λ. Its
    mechanisms have L₀(v) = 1 and L₁(v) = 0. If μ < 1, the strengths are too small by the factor
    1/μ.
    """

    LIMIT = "limit"
    STANDS = "stands"

    @property
    def enough(self) -> float:
        """The factor up to which a search continues, even beyond that of a viscous flow.

        Permanent loads are carried if their factor is 1. Below 1 the search must
        distinguish little strength from none.
        """
        return 4.0 if self is Question.STANDS else 0.0

    def loads(self, live: PETSc.Vec, dead: PETSc.Vec) -> tuple[PETSc.Vec, PETSc.Vec, PETSc.Vec]:
        """Return the loads whose factor is sought, the permanent ones, and those of any factor.

        Collective.

        Missing loads are vectors of zeros.
        """
        none = live.duplicate()
        none.set(0.0)
        return (live, dead, none) if self is Question.LIMIT else (dead, none, live)

    def of(self, live: float, dead: float) -> tuple[float, float, float]:
        """Return the numbers of these loads, such as works, in the same order."""
        return (live, dead, 0.0) if self is Question.LIMIT else (dead, 0.0, live)


@dataclass(frozen=True)
class Standing:
    """The multiple of the permanent loads that is carried, with the best factor of the live ones.

    It is the largest μ for which μL₀ + λL₁ is carried with any λ (:class:`Question`). If
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
class StrengthPath(NotebookResult):
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
        return told | {"in_words": self.in_words(), "points": self.rows()}

    def rows(self) -> list[Row]:
        """Return a row for each point with the fields of :class:`PathPoint`."""
        return [asdict(point) for point in self.points]

    def draw_into(self, axes: Any) -> None:
        """Draw F over the work of the loads."""
        axes.plot([it.work for it in self.points], [it.factor for it in self.points], "o-")
        axes.set(xscale="log", xlabel="work of the loads", ylabel="F (estimate of the mesh)")
        axes.grid(alpha=0.3)


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


NOT_ADMISSIBLE = "the mechanism is not admissible"

GROWS_TOO_LITTLE = (
    "dilating bodies dilate enough only at the points of the mesh; control = 'bounds' looks"
    " for a mechanism in which they do everywhere"
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
        faults: All faults that the proof checker found, if it refuses the bound.
        over: The factor by which the stress of a refused bound may exceed the strength.
    """

    value: float | None
    kind: str
    of: Scope
    why_not: tuple[str, ...] = ()
    of_rounding: float = 0.0
    doubts: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    over: float = 1.0

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

    def refused(self, faults: tuple[str, ...], over: float = 1.0) -> "Bound":
        """Return the bound as one of the mesh, for the first of the faults that the checker found.

        The result has no value if the stress is not in equilibrium, or if the mechanism is not
        admissible even at the points of the mesh.
        """
        unfit = self.kind == "lower" or {NOT_ADMISSIBLE, GROWS_TOO_LITTLE} & {*self.doubts}
        value = None if self.doubts and unfit else self.value
        why = f"the proof checker refuses it: {faults[0]}"
        reasons = (*self.why_not, *self.doubts, why)
        found = replace(self, value=value, of=Scope.MESH, why_not=reasons, doubts=())
        return replace(found, faults=faults, over=over)

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
