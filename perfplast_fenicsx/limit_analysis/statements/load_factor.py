"""Define the load factor of a limit analysis, its bounds, and related results."""

import math
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from petsc4py import PETSc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.rounding import ROUNDING, rounded_down, rounded_up
from perfplast_fenicsx.tables import NotebookResult, Row


class Question(StrEnum):
    """The load factor that a limit analysis computes.

    If the constant loads L₀ are too large, the bodies cannot carry them with any factor of the
    live loads L₁. A second limit load measures the excess: the largest μ for which the bodies carry
    μL₀ + λL₁ with some λ. Mechanisms of this second limit load have L₀(v) = 1 and L₁(v) = 0. If μ <
    1, the strengths are too small by the factor 1/μ.
    """

    LIMIT = "limit"
    STANDS = "stands"

    @property
    def enough(self) -> float:
        """Return the load factor that a search must exceed before it reports an unbounded load.

        For ``STANDS``, the bodies carry the constant loads if their factor is at least 1. Below
        this factor, a search must therefore not end because the load seems to be unbounded.
        """
        return 4.0 if self is Question.STANDS else 0.0

    def loads(self, live: PETSc.Vec, dead: PETSc.Vec) -> tuple[PETSc.Vec, PETSc.Vec, PETSc.Vec]:
        """Return the loads with the unknown factor, the loads without a factor, and the free loads.

        Collective.

        A vector is zero if there are no loads of its kind.
        """
        none = live.duplicate()
        none.set(0.0)
        return (live, dead, none) if self is Question.LIMIT else (dead, none, live)

    def of(self, live: float, dead: float) -> tuple[float, float, float]:
        """Return values for both loads, such as works, in the order of :meth:`loads`."""
        return (live, dead, 0.0) if self is Question.LIMIT else (dead, 0.0, live)


@dataclass(frozen=True)
class Standing:
    """Bounds of the multiple of the constant loads that bodies carry at the best live load factor.

    The multiple is the largest μ for which the bodies carry μL₀ + λL₁ with some λ
    (:class:`Question`). If μ < 1, the bodies cannot carry the constant loads at any load factor.
    Yield stresses and cohesions are then too small by the factor 1/μ.

    Attributes:
        lower: Multiple for which the search found a stress; None without such a stress.
        upper: Multiple above which a mechanism exists; None if the search found no mechanism.
    """

    lower: float | None
    upper: float | None

    @property
    def falls(self) -> bool:
        """Return whether a mechanism shows that the constant loads are too large."""
        return self.upper is not None and self.upper < 1

    @property
    def stands(self) -> bool:
        """Return whether a stress shows that the bodies carry the constant loads."""
        return self.lower is not None and self.lower >= 1

    @property
    def verdict(self) -> str:
        """Return the verb for a sentence on the stability of the bodies."""
        if self.falls:
            return "does not stand"
        return "stands" if self.stands else "may or may not stand"

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
            return "it was not found whether the constant loads are carried"
        words = f"the constant loads are carried {' and '.join(sides)}, at any load factor"
        if self.upper is None or self.upper >= 1:
            return words
        most = f" and at most {rounded_up(1 / self.lower)}" if self.lower else ""
        least = rounded_down(1 / self.upper)
        short = f"yield stresses and cohesions fall short by a factor of at least {least}{most}"
        return f"{words}; {short}"


