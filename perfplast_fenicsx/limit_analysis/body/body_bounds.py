"""Store bounds of the limit load of the body that a mesh fills, and describe them in words."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry, exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.blocks.block_limit import FoundForces
from perfplast_fenicsx.limit_analysis.body.bound_problems import VelocityOf
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import Verdict
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_in_words
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import strengths_of
from perfplast_fenicsx.limit_analysis.facets.bound_body import UNMATCHED
from perfplast_fenicsx.limit_analysis.facets.enclosed_pores import pores_in_words
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED, ENTERS
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    NO_MECHANISM,
    Bound,
    DesignFactor,
    Question,
    Scope,
    Standing,
)
from perfplast_fenicsx.limit_analysis.stress.static_bound import StaticBound
from perfplast_fenicsx.materials.nonassociated_flow import flow_words
from perfplast_fenicsx.outcome_words import percent
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.tables import NotebookResult, Row


def sentence(words: str) -> str:
    """Return a clause with a capital and without its full stop."""
    return words[0].upper() + words[1:]


def sentences(clauses: Iterable[str]) -> str:
    """Return clauses as sentences that follow another one; an empty string without clauses."""
    return "".join(f" {sentence(words)}." for words in clauses)


def proven_words(lower: Bound, upper: Bound, question: Question, why_not: Sequence[str]) -> str:
    """Return a sentence on what both bounds prove.

    Args:
        lower: The lower bound.
        upper: The upper bound.
        question: The loads whose factor is bounded.
        why_not: Why a bound is not strict.
    """
    reasons = f" ({'; '.join(why_not)})" if why_not else ""
    body = "The body that the mesh fills"
    if question is Question.STANDS:
        known = [bound.value if bound.strict else None for bound in (lower, upper)]
        stands = Standing(*known)
        return f"{body} {stands.verdict}: {stands.in_words()}; this is strict{reasons}."
    if UNLIMITED in lower.why_not and UNLIMITED in upper.why_not:
        return f"{sentence(UNLIMITED)}."
    if upper.strict and upper.value is not None and upper.value < 0:
        body = f"Without load the constant loads are not carried. {body}"
    if lower.strict and upper.strict:
        return f"{body} collapses between {lower.shown} and {upper.shown}; both bounds are strict."
    if upper.strict:
        return f"{body} collapses at {upper.shown} at most, strictly{reasons}."
    if lower.strict:
        return f"{body} carries {lower.shown} at least, strictly{reasons}."
    return f"Nothing is proven for the body that the mesh fills{reasons}."


def least_words(carried: float | None, none_below: float | None, lower: float | None) -> str:
    """Return a sentence on the proven bounds of the least load factor.

    Args:
        carried: A load factor near the least one that is provably carried.
        none_below: Proven lower bound of the least load factor.
        lower: A lower bound of the largest load factor, which is carried too.
    """
    told = []
    if carried is not None and lower is not None:
        first, last = min(carried, lower), max(carried, lower)
        ends = f"from {rounded_up(first)} to {rounded_down(last)}"
        told.append(f"load factors {ends} are carried for certain")
    elif carried is not None:
        told.append(f"the load factor {rounded_up(carried)} is carried for certain")
    if none_below is not None:
        told.append(f"none below {rounded_down(none_below)} is carried")
    if not told:
        return "Nothing is proven for the least load factor that is carried."
    words = f"{' and '.join(told)}; this is strict."
    words = sentence(words)
    if none_below is not None and none_below > 0:
        return f"{words} Without load the constant loads are not carried."
    if carried is None or (carried > 0 and (lower is None or lower > 0)):
        return f"{words} Whether the constant loads are carried without load is not decided."
    return words


def taken_as(problem: Problem) -> tuple[str, ...]:
    """Return clauses on the idealisation of bodies and loads. Collective.

    They concern associated ground, surfaces that share one polygon, and pore pressures and
    strengths that are not linear in each cell.
    """
    told = (
        flow_words(problem.given.materials),
        problem.tagged_mesh.taken,
        pores_in_words(problem),
        profiles_in_words(problem),
    )
    return tuple(clause for clauses in told for clause in clauses)


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
class BodyBounds(NotebookResult):
    """Bounds of the limit load of a body.

    Attributes:
        problem: Problem on whose mesh the mechanism is given; in space each cell is split from its
            centre.
        lower: Lower bound.
        upper: Upper bound.
        mechanism: Velocity v of the upper bound, with L(v) = 1; zero without a mechanism.
        by_flux: In axisymmetry v = ru (:mod:`ring_flux`), to which the upper bound belongs.
        mesh: The limit load of this mesh, which is not a bound of that of the body.
        static: The lower bound with its stress; None if it was not computed.
        stress: The stress of the lower bound as Mandel vectors at the vertices of this rank's cells
            of ``problem``, shape (num_cells, d + 1, m). None without a lower bound, and in space
            for cells that are not split (curved ones, linear elements).
        shares: Contribution of each owned cell (before the split in space) to the gap
            (:mod:`strict_work`), shape (num_cells,); None without both bounds.
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
        return [f"{bound.kind} bound: {why}" for bound in self._both for why in bound.why_not]

    @property
    def faults(self) -> list[str]:
        """Return all faults that the proof checker found."""
        bounds = (self.lower, self.upper)
        return [f"{bound.kind} bound: {fault}" for bound in bounds for fault in bound.faults]

    def __repr__(self) -> str:
        return f"BodyBounds({self.lower!r}, {self.upper!r}; {self.factorisations} factorisations)"

    @property
    def dimensions(self) -> int:
        """Number of dimensions of the bodies."""
        return self.problem.bodies.gdim

    def rows(self) -> list[Row]:
        """Return a row for each bound: its ``value``, whether it is ``strict``, and why not."""
        return [
            {
                "bound": bound.kind,
                "value": bound.value,
                "strict": bound.strict,
                "of": str(bound.of),
                "why not": "; ".join((*bound.why_not, *bound.doubts)),
            }
            for bound in self._both
        ]

    def draw_into(self, axes: Any) -> None:
        """Draw the mechanism of the upper bound, coloured by speed, with both bounds above it.

        Collective.
        """
        corners, velocity = _visible(self.mechanism)
        speed = np.linalg.norm(velocity, axis=-1)
        size = float(np.ptp(corners, axis=(0, 1)).max())
        share = 0.06  # the largest motion, as a share of the size of the bodies
        drawn = corners + velocity * (share * size / (speed.max() or 1.0))
        speed /= speed.max() or 1.0
        if self.dimensions == 2:
            triangles = np.arange(drawn.shape[0] * 3).reshape(-1, 3)
            x, y = drawn.reshape(-1, 2).T
            axes.tripcolor(x, y, triangles, speed.ravel(), shading="gouraud", cmap="viridis")
            axes.set_aspect("equal")
        else:
            from matplotlib import colormaps
            from mpl_toolkits.mplot3d.art3d import Poly3DCollection

            colours = colormaps["viridis"](speed.mean(axis=1))
            lines = {"edgecolors": "#40404060", "linewidths": 0.4}
            axes.add_collection3d(Poly3DCollection(drawn, facecolors=colours, **lines))
            low, high = drawn.min(axis=(0, 1)), drawn.max(axis=(0, 1))
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
            axes.set_box_aspect(high - low)
            axes.locator_params(nbins=4)
        factor = {
            Question.LIMIT: "load factor",
            Question.STANDS: "multiple of the constant loads",
        }[self.question]
        shown = (f"{it.shown}{'' if it.strict else ' (not strict)'}" for it in self._both)
        axes.set_title(f"Bounds of the {factor}: {' … '.join(shown)}")

    @property
    def _both(self) -> tuple[Bound, Bound]:
        return self.lower, self.upper

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
        """Return the bounds of the least load factor in sentences; empty if not computed."""
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


