"""Store and describe bounds on the limit load of the body that the mesh fills."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry, exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.blocks.block_limit import FoundForces
from perfplast_fenicsx.limit_analysis.body.bound_problems import VelocityOf, pores_in_words
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import Verdict
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_in_words
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import strengths_of
from perfplast_fenicsx.limit_analysis.facets.bound_body import UNMATCHED
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
    """Return the clause with a capital first letter, without a full stop at its end."""
    return words[0].upper() + words[1:]


def sentences(clauses: Iterable[str]) -> str:
    """Return clauses as sentences to append to a text; empty if there are no clauses."""
    return "".join(f" {sentence(words)}." for words in clauses)


def proven_words(lower: Bound, upper: Bound, question: Question, why_not: Sequence[str]) -> str:
    """Return a sentence that says what both bounds prove.

    Args:
        lower: The lower bound.
        upper: The upper bound.
        question: The loads that the bounded factor multiplies.
        why_not: Reasons why a bound is not strict.
    """
    reasons = f" ({'; '.join(why_not)})" if why_not else ""
    body = "The body that the mesh fills"
    if question is Question.STANDS:
        stands = Standing(lower.strict_value, upper.strict_value)
        return f"{body} {stands.verdict}: {stands.in_words()}; this result is strict{reasons}."
    if UNLIMITED in lower.why_not and UNLIMITED in upper.why_not:
        return f"{sentence(UNLIMITED)}."
    if upper.strict_value is not None and upper.strict_value < 0:
        body = f"The bodies do not carry the constant loads alone. {body}"
    if lower.strict and upper.strict:
        return f"{body} collapses between {lower.shown} and {upper.shown}; both bounds are strict."
    if upper.strict:
        return f"{body} collapses at {upper.shown} or less; this bound is strict{reasons}."
    if lower.strict:
        return f"{body} carries at least {lower.shown}; this bound is strict{reasons}."
    return f"Nothing is proven for the body that the mesh fills{reasons}."


def least_words(carried: float | None, none_below: float | None, lower: float | None) -> str:
    """Return a sentence that says what is proven for the least load factor.

    Args:
        carried: A load factor that the bodies provably carry, near the least carried factor.
        none_below: Proven lower bound on the least load factor.
        lower: A lower bound on the largest load factor; the bodies carry this factor too.
    """
    told = []
    if carried is not None and lower is not None:
        first, last = min(carried, lower), max(carried, lower)
        ends = f"from {rounded_up(first)} to {rounded_down(last)}"
        told.append(f"the body certainly carries load factors {ends}")
    elif carried is not None:
        told.append(f"the body certainly carries the load factor {rounded_up(carried)}")
    if none_below is not None:
        told.append(f"the body carries no load factor below {rounded_down(none_below)}")
    if not told:
        return "Nothing is proven for the least load factor that is carried."
    words = f"{' and '.join(told)}; this result is strict."
    words = sentence(words)
    if none_below is not None and none_below > 0:
        return f"{words} The body does not carry the constant loads alone."
    if carried is None or (carried > 0 and (lower is None or lower > 0)):
        return f"{words} It is not decided whether the body carries the constant loads alone."
    return words


def taken_as(problem: Problem) -> tuple[str, ...]:
    """Return clauses that describe how bodies and loads are idealised. Collective.

    The clauses concern ground that is treated as associated, surfaces that are projected onto one
    polygon, and pore pressures and strengths that are not linear in each cell.
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
    "With Coulomb's friction the bounds are Drucker's pair: the lower bound omits friction "
    "except adhesion, and the upper bound assumes associated friction, whatever the true "
    "direction of slip"
)


@dataclass(frozen=True)
class LeastLoad:
    """Bounds of the least load factor that the bodies carry.

    The least load factor is the limit load of the reversed live loads, with the opposite sign.

    Attributes:
        low: Result with the best lower bound for the reversed loads.
        high: Result with the best upper bound for the reversed loads.
    """

    low: "BodyBounds"
    high: "BodyBounds"

    @property
    def carried(self) -> float | None:
        """Return a load factor that the bodies provably carry; None if there is no such proof."""
        value = self.low.limits[0].strict_value
        return None if value is None else -value

    @property
    def none_below(self) -> float | None:
        """Return a proven lower bound on the least load factor; None if there is no such bound."""
        value = self.high.limits[1].strict_value
        return None if value is None else -value

    def table(self) -> dict[str, float | None]:
        """Return the bounds as a table for ``summary.json``."""
        return {"carried": self.carried, "none_below": self.none_below}


@dataclass(frozen=True, eq=False)
class JointProof:
    """The proof of a lower bound of rigid blocks.

    Attributes:
        best: The best joint forces, on the exterior facets in the order of their cells.
        inner: Forces strictly inside the friction cones; None if no such forces were found.
    """

    best: FoundForces
    inner: FoundForces | None