@dataclass(frozen=True)
class DesignFactor:
    """The multiple of the design load that the bodies carry.

    Attributes:
        zeta: Load factor of the design load.
        lower: Multiple that the bodies provably carry; None without a proof.
        upper: Multiple at which the bodies provably collapse; None without a proof.
        estimate: Multiple that the mesh carries; None if the limit load of the mesh was not found.
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
        """Return the multiples for a limit load and its bounds, which are load factors."""

        def over(value: float | None) -> float | None:
            return None if value is None else value / zeta

        return DesignFactor(zeta, over(lower), over(upper), over(estimate), name)

    @property
    def carried(self) -> bool:
        """Return whether the bodies provably carry the design load."""
        return self.lower is not None and bool(self.lower >= 1)

    @property
    def refused(self) -> bool:
        """Return whether the bodies provably do not carry the design load."""
        return self.upper is not None and bool(self.upper < 1)

    @property
    def decided(self) -> bool:
        """Return whether it is proven that bodies carry the design load, or that they do not."""
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
        known = "; ".join(filter(None, proven)) or "nothing is proven for the bodies"
        guess = "" if self.estimate is None else f" (estimate: {self.estimate:.3g} times)"
        open_ = f"Whether {load[0].lower()}{load[1:]} is carried is not decided by this mesh"
        return f"{open_}: {known}{guess}{'; refine it' if all(proven) else ''}."


def check_design(design: float | None) -> None:
    """Check the load factor of a design load.

    Raises:
        InputError: If the load factor is not a positive finite number.
    """
    if design is not None and not (design > 0 and math.isfinite(design)):
        raise InputError(
            f"design = {design} is not a load factor; give a positive number, usually 1."
        )


@dataclass(frozen=True)
class DruckerBounds:
    """Drucker's two bounds for a mesh with Coulomb's friction.

    Attributes:
        lower: Lower bound on the limit load without friction; 0 if friction alone holds the bodies.
        upper: Upper bound on the limit load if surfaces with friction neither slip nor separate.
            The value is ∞ if this load seems to be unbounded, and ``None`` if no bound was found.
    """

    lower: float
    upper: float | None

    def in_words(self) -> str:
        """Return the bounds in a sentence."""
        least = f"collapse or slide at no load below {rounded_down(self.lower)}, the limit load"
        least += " without friction"
        finite = self.upper is not None and math.isfinite(self.upper)
        # A lower bound below this share of the upper bound counts as zero, because the interior
        # point method cannot resolve smaller values.
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
        """Return the bounds and their description in words, as ``summary.json`` contains them."""
        return {"lower": self.lower, "upper": self.upper, "words": self.in_words()}


@dataclass(frozen=True)
class PathPoint:
    """A state of equilibrium with reduced strengths.

    Attributes:
        factor: Factor F by which strengths are divided.
        work: Work L(u) of all loads (energy).
        displacement: Largest displacement (length).
        duality_gap: Relative duality gap of the equilibrium.
        newton_iterations: Newton iterations since the previous point, including iterations for
            other F at this work.
        linear_solves: Linear solves since the previous point, including solves for other F.
    """

    factor: float
    work: float
    displacement: float
    duality_gap: float
    newton_iterations: int
    linear_solves: int


@dataclass(frozen=True)
class StrengthPath(NotebookResult):
    """The curve of F over work, from the first point until F has levelled off.

    Attributes:
        points: Points in ascending order of work.
        levelled_off: Whether F has levelled off to the tolerance.
        reason: Reason for the end of the curve.
    """

    points: tuple[PathPoint, ...]
    levelled_off: bool
    reason: str

    @property
    def factor(self) -> float | None:
        """Return F at the last point; None if there are no points."""
        return self.points[-1].factor if self.points else None

    def in_words(self) -> str:
        """Return the result in a sentence."""
        worth = "an estimate from a mesh, not a bound of the body"
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
    """Return the size by which differences of load factors are divided.

    Args:
        dissipation: Dissipation of a mechanism with L(v) = 1; without constant loads it equals λ.
        load: Load factor λ.
        loose: Whether some ground without cohesion, or a joint without adhesion, dissipates
            nothing.
    """
    # Least size, relative to the load factor. The dissipation is zero without cohesion, and if
    # bodies separate that only constant loads hold together.
    least_share = 1.0 if loose else 1e-3
    return max(abs(dissipation), least_share * abs(load))


class Scope(StrEnum):
    """The object for which a bound holds: the body or its mesh."""

    BODY = "body"
    MESH = "mesh"


NO_MECHANISM = "no admissible mechanism was found"

CONFINED = (
    f"{NO_MECHANISM}: bodies that dilate may be confined and then carry any load, or cells"
    " are too large for them to dilate; give the bodies room to dilate, or refine the mesh"
)


NOT_ADMISSIBLE = "the mechanism is not admissible"

GROWS_TOO_LITTLE = (
    "dilating bodies dilate enough only at the points of the mesh; control = 'bounds' seeks"
    " a mechanism in which they dilate enough everywhere"
)


@dataclass(frozen=True)
class Bound:
    """A bound on a limit load, with the object for which it holds.

    Attributes:
        value: The value of the bound; None without a value.
        kind: "lower" or "upper".
        of: Whether the bound holds for the body that the mesh fills, or only for the finite
            elements.
        why_not: Reasons why the bound does not hold for the body; empty if it holds.
        of_rounding: Share of an upper bound that may come from rounding errors in bodies that
            hardly deform.
        doubts: Reasons why the bound may not hold, until the proof checker has judged the bound.
        faults: All faults that the proof checker found, if it has refused the bound.
        over: Factor by which the stress of a refused bound exceeds the strength.
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
        """Return whether the bound holds for the body, up to rounding."""
        return self.can_be_strict and not self.doubts

    @property
    def strict_value(self) -> float | None:
        """Return the value if the bound is strict; None otherwise."""
        return self.value if self.strict else None

    @property
    def can_be_strict(self) -> bool:
        """Return whether the bound may hold for the body, so that the checker has to judge it."""
        return self.value is not None and self.of is Scope.BODY

    def is_improved_by(self, value: float | None) -> bool:
        """Return whether a value is better than the value of this bound by more than rounding."""
        if self.value is None or value is None:
            return False
        gain = value - self.value if self.kind == "lower" else self.value - value
        return gain > ROUNDING * abs(self.value)

    def proven(self, value: float | None = None) -> "Bound":
        """Return the bound as proven, with the value of the proof checker if it is given."""
        return replace(self, value=self.value if value is None else value, doubts=())

    def refused(self, faults: tuple[str, ...], over: float = 1.0) -> "Bound":
        """Return the bound as a bound of the mesh, with the checker's first fault as a reason.

        The result has no value if a doubt about the bound was that the stress is not in
        equilibrium, that the mechanism is not admissible, or that it dilates too little between the
        points of the mesh.
        """
        unfit = self.kind == "lower" or {NOT_ADMISSIBLE, GROWS_TOO_LITTLE} & {*self.doubts}
        value = None if self.doubts and unfit else self.value
        why = f"the proof checker refuses it: {faults[0]}"
        reasons = (*self.why_not, *self.doubts, why)
        found = replace(self, value=value, of=Scope.MESH, why_not=reasons, doubts=())
        return replace(found, faults=faults, over=over)

    @property
    def shown(self) -> str:
        """Return the value with a few digits, rounded to the safe side."""
        if self.value is None:
            return "none"
        return rounded_down(self.value) if self.kind == "lower" else rounded_up(self.value)

    @property
    def marked(self) -> str:
        """Return :attr:`shown`, with a remark if the bound is not strict."""
        return f"{self.shown}{'' if self.strict else ' (not strict)'}"

    def apart(self, upper: "Bound") -> float | None:
        """Return the difference from an upper bound, divided by the smaller of both magnitudes.

        The result is ``None`` if either bound is missing, or if 0 lies between both bounds.
        """
        if self.value is None or upper.value is None or not self.value * upper.value > 0:
            return None
        return (upper.value - self.value) / min(abs(self.value), abs(upper.value))

    def improves(self, old: "Bound") -> bool:
        """Return whether this bound replaces an old bound.

        A strict bound replaces every worse strict bound, and every bound that is not strict. A
        bound that is not strict replaces only bounds that are not strict.
        """
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
