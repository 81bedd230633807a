"""Store bounds of the limit load of the body that a mesh fills, not only of the mesh."""

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
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import strengths_of
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import StaticBound
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.tables import notebook_table

NOT_SOUGHT = Bound(None, "lower", Scope.MESH, ("not computed; control = 'bounds' computes it",))

DRUCKER = (
    "With Coulomb's friction they are Drucker's pair: from below without friction other "
    "than adhesion, from above with associated friction, whatever the true direction of "
    "slip"
)


@dataclass(frozen=True)
class LeastLoad:
    """Bounds of the least load factor that the bodies carry.

    It is the limit load of the reversed growing loads, with the opposite sign.

    Attributes:
        low: Result with the best lower bound of the reversed loads.
        high: Result with the best upper bound of the reversed loads.
    """

    low: "BodyBounds"
    high: "BodyBounds"

    @property
    def carried(self) -> float | None:
        """Return a load factor that is provably carried; None if no factor is proven."""
        bound = self.low.limits[0]
        return -bound.value if bound.strict and bound.value is not None else None

    @property
    def none_below(self) -> float | None:
        """Return the factor below which provably no load factor is carried; None if not proven."""
        bound = self.high.limits[1]
        return -bound.value if bound.strict and bound.value is not None else None

    def table(self) -> dict[str, float | None]:
        """Return the bounds as a table for ``summary.json``."""
        return {"carried": self.carried, "none_below": self.none_below}


@dataclass(frozen=True, eq=False)
class JointProof:
    """The proof of a lower bound of rigid blocks.

    Attributes:
        best: The best forces, on outer facets in the order of their cells.
        inner: Forces inside their limits; None if none were found.
    """

    best: FoundForces
    inner: FoundForces | None


@dataclass(frozen=True)
class BodyBounds:
    """Bounds of the limit load of a body.

    Attributes:
        problem: Problem on whose mesh the mechanism is given; in space each cell is split from its
            centre.
        lower: Lower bound.
        upper: Upper bound.
        mechanism: Velocity v of the upper bound, with L(v) = 1; zero without a mechanism.
        by_flux: In axisymmetry v = ru (:mod:`ring_flux`), to which the upper bound belongs.
        mesh: The limit load of this mesh, which bounds that of the body from neither side.
        static: The lower bound with its stress; None if it was not computed.
        stress: The stress of the lower bound as Mandel vectors at the vertices of this rank's cells
            of ``problem``, shape (num_cells, d + 1, m). None without a lower bound, and in space
            for cells that are not split (curved ones, linear elements).
        shares: Contribution of each owned cell (before the split in space) to the gap
            (:mod:`gap_shares`), shape (num_cells,); None without both bounds.
        certificates: Residuals of the conditions of a bound, by name.
        steps: Number of steps of the interior point method for both bounds.
        factorisations: Number of factorisations for both bounds.
        advice: Advice for better bounds, in clauses.
        weaker: The bodies of the lower bound, if they differ from those of ``problem``.
        taken: Idealisations in clauses: ground with ψ < φ, and surfaces with different polygons.
        joints: Proof by forces on joints, instead of a stress, for bodies that cannot yield.
        question: The loads whose factor is bounded: the growing loads, or the constant ones if the
            mesh does not carry them (:class:`load_factor.Question`).
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
        """Return the velocity to which the upper bound belongs."""
        return self.by_flux or VelocityOf(self.problem, self.mechanism)

    @property
    def limits(self) -> tuple[Bound, Bound]:
        """Return bounds of the load factor ζ; without values if constant loads are bounded."""
        if self.question is Question.LIMIT:
            return self.lower, self.upper
        why = (
            "the bounds are not of a load factor, but of the multiple of the constant loads "
            "that is carried",
        )
        return Bound(None, "lower", Scope.MESH, why), Bound(None, "upper", Scope.MESH, why)

    @property
    def strict(self) -> bool:
        """Return whether both bounds hold for the body, apart from rounding."""
        return self.lower.strict and self.upper.strict

    @property
    def why_not(self) -> list[str]:
        """Return why one of them does not hold for the body; an empty list if both hold."""
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
        """Return the bounds in one or two sentences."""
        lower, upper = self.lower.strict, self.upper.strict
        early = []
        if not self.mesh.levelled_off and upper:
            early.append(f" The upper one is not the best on its mesh: {self.mesh.reason}.")
        if self.static is not None and self.static.verdict is not Verdict.FOUND and lower:
            early.append(f" The lower one is not the best on its mesh: {self.static.reason}.")
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
        """Return the bounds of the least load factor in sentences; empty if not sought."""
        if self.least is None:
            return ""
        lower = self.lower.value if self.lower.strict else None
        return least_words(self.least.carried, self.least.none_below, lower)

    @property
    def friction(self) -> str | None:
        """Return the sentence on Coulomb's friction; None without such friction."""
        rubs = [it for it in strengths_of(self.problem) if it.friction]
        told = [DRUCKER] if any(not it.associated for it in rubs) else []
        if any(it.associated for it in rubs):
            told.append(
                "With associated friction, slipping surfaces separate by the coefficient "
                "of friction times the slip; true friction separates them less, and its "
                "limit load is at most the upper bound"
            )
        return ". ".join(told) or None