def _visible(velocity: fem.Function) -> tuple[Floats, Floats]:
    """Return the corners of the triangles that are seen, and the velocity there. Collective.

    They are the cells of a plane mesh, and the outer facets of a mesh in space, those of all ranks.

    Returns:
        Two arrays of shape (count, 3, gdim).
    """
    mesh = velocity.function_space.mesh
    topology, gdim = mesh.topology, mesh.geometry.dim
    cells = np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
    triangles: Ints = cells
    if gdim == 3:
        topology.create_connectivity(2, 3)
        triangles = np.asarray(exterior_facet_indices(topology), dtype=np.int32)
        links = topology.connectivity(2, 3)
        cells = links.array[links.offsets[triangles]]
    nodes = entities_to_geometry(mesh, 2, triangles)[:, :3]
    corners = mesh.geometry.x[nodes]
    at = np.repeat(cells, 3)
    values = velocity.eval(corners.reshape(-1, 3), at).reshape(-1, 3, gdim)
    parts = mesh.comm.allgather((corners[..., :gdim], values))
    return tuple(np.concatenate(some) for some in zip(*parts, strict=True))


def standing_in_words(limit: LimitLoad, body: BodyBounds | None = None) -> str | None:
    """Return a sentence on whether constant loads alone are carried; None if more is known.

    Args:
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    known = body is not None and (body.lower.strict or body.upper.strict)
    if body is not None and known and body.question is Question.STANDS:
        return body.in_words()
    if known or limit.standing is None or limit.question is Question.LIMIT:
        return None
    stands = limit.standing
    return f"This mesh {stands.verdict}: {stands.in_words()}; this is no proof for the body."


def designed(
    zeta: float | None, name: str, limit: LimitLoad, body: BodyBounds | None
) -> DesignFactor | None:
    """Return how many times the design load is carried; None without a design load or a bound.

    If the least load factor is above the design load, the function reports no multiple: more load
    is needed, not less. If the design load is not proven to be carried, it is not reported as
    carried.

    Args:
        zeta: Load factor of the design load.
        name: Name of the combination of loads, if it has one.
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    if zeta is None or standing_in_words(limit, body):
        return None
    if body is None:
        return DesignFactor.of(zeta, None, None, limit.estimate, name)
    lower, upper = (bound.value if bound.strict else None for bound in body.limits)
    least = body.least
    if least is not None:
        if least.none_below is not None and least.none_below > zeta:
            return None
        if least.carried is None or least.carried > zeta:
            lower = None
    return DesignFactor.of(zeta, lower, upper, limit.estimate, name)


