"""Which pairs of two loads are carried: an interaction diagram between two polygons of proof.

The pairs (a, b) for which a·A + b·B is carried, beside loads that stay, are a convex set. So the
hull of pairs that strict lower bounds show to be carried is inside of it. And a mechanism v of a
strict upper bound dissipates D(v), which bounds the work of *every* pair that is carried:

    a A(v) + b B(v) ≤ D(v) − L₀(v),

a half-plane, in which the set lies as a whole. Both polygons are proven; between them the set's
edge runs. Directions are those in which the polygons are farthest apart, one after the other.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import adaptive_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.spread_forces import on_this_mesh
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.scaled_load import scaled
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


@dataclass(frozen=True, eq=False)
class Envelope:
    """Two polygons with the edge of the set of pairs that are carried between them.

    Attributes:
        carried: Pairs that are carried for certain, shape (n, 2), one for each direction in which a
            strict lower bound was found; the hull of them is carried as well.
        sides: Half-planes a p + b q ≤ r with rows (p, q, r), of length √(p² + q²) = 1, shape (m,
            3): what is outside of one of them is not carried.
        directions: Angles that were looked at (degrees), in turn.
        gap: What the outer polygon exceeds the inner one by at most along a ray between the first
            directions, relative; inf where one of them is missing there.
        around: Whether the directions go all around, and not over a quarter of the circle.
        last: What was found in the last direction.
    """

    carried: Floats
    sides: Floats
    directions: tuple[float, ...]
    gap: float
    around: bool
    last: BodyBounds

    def inner(self, angle: float) -> float:
        """How far along a ray (degrees) pairs are carried for certain; −inf where none is known."""
        return float(_inner(self.carried, np.radians([angle]))[0])

    def outer(self, angle: float) -> float:
        """From where on along a ray (degrees) none is carried; inf where none is known."""
        return float(_outer(self.sides, np.radians([angle]))[0])

    def in_words(self) -> str:
        """What is proven, in a sentence."""
        if not math.isfinite(self.gap):
            return "Which pairs of the two loads are carried is not proven in all directions."
        return (
            "All pairs inside of one polygon are carried for certain, and none outside of another;"
            f" they are {100 * self.gap:.3g} % apart at most, after {len(self.directions)}"
            " directions."
        )

    def table(self) -> list[dict[str, float | None]]:
        """Rows for a file: along each ray how far pairs are carried, and from where on none is."""
        last = 360 if self.around else 90
        angles = np.arange(0.0, last + 0.5, 1.0)
        inner, outer = (
            _inner(self.carried, np.radians(angles)),
            _outer(self.sides, np.radians(angles)),
        )
        return [
            {
                "angle": float(angle),
                "carried": float(low) if np.isfinite(low) else None,
                "not carried from": float(high) if np.isfinite(high) else None,
            }
            for angle, low, high in zip(angles, inner, outer, strict=True)
        ]

    def __repr__(self) -> str:
        return (
            f"Envelope({len(self.carried)} pairs carried, {len(self.sides)} half-planes; polygons"
            f" {self.gap:.2%} apart)"
        )


def envelope(
    problem: Problem,
    first: Sequence[Load],
    second: Sequence[Load],
    directions: int = 12,
    until: float = 0.01,
    around: bool = False,
    rtol: float = 1e-4,
    adaptation: Adaptation | None = None,
    monitor: Callable[[float, BodyBounds, BodyBounds], None] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
) -> Envelope:
    """Bound the set of pairs (a, b) for which a·first + b·second is carried. Collective.

    Args:
        problem: The bodies; of its loads those that are constant act beside any pair.
        first: Loads that a multiplies, none of them constant.
        second: Loads that b multiplies.
        directions: In how many directions limit loads are bounded at most.
        until: Distance of the polygons, relative, at which that ends.
        around: Whether a and b may be negative.
        rtol: How near each bound comes to the best of its kind on its mesh, relative.
        adaptation: How the mesh is adapted in each direction; None for that of the problem.
        monitor: Called on every rank with the angle (degrees) of each direction, and what has its
            lower and its upper bound.
        steps: Called on every rank after each step of the interior point method.

    Raises:
        InputError: If a load is constant, and as :func:`limit_bounds.limit_bounds`.
    """
    if directions < 1:
        raise InputError(f"directions = {directions} is none; give a number from 3 on.")
    for load in (*first, *second):
        if load.constant:
            raise InputError(
                f"the load on '{load.on}' is constant, but an envelope multiplies it; leave"
                " constant out, or declare it with the problem as a load that stays."
            )
    stay = [load for load in problem.given.loads if load.constant]
    carried, sides, asked = list[Floats](), list[Floats](), list[float]()
    # Directions to begin with (degrees), of a quarter of the circle and of all of it.
    at_first = {False: (0.0, 45.0, 90.0), True: (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)}
    queue, gap = list(at_first[around]), math.inf
    while len(asked) < directions:
        if not queue:
            gap, angle = _worst(np.array(carried), np.array(sides), around, asked)
            if gap <= until or angle is None:
                break
            queue = [angle]
        angle = queue.pop(0)
        asked.append(angle)
        ray = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        parts = [(first, ray[0]), (second, ray[1])]
        loads = [scaled(load, f) for some, f in parts for load in some if abs(f) > 1e-12]
        loaded = variant(problem, loads=[*stay, *loads])
        low, high = _bounds(loaded, adaptation, rtol, steps)
        if monitor is not None:
            monitor(angle, low, high)
        if low.lower.strict and low.question is Question.LIMIT and low.lower.value is not None:
            carried.append(low.lower.value * ray)
        if high.upper.strict and high.question is Question.LIMIT:
            sides.append(_side(high, (first, second), ray))
    gap, _ = _worst(np.array(carried), np.array(sides), around, asked)
    polygons = np.array(carried).reshape(-1, 2), np.array(sides).reshape(-1, 3)
    return Envelope(*polygons, tuple(asked), gap, around, high)


def _bounds(
    problem: Problem,
    adaptation: Adaptation | None,
    rtol: float,
    steps: Callable[[InteriorStep], None] | None,
) -> tuple[BodyBounds, BodyBounds]:
    """What has the best lower and the best upper bound. Collective."""
    if adaptation is None:
        found = limit_bounds(problem, rtol, steps)
        return found, found
    adapted = adaptive_bounds(problem, adaptation, rtol, steps=steps)
    return adapted.low, adapted.high


def _side(bounds: BodyBounds, loads: tuple[Sequence[Load], Sequence[Load]], ray: Floats) -> Floats:
    """The half-plane of a mechanism, scaled to a normal of length 1. Collective.

    The bound along the ray is (D(v) − L₀(v))/(ray·w) with the works w = (A(v), B(v)), so that the
    half-plane is (a, b)·w ≤ bound · ray·w.
    """
    problem, velocity = bounds.flow.problem, bounds.flow.velocity.x.petsc_vec
    works = np.zeros(2)
    for number, some in enumerate(loads):
        found = on_this_mesh(bounds.problem.tagged_mesh, some, problem.given.rigid)
        vector = work_vector(problem.V, problem.tagged_mesh, found)
        works[number] = vector.dot(velocity)
        vector.destroy()
    value = bounds.upper.value
    if value is None:
        raise RuntimeError("a half-plane of no bound")
    side: Floats = np.array([*works, value * (ray @ works)]) / np.linalg.norm(works)
    return side


def _worst(
    carried: Floats, sides: Floats, around: bool, asked: Sequence[float]
) -> tuple[float, float | None]:
    """The largest distance of the polygons along a ray, relative, and where to ask next.

    Args:
        carried: Of :class:`Envelope`.
        sides: Of the same.
        around: Of the same.
        asked: Angles (degrees) that are not asked again.

    Returns:
        The distance, and the angle (degrees) where they are farthest apart of those that are not
        next to one that was asked; None where there is none.
    """
    # Rays along which the distance of the polygons is looked at, over the whole circle.
    rays = 720
    angles = np.linspace(0, 360, rays, endpoint=False) if around else np.linspace(0, 90, rays // 4)
    inner = _inner(carried, np.radians(angles))
    outer = _outer(sides, np.radians(angles))
    known = np.isfinite(outer) & (inner > 0)
    apart = np.where(known, outer / np.where(known, inner, 1.0) - 1.0, np.inf)
    turns = np.abs(angles[:, None] - np.array(asked)[None, :])
    least_apart = 1.0  # degrees between two directions, at least
    new = (np.minimum(turns, 360 - turns) >= least_apart).all(axis=1)
    order = np.where(new, apart, -np.inf)
    best = int(np.argmax(order))
    return float(apart.max()), float(angles[best]) if new[best] else None


def _outer(sides: Floats, angles: Floats) -> Floats:
    """Along each ray, where it leaves the half-planes; inf where it does not."""
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    found = np.full(len(angles), np.inf)
    for p, q, r in sides.reshape(-1, 3):
        along = rays @ (p, q)
        ahead = along > 0
        found[ahead] = np.minimum(found[ahead], r / along[ahead])
    return found


def _inner(carried: Floats, angles: Floats) -> Floats:
    """Along each ray, how far the hull of points reaches; −inf where it is not met."""
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    found: Floats = np.full(len(angles), -np.inf)
    points = carried.reshape(-1, 2)
    for point in points:
        size = float(np.linalg.norm(point))
        on = rays @ point >= size * (1 - 1e-12)
        found[on] = np.maximum(found[on], size)
    for lower, upper in _through_hull(points, rays):
        found = np.where(upper >= np.maximum(lower, 0.0), np.maximum(found, upper), found)
    return found


def _through_hull(points: Floats, rays: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Where rays enter and leave the hull of points; nothing where these are on a line."""
    size = np.ptp(points, axis=0) if len(points) else np.zeros(2)
    if len(points) < 3 or np.linalg.matrix_rank(points[1:] - points[0], tol=1e-9 * size.max()) < 2:
        return
    edges = ConvexHull(points).equations  # outward normals n and offsets: n·x + offset ≤ 0
    along = rays @ edges[:, :2].T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -edges[:, 2] / along
    outside = (along == 0) & (edges[:, 2] > 0)  # parallel to an edge, and beyond it
    leaves = np.where(along > 0, at, np.inf).min(axis=1)
    enters = np.where(along < 0, at, -np.inf).max(axis=1)
    yield np.where(outside.any(axis=1), np.inf, enters), leaves