@dataclass(frozen=True)
class BodyBounds(NotebookResult):
    """Bounds on the limit load of a body.

    Attributes:
        problem: Problem on whose mesh the mechanism is given. In 3D its cells are split from their
            centres.
        lower: Lower bound on the load factor.
        upper: Upper bound on the load factor.
        mechanism: Velocity v of the upper bound, with L(v) = 1; zero if there is no mechanism.
        by_flux: In axisymmetry, the velocity v = ru (:mod:`ring_flux`), to which the upper bound
            belongs.
        mesh: The limit load of the discrete problem, which does not bound the limit load of the
            body.
        static: The lower bound with its stress; None if it was not computed.
        stress: The stress of the lower bound, as Mandel vectors at the vertices of this rank's
            cells of ``problem``, shape (num_cells, d + 1, m). In axisymmetry, coefficients of rσ
            (:mod:`stress_cells`), shape (num_cells, 6, 4). None if there is no lower bound. Also
            None in 3D if the cells are not split because they are curved or their elements are
            linear.
        shares: Contribution of each owned cell (before tetrahedra are split) to the gap
            (:mod:`strict_work`), shape (num_cells,); None if a bound is missing. The proof checker
            may prove a smaller gap than the sum of the contributions.
        certificates: Residuals of the conditions that the bounds must satisfy, by name.
        steps: Number of steps of the interior point method for both bounds; for rigid blocks, the
            number of linear programs.
        factorisations: Number of factorisations for both bounds; 0 for rigid blocks.
        advice: Advice for better bounds, in clauses.
        weaker: The problem of the lower bound if its bodies differ from the bodies of ``problem``.
        taken: Idealisations of ground, surfaces, pore pressures and strengths, as clauses
            (:func:`taken_as`).
        joints: Proof by joint forces instead of a stress, for bodies that cannot yield.
        question: The loads that the bounded factor multiplies: the live loads, or the constant
            loads if the mesh does not carry the constant loads (:class:`load_factor.Question`).
        least: Bounds of the least load factor; None if they were not computed.
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
        """Return the bounds of the factor ζ of the live loads.

        Their values are ``None`` if the bounds are those of a multiple of the constant loads.
        """
        if self.question is Question.LIMIT:
            return self.lower, self.upper
        why = (
            "the bounds are not those of a load factor, but of the multiple of the constant "
            "loads that the body carries",
        )
        return Bound(None, "lower", Scope.MESH, why), Bound(None, "upper", Scope.MESH, why)

    @property
    def strict(self) -> bool:
        """Return whether both bounds are proven for the body."""
        return self.lower.strict and self.upper.strict

    @property
    def why_not(self) -> list[str]:
        """Return the reasons why a bound does not hold for the body; empty if both bounds hold."""
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
        """Return the number of dimensions of the bodies."""
        return self.problem.bodies.gdim

    def rows(self) -> list[Row]:
        """Return a table row for each bound, with the reason if the bound is not strict."""
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
        """Plot the mechanism of the upper bound, coloured by speed, with both bounds in the title.

        Collective.
        """
        corners, velocity = _visible(self.mechanism)
        speed = np.linalg.norm(velocity, axis=-1)
        size = float(np.ptp(corners, axis=(0, 1)).max())
        share = 0.06  # largest drawn displacement, as a fraction of the size of the bodies
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
        axes.set_title(f"Bounds of the {factor}: {self.lower.marked} … {self.upper.marked}")

    @property
    def _both(self) -> tuple[Bound, Bound]:
        return self.lower, self.upper

    def in_words(self) -> str:
        """Return a text of a few sentences about the bounds and what they assume."""
        lower, upper = self.lower.strict, self.upper.strict
        early = []
        if not self.mesh.levelled_off and upper:
            early.append(f" The upper bound is not the best on its mesh: {self.mesh.reason}.")
        if self.static is not None and self.static.verdict is not Verdict.FOUND and lower:
            early.append(f" The lower bound is not the best on its mesh: {self.static.reason}.")
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
        """Return sentences on the least load factor; empty if its bounds were not computed."""
        if self.least is None:
            return ""
        return least_words(self.least.carried, self.least.none_below, self.lower.strict_value)

    @property
    def friction(self) -> str | None:
        """Return the sentence on Coulomb's friction; None without such friction."""
        rubs = [it for it in strengths_of(self.problem) if it.friction]
        told = [DRUCKER] if any(not it.associated for it in rubs) else []
        if any(it.associated for it in rubs):
            told.append(
                "With associated friction, slipping surfaces separate by the coefficient of "
                "friction times the slip; with true friction they separate less, and the limit "
                "load is at most the upper bound"
            )
        return ". ".join(told) or None


def _visible(velocity: fem.Function) -> tuple[Floats, Floats]:
    """Return the corners of the visible triangles, and the velocity at them. Collective.

    The triangles are the cells of a plane mesh or the exterior facets of a mesh of tetrahedra,
    gathered from all ranks.

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
    """Return whether the bodies carry the constant loads alone, as a sentence.

    The result is ``None`` if this is not known, or if a factor of the live loads was computed.

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
    return f"This mesh {stands.verdict}: {stands.in_words()}; this is not a proof for the body."