@dataclass(frozen=True)
class Effort:
    """The cost of a search.

    Attributes:
        dim: Dimension of the bodies.
        cells: Number of cells of the mesh; of several meshes, of the first one.
        seconds: Wall time.
        ended: Why there is no finer mesh, if the mesh was adapted; empty without adaptation.
    """

    dim: int
    cells: int
    seconds: float
    ended: str = ""


def next_steps(body: BodyBounds, effort: Effort) -> list[str]:
    """Return sentences without a full stop; an empty list if both bounds hold and are close.

    Args:
        body: Proven bounds of the body.
        effort: Cost of these bounds.
    """
    return list(_steps(body, effort))


def _steps(body: BodyBounds, effort: Effort) -> Iterator[str]:
    seconds, dim = effort.seconds, effort.dim
    lower, upper = body.lower, body.upper
    if lower == NOT_SOUGHT:
        # Why an upper bound is missing or not strict although a lower one may still be computed.
        answered = {NO_MECHANISM, CURVED, ENTERS}
        if body.mesh.estimate is not None and set(upper.why_not) <= answered:
            # Cost of bounds relative to that of the mesh's limit load, by dimension.
            bounded = {2: (2, 5), 3: (4, 8)}
            yield (
                'control = "bounds" under [loading] bounds what the bodies provably '
                f"carry, and takes about {_times(bounded[dim], seconds)}"
            )
    elif lower.strict and upper.strict and (apart := lower.apart(upper)) is not None:
        # Relative distance of bounds above which a message advises how to reduce it.
        wide = 0.1
        if apart > wide and effort.ended:
            yield (
                f"the bounds are {percent(apart)} apart, and {effort.ended}; more meshes "
                "(a smaller until, more cells), or a smaller size of the first one, bring "
                "them closer"
            )
        elif apart > wide:
            # Relative cost of bounds with half the element size, by dimension: there are 4 or 8
            # times as many cells, and the factors grow faster than this number.
            longer = {2: (4, 8), 3: (15, 50)}
            # Relative cost of bounds on several meshes, the last one with twice as many cells.
            adapting = (2, 5)
            yield (
                f"the bounds are {percent(apart)} apart, as the mesh is coarse. adapt = {{ "
                f"until = {wide}, cells = {_rounded(2 * effort.cells)} }} under [mesh] "
                f"brings them closer, and takes about {_times(adapting, seconds)}; "
                f"elements of half the size (some {_rounded(2**dim * effort.cells)} cells) "
                f"take about {_times(longer[dim], seconds)}"
            )
    if NO_MECHANISM in upper.why_not:
        locked = " and ".join(map(repr, body.mesh.locked))
        whose = f": {locked} {'locks' if len(body.mesh.locked) == 1 else 'lock'}" if locked else ""
        divided = ', or control = "bounds", which divides all elements,' if dim == 3 else ""
        yield (
            f"no mechanism of this mesh preserves all volumes{whose}. Elements of half the "
            f"size there (sizes under [geometry]){divided if lower == NOT_SOUGHT else ''} "
            "may have one"
        )
    if UNMATCHED in (*lower.why_not, *upper.why_not):
        where = "" if dim == 3 else ", or let both surfaces end at the same places without a gap"
        yield (
            "matching surfaces have bounds: mesh their bodies as one and split "
            f"them{where}; a gap does not change the limit load"
        )
    if CURVED in upper.why_not and lower.strict and lower.value:
        yield (
            "rely on the lower bound; there is no strict upper bound for contact on "
            "curved obstacles, or with friction on curved faces, however fine the mesh"
        )


def _times(many: tuple[int, int], seconds: float) -> str:
    """Return the cost in multiples and in time."""
    least, most = (clock(number * seconds) for number in many)
    return f"{many[0]} to {many[1]} times as long as this ({least} to {most})"


def clock(seconds: float) -> str:
    """Return a time in words, with two digits."""
    if seconds < 90:
        return f"{max(seconds, 1):.2g} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _rounded(cells: int) -> int:
    """Return a number of cells rounded up to two digits."""
    step = 10 ** max(len(str(cells)) - 2, 0)
    return -(-cells // step) * step
