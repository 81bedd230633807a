"""Bounds of the limit load of the body that a mesh fills, and not just of the mesh."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.blocks.block_limit import FoundForces
from perfplast_fenicsx.limit_analysis.body.bound_words import (
    least_words,
    proven_words,
    sentences,
)
from perfplast_fenicsx.limit_analysis.body.ring_results import VelocityOf
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import Verdict
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.facets.contact_strength import strengths_of
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import StaticBound
from perfplast_fenicsx.notebook_table import notebook_table
from perfplast_fenicsx.problem.problem import Problem

NOT_SOUGHT = Bound(None, "lower", Scope.MESH, ("not computed; control = 'bounds' computes it",))

DRUCKER = (
    "With Coulomb's friction they are Drucker's pair: frictionless from below, but for adhesion,"
    " and associated from above, whichever way it slips"
)


@dataclass(frozen=True)
class LeastLoad:
    """Bounds of the least load factor that is carried.

    It is that of the growing loads turned round, with the other sign.

    Attributes:
        low: With the best lower bound of the loads turned round.
        high: With the best upper one.
    """

    low: "BodyBounds"
    high: "BodyBounds"

    @property
    def carried(self) -> float | None:
        """A load factor that is carried for certain; None where none is proven."""
        bound = self.low.limits[0]
        return -bound.value if bound.strict and bound.value is not None else None

    @property
    def none_below(self) -> float | None:
        """No smaller one is carried; None where that is not proven."""
        bound = self.high.limits[1]
        return -bound.value if bound.strict and bound.value is not None else None

    def table(self) -> dict[str, float | None]:
        """Return the bounds, as ``summary.json`` has them."""
        return {"carried": self.carried, "none_below": self.none_below}


@dataclass(frozen=True, eq=False)
class JointProof:
    """The proof of a lower bound of rigid blocks.

    Attributes:
        best: The best forces, on outer facets in the order of their cells.
        inner: Forces inside of their limits; None where none were found.
    """

    best: FoundForces
    inner: FoundForces | None


@dataclass(frozen=True)
class BodyBounds:
    """Bounds of the limit load of a body.

    Attributes:
        problem: On whose mesh the mechanism is; in space each cell is split from its centre.
        lower: A lower bound.
        upper: An upper bound.
        mechanism: Velocity v of the upper bound, with L(v) = 1; zero where none was found.
        by_flux: Around an axis v = ru (:mod:`ring_flux`), of which the upper bound is.
        mesh: The limit load of this mesh, which bounds that of the body on neither side.
        static: The lower bound with its stress; None where none was sought.
        stress: That stress, Mandel vectors at the vertices of this rank's cells of ``problem``,
            shape (num_cells, d + 1, m); None without a lower bound, and in space where cells are
            not split (curved ones, linear elements).
        shares: What each owned cell of the mesh, before it was split in space, has of the gap
            (:mod:`gap_shares`), shape (num_cells,); None without both bounds.
        certificates: What is left of what a bound asks for, by name.
        steps: Steps of the interior point method, for both bounds.
        factorisations: For both bounds.
        advice: Advice for better bounds, in clauses.
        weaker: The bodies of the lower bound, where they are not those of ``problem``.
        taken: What bodies are taken as, in clauses: ground that dilates by less than its friction,
            and surfaces whose chords differ.
        joints: Joints of bodies of which none can yield: forces on their joints, in the place of a
            stress.
        question: Of which loads the factor is bounded: of the growing ones, or, where the constant
            ones were found to be too much on the mesh, of these (:class:`question.Question`).
    """

    problem: Problem
    lower: Bound
    upper: Bound
    mechanism: fem.Function
    mesh: LimitLoad
    static: StaticBound | None = None
    stress: Floats | None = None
    shares: Floats | None = None
    certificates: Mapping[str, float] = field(default_factory=dict)
    steps: int = 0
    factorisations: int = 0
    advice: tuple[str, ...] = ()
    question: Question = Question.LIMIT
    by_flux: VelocityOf | None = None
    weaker: Problem | None = None
    taken: tuple[str, ...] = ()
    joints: JointProof | None = None
    least: LeastLoad | None = None

    @property
    def flow(self) -> VelocityOf:
        """The velocity of which the upper bound is."""
        return self.by_flux or VelocityOf(self.problem, self.mechanism)

    @property
    def limits(self) -> tuple[Bound, Bound]:
        """Bounds of the load factor ζ; without values where they are of the constant loads."""
        if self.question is Question.LIMIT:
            return self.lower, self.upper
        why = ("no load factor was sought, but how many times constant loads are carried",)
        return Bound(None, "lower", Scope.MESH, why), Bound(None, "upper", Scope.MESH, why)

    @property
    def strict(self) -> bool:
        """Whether both hold for the body, but for rounding."""
        return self.lower.strict and self.upper.strict

    @property
    def why_not(self) -> list[str]:
        """Why one of them does not; nothing where both do."""
        bounds = (self.lower, self.upper)
        return [f"{bound.kind} bound: {why}" for bound in bounds for why in bound.why_not]

    def __repr__(self) -> str:
        return f"BodyBounds({self.lower!r}, {self.upper!r}; {self.factorisations} factorisations)"

    def _repr_html_(self) -> str:
        """Return both bounds as a table, and what they prove in words."""
        rows: list[tuple[str, object]] = [
            (
                f"{bound.kind} bound",
                f"{bound.shown}, strict" if bound.strict else f"{bound.shown}, not strict",
            )
            for bound in (self.lower, self.upper)
        ]
        return notebook_table("Bounds", [*rows, ("in words", self.in_words())])

    def in_words(self) -> str:
        """Return the bounds in a sentence or two."""
        lower, upper = self.lower.strict, self.upper.strict
        early = []
        if not self.mesh.levelled_off and upper:
            early.append(f" The upper one is not the best of its mesh: {self.mesh.reason}.")
        if self.static is not None and self.static.verdict is not Verdict.FOUND and lower:
            early.append(f" The lower one is not the best of its mesh: {self.static.reason}.")
        early.append(sentences(self.advice))
        if self.friction is not None and (lower or upper):
            early.append(f" {self.friction}.")
        early.append(sentences(self.taken))
        proven = proven_words(self.lower, self.upper, self.question, self.why_not)
        if self.least_in_words:
            early.insert(0, f" {self.least_in_words}")
        return proven + "".join(early)

    @property
    def least_in_words(self) -> str:
        """Return the bounds of the least load factor in a sentence or two; empty if not sought."""
        if self.least is None:
            return ""
        lower = self.lower.value if self.lower.strict else None
        return least_words(self.least.carried, self.least.none_below, lower)

    @property
    def friction(self) -> str | None:
        """The sentence on Coulomb's friction; None without it."""
        rubs = [it for it in strengths_of(self.problem) if it.friction]
        told = [DRUCKER] if any(not it.associated for it in rubs) else []
        if any(it.associated for it in rubs):
            told.append(
                "With associated friction surfaces open by the coefficient of friction times their"
                " slip; true friction opens them less and carries no more than the upper one"
            )
        return ". ".join(told) or None
