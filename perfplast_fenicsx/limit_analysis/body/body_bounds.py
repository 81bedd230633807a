"""Store bounds of the limit load of the body that a mesh fills, not only of the mesh."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry, exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints
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
from perfplast_fenicsx.tables import NotebookResult, Row

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
        return [f"{bound.kind} bound: {why}" for bound in self._both for why in bound.why_not]

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