def designed(
    zeta: float | None, name: str, limit: LimitLoad, body: BodyBounds | None
) -> DesignFactor | None:
    """Return the multiple of the design load ``zeta`` that the body carries, or ``None``.

    The result is ``None`` without a design load, and if a multiple of the constant loads was
    computed instead of a load factor. It is also ``None`` if the least load factor is above the
    design load, because then the bodies need more load, not less. If bounds of the least load
    factor exist, the result has a lower bound only if the least load factor is provably at most the
    design load.

    Args:
        zeta: Load factor of the design load.
        name: Name of the load combination, if it has one.
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    if zeta is None or standing_in_words(limit, body):
        return None
    if body is None:
        return DesignFactor.of(zeta, None, None, limit.estimate, name)
    lower, upper = (bound.strict_value for bound in body.limits)
    least = body.least
    if least is not None:
        if least.none_below is not None and least.none_below > zeta:
            return None
        if least.carried is None or least.carried > zeta:
            lower = None
    return DesignFactor.of(zeta, lower, upper, limit.estimate, name)


@dataclass(frozen=True)
class Effort:
    """The computational cost of a search.

    Attributes:
        dim: Dimension of the bodies, 2 or 3.
        cells: Number of cells of the first mesh.
        seconds: Wall time (s).
        ended: Why the mesh was not refined further; empty without adaptation.
    """

    dim: int
    cells: int
    seconds: float
    ended: str = ""


def next_steps(body: BodyBounds, effort: Effort) -> list[str]:
    """Return advice for better bounds, as clauses; the list may be empty.

    Args:
        body: Proven bounds of the body.
        effort: Computational cost of these bounds.
    """
    return list(_steps(body, effort))


def _steps(body: BodyBounds, effort: Effort) -> Iterator[str]:
    seconds, dim = effort.seconds, effort.dim
    lower, upper = body.lower, body.upper
    if lower == NOT_SOUGHT:
        # Reasons for a missing or unproven upper bound that do not rule out a lower bound.
        answered = {NO_MECHANISM, CURVED, ENTERS}
        if body.mesh.estimate is not None and set(upper.why_not) <= answered:
            # Cost of bounds, relative to the cost of the limit load of the mesh, by dimension.
            bounded = {2: (2, 5), 3: (4, 8)}
            yield (
                'control = "bounds" under [loading] bounds what the bodies provably '
                f"carry, and takes about {_times(bounded[dim], seconds)}"
            )
    elif lower.strict and upper.strict and (apart := lower.apart(upper)) is not None:
        # Relative distance of the bounds above which the advice says how to reduce the distance.
        wide = 0.1
        if apart > wide and effort.ended:
            yield (
                f"the bounds are {percent(apart)} apart, and {effort.ended}; a first mesh with "
                "smaller elements also reduces the distance"
            )
        elif apart > wide:
            # Relative cost of bounds with half the element size, by dimension. There are 4 or 8
            # times as many cells, and the cost of a factorisation grows faster than the number of
            # cells.
            longer = {2: (4, 8), 3: (15, 50)}
            # Relative cost of bounds on several meshes. The last mesh has twice as many cells as
            # the first.
            adapting = (2, 5)
            yield (
                f"the bounds are {percent(apart)} apart, as the mesh is coarse. adapt = "
                f"{{ until = {wide}, cells = {_rounded(2 * effort.cells)} }} under [mesh] reduces "
                f"the distance, and takes about {_times(adapting, seconds)}; elements of half the "
                f"size (some {_rounded(2**dim * effort.cells)} cells) take about "
                f"{_times(longer[dim], seconds)}"
            )
    if NO_MECHANISM in upper.why_not:
        locked = " and ".join(map(repr, body.mesh.locked))
        whose = f": {locked} {'locks' if len(body.mesh.locked) == 1 else 'lock'}" if locked else ""
        divided = ', or control = "bounds", which divides all elements,' if dim == 3 else ""
        yield (
            f"no mechanism of this mesh preserves the volume of every cell{whose}. A mesh with "
            "elements of half the size there (sizes under "
            f"[geometry]){divided if lower == NOT_SOUGHT else ''} may have such a mechanism"
        )
    if UNMATCHED in (*lower.why_not, *upper.why_not):
        where = "" if dim == 3 else ", or let both surfaces end at the same places without a gap"
        yield (
            "matching surfaces have bounds: mesh their bodies as one and split "
            f"them{where}; a gap does not change the limit load"
        )
    if CURVED in upper.why_not and lower.strict_value:
        yield (
            "rely on the lower bound; there is no strict upper bound for contact on "
            "curved obstacles, or with friction on curved faces, however fine the mesh"
        )


def _times(many: tuple[int, int], seconds: float) -> str:
    """Return the cost in words, as multiples of the duration of this run and as durations."""
    least, most = (clock(number * seconds) for number in many)
    return f"{many[0]} to {many[1]} times as long as this ({least} to {most})"


def clock(seconds: float) -> str:
    """Return a duration with its unit, rounded to two significant digits."""
    if seconds < 90:
        return f"{max(seconds, 1):.2g} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _rounded(cells: int) -> int:
    """Return the number of cells, rounded up to two significant digits."""
    step = 10 ** max(len(str(cells)) - 2, 0)
    return -(-cells // step) * step
