"""Compute interaction diagrams: the multiples of two or three loads that the bodies carry.

The bodies carry a·A + b·B together with the constant loads for a convex set of pairs (a, b), or of
triples for three loads. Strict lower bounds prove points of this set, and the convex hull of these
points lies inside the set. A mechanism v of a strict upper bound dissipates D(v), which bounds the
work of *all* loads that the bodies carry:

    a A(v) + b B(v) ≤ D(v) − L₀(v).

This half-space contains the whole set. The hull and the intersection of the half-spaces are two
proven polytopes, and the boundary of the set lies between them. The search bounds the loads in one
direction after another. Each new direction is the one in which the polytopes are farthest apart.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import best_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, sentences
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import (
    farthest_apart,
    inner_along,
    outer_along,
    rays_at,
    spread,
    to_begin_with,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.spread_forces import on_this_mesh
from perfplast_fenicsx.problem.declared.loads import Load, scaled
from perfplast_fenicsx.problem.problem import Problem, variant
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row

Angles = tuple[float, ...]
"""A direction (degrees): the angle from the axis of the first load towards the axis of the second
load. For three loads, also the angle from the plane of these axes towards the third axis."""


@dataclass(frozen=True)
class Proven:
    """The proven bounds in a direction.

    Attributes:
        angles: The direction.
        carried: The largest pair or triple in this direction that the bodies provably carry; None
            without a strict lower bound.
        side: The half-space (n, r) of a mechanism, with n·x ≤ r; None without a strict upper bound.
    """

    angles: Angles
    carried: tuple[float, ...] | None
    side: tuple[float, ...] | None

    def is_at(self, angles: Angles) -> bool:
        """Return whether the bounds belong to the direction ``angles``."""
        return bool(np.allclose(self.angles, angles, rtol=0, atol=1e-9))


Proving = Callable[[BodyBounds, BodyBounds], Proven]
"""A function that returns the proven bounds, from the results with the lower and the upper bound.
"""


@dataclass(frozen=True, eq=False)
class Envelope(NotebookResult):
    """Two polytopes, between which the boundary of the set of carried loads lies.

    Attributes:
        carried: Pairs or triples that the bodies provably carry, shape (n, d): one for each
            direction with a strict lower bound. Without constant loads, the first row is zero. The
            bodies also carry all points of their convex hull.
        sides: Half-spaces n·x ≤ r with rows (n, r), |n| = 1, shape (m, d + 1). The bodies carry no
            point outside any half-space.
        directions: Directions of the search, in order.
        gap: Largest relative distance between the polytopes along a ray; inf if a polytope is
            missing on a ray. Rays are half a degree apart for two loads, and 3 degrees for three.
        signed: For each load, whether its multiple may be negative.
        last: The result in the last direction of the search.
    """

    carried: Floats
    sides: Floats
    directions: tuple[Angles, ...]
    gap: float
    signed: tuple[bool, ...]
    last: BodyBounds

    def inner(self, *angles: float) -> float:
        """Return the distance up to which loads are provably carried along a ray; −inf if unknown.

        Args:
            *angles: Direction of the ray (degrees), see :data:`Angles`.
        """
        return float(inner_along(self.carried, rays_at(np.array([angles])))[0])

    def outer(self, *angles: float) -> float:
        """Return the distance beyond which no load is carried along a ray; inf if unknown.

        Args:
            *angles: Direction of the ray (degrees), see :data:`Angles`.
        """
        return float(outer_along(self.sides, rays_at(np.array([angles])))[0])

    def in_words(self) -> str:
        """Return a sentence on the loads that are provably carried."""
        pairs, polygon, number = (
            ("pairs", "polygon", "two")
            if len(self.signed) == 2
            else ("triples", "polytope", "three")
        )
        if not math.isfinite(self.gap):
            return (
                f"Which {pairs} of the {number} loads are carried is not proven in all directions."
            )
        return (
            f"All {pairs} inside one {polygon} are carried for certain, and none outside "
            f"another; they are at most {100 * self.gap:.3g} % apart, after "
            f"{len(self.directions)} directions." + sentences(self.last.taken)
        )

    def rows(self) -> list[Row]:
        """Return a table row for each ray, with the distances at which it leaves both polytopes.

        Rays are a degree apart for two loads, and 5 degrees for three.
        """
        angles = spread(self.signed, 1.0 if len(self.signed) == 2 else 5.0)
        rays = rays_at(angles)
        columns = {"angle": angles[:, 0]}
        if len(self.signed) == 3:
            columns["elevation"] = angles[:, 1]
        columns["carried"] = inner_along(self.carried, rays)
        columns["not carried from"] = outer_along(self.sides, rays)
        return [
            {name: float(one[i]) if np.isfinite(one[i]) else None for name, one in columns.items()}
            for i in range(len(rays))
        ]

    @property
    def dimensions(self) -> int:
        """Return the number of loads."""
        return len(self.signed)

    def draw_into(self, axes: Any) -> None:
        """Draw the points at which rays leave the two polytopes."""
        rows = self.rows()
        angles = [[row[name] for name in ("angle", "elevation") if name in row] for row in rows]
        rays = rays_at(np.array(angles))
        for column, colour in (("carried", "lower"), ("not carried from", "upper")):
            far = np.array([np.nan if row[column] is None else row[column] for row in rows])
            axes.plot(*(rays * far[:, None]).T, ".", color=COLOURS[colour], label=column)
        names = [f"multiple of load {number}" for number in range(1, self.dimensions + 1)]
        axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), names, strict=False)))
        axes.legend()

    def __repr__(self) -> str:
        return (
            f"Envelope({len(self.carried)} points carried, {len(self.sides)} half-spaces;"
            f" {self.gap:.2%} apart)"
        )


@dataclass(frozen=True)
class Progress:
    """The monitors of a search, and the results of an earlier search that it continues.

    Attributes:
        monitor: Called on every rank with each direction, the results with its lower and its upper
            bound, and a function that returns their proven bounds. The monitor must return these
            proven bounds.
        steps: Called on every rank after each step of the interior point method.
        known: Proven results of an earlier search, which this search continues. The last direction
            of the earlier search is computed again, because its mechanism is part of the result.
    """

    monitor: Callable[[Angles, BodyBounds, BodyBounds, Proving], Proven] | None = None
    steps: Callable[[InteriorStep], None] | None = None
    known: Sequence[Proven] = ()


def envelope(
    problem: Problem,
    loads: Sequence[Sequence[Load]],
    directions: int = 12,
    until: float = 0.01,
    around: bool | Sequence[bool] = False,
    rtol: float = 1e-4,
    adaptation: Adaptation | None = None,
    progress: Progress | None = None,
) -> Envelope:
    """Return bounds on the set of multiples (a, b) or (a, b, c) of loads that the bodies carry.

    Collective.

    Args:
        problem: The bodies; the constant loads of the problem act in addition.
        loads: For each of two or three numbers, the loads that it multiplies; no load may be
            constant.
        directions: Largest number of directions in which limit loads are bounded.
        until: Relative distance of the polytopes at which the search ends.
        around: Whether numbers may be negative; one value for each number, or one value for all.
        rtol: Largest relative distance of each bound from the best bound of its kind on its mesh.
        adaptation: Adaptation of the mesh in each direction; None for the mesh of the problem.
        progress: Monitors and earlier results; None without both.

    Raises:
        InputError: If a load is constant, if ``loads`` is not for two or three numbers, if
            ``directions`` is less than 1, if ``around`` has a different length from ``loads``, or
            if :func:`limit_bounds.limit_bounds` refuses the problem.
    """
    _check(loads, directions)
    signed = (around,) * len(loads) if isinstance(around, bool) else tuple(around)
    if len(signed) != len(loads):
        raise InputError(
            f"around = {around} must have one entry for each of the {len(loads)} load factors."
        )
    watched = progress or Progress()
    stay = [load for load in problem.given.loads if load.constant]
    carried: list[Sequence[float]] = [] if stay else [(0.0,) * len(loads)]
    sides, asked = list[Sequence[float]](), list[Angles]()
    last: BodyBounds | None = None
    queue = [tuple(map(float, row)) for row in to_begin_with(signed)]
    while len(asked) < directions:
        if not queue:
            gap, worst = _worst(carried, sides, signed, asked)
            if gap <= until or worst is None:
                break
            queue = [worst]
        asked.append(queue.pop(0))
        proven = next((one for one in watched.known[:-1] if one.is_at(asked[-1])), None)
        if proven is None:
            ray = rays_at(np.array(asked[-1:]))[0]
            parts = zip(loads, ray, strict=True)
            mixed = [scaled(load, f) for some, f in parts for load in some if abs(f) > 1e-12]
            mixture = variant(problem, loads=[*stay, *mixed])
            low, last = best_bounds(mixture, adaptation, rtol, watched.steps)
            prove = partial(_proven, asked[-1], ray, loads)
            if watched.monitor is None:
                proven = prove(low, last)
            else:
                proven = watched.monitor(asked[-1], low, last, prove)
        carried += [] if proven.carried is None else [proven.carried]
        sides += [] if proven.side is None else [proven.side]
    if last is None:
        raise RuntimeError("the earlier search has more directions than this one")
    gap, _ = _worst(carried, sides, signed, asked)
    return Envelope(*_arrays(carried, sides, len(loads)), tuple(asked), gap, signed, last)


def _proven(
    angles: Angles,
    ray: Floats,
    loads: Sequence[Sequence[Load]],
    low: BodyBounds,
    high: BodyBounds,
) -> Proven:
    """Return the proven bounds along a ray. Collective."""
    carried = side = None
    if low.question is Question.LIMIT and low.lower.strict_value is not None:
        carried = tuple(map(float, low.lower.strict_value * ray))
    if high.upper.strict and high.question is Question.LIMIT:
        side = tuple(map(float, _side(high, loads, ray)))
    return Proven(angles, carried, side)


def _check(loads: Sequence[Sequence[Load]], directions: int) -> None:
    """Refuse input that does not define an interaction diagram."""
    if directions < 1:
        raise InputError(f"directions = {directions} is too small; give at least 3.")
    if len(loads) not in (2, 3):
        raise InputError(
            f"an envelope needs two or three load factors, but there are {len(loads)}; give the "
            "loads for two or three factors."
        )
    for load in (load for some in loads for load in some):
        if load.constant:
            raise InputError(
                f"the load on '{load.on}' is constant, but an envelope multiplies it by a factor; "
                "remove constant, or declare the load with the problem."
            )


def _arrays(
    carried: Sequence[Sequence[float]], sides: Sequence[Sequence[float]], number: int
) -> tuple[Floats, Floats]:
    return np.array(carried).reshape(-1, number), np.array(sides).reshape(-1, number + 1)


def _worst(
    carried: Sequence[Sequence[float]],
    sides: Sequence[Sequence[float]],
    signed: tuple[bool, ...],
    asked: Sequence[Angles],
) -> tuple[float, Angles | None]:
    gap, worst = farthest_apart(*_arrays(carried, sides, len(signed)), signed, np.array(asked))
    return gap, None if worst is None else tuple(map(float, worst))


def _side(bounds: BodyBounds, loads: Sequence[Sequence[Load]], ray: Floats) -> Floats:
    """Return the half-space of a mechanism, scaled to a unit normal. Collective.

    The bound along the ray is (D(v) − L₀(v))/(ray·w) with the works w = (A(v), B(v), ...). The
    half-space is therefore x·w ≤ bound · ray·w.
    """
    problem, velocity = bounds.flow.problem, bounds.flow.velocity.x.petsc_vec
    works = np.zeros(len(loads))
    for number, some in enumerate(loads):
        found = on_this_mesh(bounds.problem.tagged_mesh, some, problem.given.rigid)
        vector = work_vector(problem.V, problem.tagged_mesh, found)
        works[number] = vector.dot(velocity)
        vector.destroy()
    value = bounds.upper.value
    if value is None:
        raise RuntimeError("a half-space needs an upper bound")
    side: Floats = np.array([*works, value * (ray @ works)]) / np.linalg.norm(works)
    return side
