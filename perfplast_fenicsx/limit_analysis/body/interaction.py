"""Which multiples of two or three loads are carried: an interaction diagram between two polytopes.

The pairs (a, b) for which a·A + b·B is carried, beside loads that stay, are a convex set, and so
are triples. So the hull of those that strict lower bounds show to be carried is inside of it. And a
mechanism v of a strict upper bound dissipates D(v), which bounds the work of *everything* that is
carried:

    a A(v) + b B(v) ≤ D(v) − L₀(v),

a half-space, in which the set lies as a whole. Both polytopes are proven; between them the set's
surface runs. Directions are those in which they are farthest apart, one after the other.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import adaptive_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.bound_words import sentences
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import (
    farthest_apart,
    inner_along,
    outer_along,
    rays_at,
    spread,
    to_begin_with,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.spread_forces import on_this_mesh
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.scaled_load import scaled
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

Angles = tuple[float, ...]
"""A direction (degrees): from the first number to the second, and of three numbers the angle above
that plane, towards the third."""


@dataclass(frozen=True)
class Proven:
    """The proven bounds in a direction.

    Attributes:
        angles: The direction.
        carried: The pair or triple in it that is carried for certain, as far out as was found; None
            without a strict lower bound.
        side: The half-space (n, r) of a mechanism, n·x ≤ r; None without a strict upper bound.
    """

    angles: Angles
    carried: tuple[float, ...] | None
    side: tuple[float, ...] | None

    def is_at(self, angles: Angles) -> bool:
        """Return whether it is of this direction."""
        return bool(np.allclose(self.angles, angles, rtol=0, atol=1e-9))


Proving = Callable[[BodyBounds, BodyBounds], Proven]
"""Makes a proof of what has a lower and what has an upper bound in a direction."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """Two polytopes with the surface of the set of what is carried between them.

    Attributes:
        carried: Pairs or triples that are carried for certain, shape (n, d), one for each direction
            in which a strict lower bound was found, and zero first where no load stays; the hull
            of them is carried as well.
        sides: Half-spaces n·x ≤ r with rows (n, r), |n| = 1, shape (m, d + 1): what is outside of
            one of them is not carried.
        directions: Directions that were looked at, in turn.
        gap: What the outer polytope exceeds the inner one by at most along a ray, relative; inf
            where one of them is missing there. Rays are half a degree apart, of three numbers 3.
        signed: Of each number whether it may be negative.
        last: What was found in the last direction.
    """

    carried: Floats
    sides: Floats
    directions: tuple[Angles, ...]
    gap: float
    signed: tuple[bool, ...]
    last: BodyBounds

    def inner(self, *angles: float) -> float:
        """How far along a ray (degrees) all is carried for certain; −inf where none is known."""
        return float(inner_along(self.carried, rays_at(np.array([angles])))[0])

    def outer(self, *angles: float) -> float:
        """From where on along a ray (degrees) none is carried; inf where none is known."""
        return float(outer_along(self.sides, rays_at(np.array([angles])))[0])

    def in_words(self) -> str:
        """Return a sentence on what is proven."""
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
            f"All {pairs} inside of one {polygon} are carried for certain, and none outside of"
            f" another; they are {100 * self.gap:.3g} % apart at most, after"
            f" {len(self.directions)} directions." + sentences(self.last.taken)
        )

    def table(self) -> list[dict[str, float | None]]:
        """Return rows for a file: along each ray how far all is carried, and from where on none is.

        Rays are a degree apart, of three numbers 5.
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

    def __repr__(self) -> str:
        return (
            f"Envelope({len(self.carried)} points carried, {len(self.sides)} half-spaces;"
            f" {self.gap:.2%} apart)"
        )


def envelope(
    problem: Problem,
    loads: Sequence[Sequence[Load]],
    directions: int = 12,
    until: float = 0.01,
    around: bool | Sequence[bool] = False,
    rtol: float = 1e-4,
    adaptation: Adaptation | None = None,
    monitor: Callable[[Angles, BodyBounds, BodyBounds, Proving], Proven] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
    known: Sequence[Proven] = (),
) -> Envelope:
    """Bound the set of (a, b) or (a, b, c) for which such multiples are carried. Collective.

    Args:
        problem: The bodies; its constant loads act in addition.
        loads: For each number the loads that it multiplies, none of them constant; two or three.
        directions: Largest number of directions in which limit loads are bounded.
        until: Relative distance of the polytopes at which the search ends.
        around: Whether numbers may be negative; one value for each, or one for all.
        rtol: Relative distance of each bound to the best of its kind on its mesh.
        adaptation: Adaptation of the mesh in each direction; None for the mesh of the problem.
        monitor: Called on every rank with each direction, the results with its lower and its upper
            bound, and a function that makes their proof; returns that proof.
        steps: Called on every rank after each step of the interior point method.
        known: Proven results of an earlier search, to continue it. Its last direction is computed
            again, because the mechanism of the last direction is part of the result.

    Raises:
        InputError: If a load is constant, the number of loads is not two or three, or
            :func:`limit_bounds.limit_bounds` refuses the problem.
    """
    _check(loads, directions)
    signed = (around,) * len(loads) if isinstance(around, bool) else tuple(around)
    if len(signed) != len(loads):
        raise InputError(f"around = {around} is not one of each of {len(loads)} numbers.")
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
        proven = next((one for one in known[:-1] if one.is_at(asked[-1])), None)
        if proven is None:
            ray = rays_at(np.array(asked[-1:]))[0]
            parts = zip(loads, ray, strict=True)
            mixed = [scaled(load, f) for some, f in parts for load in some if abs(f) > 1e-12]
            low, last = _bounds(variant(problem, loads=[*stay, *mixed]), adaptation, rtol, steps)
            prove = partial(_proven, asked[-1], ray, loads)
            if monitor is None:
                proven = prove(low, last)
            else:
                proven = monitor(asked[-1], low, last, prove)
        carried += [] if proven.carried is None else [proven.carried]
        sides += [] if proven.side is None else [proven.side]
    if last is None:
        raise RuntimeError("an earlier search was of more directions than this one")
    gap, _ = _worst(carried, sides, signed, asked)
    return Envelope(*_arrays(carried, sides, len(loads)), tuple(asked), gap, signed, last)


def _proven(
    angles: Angles,
    ray: Floats,
    loads: Sequence[Sequence[Load]],
    low: BodyBounds,
    high: BodyBounds,
) -> Proven:
    """Return the bounds that are proven along a ray. Collective."""
    carried = side = None
    if low.lower.strict and low.question is Question.LIMIT and low.lower.value is not None:
        carried = tuple(map(float, low.lower.value * ray))
    if high.upper.strict and high.question is Question.LIMIT:
        side = tuple(map(float, _side(high, loads, ray)))
    return Proven(angles, carried, side)


def _check(loads: Sequence[Sequence[Load]], directions: int) -> None:
    """Refuse what is no diagram."""
    if directions < 1:
        raise InputError(f"directions = {directions} is too small; give at least 3.")
    if len(loads) not in (2, 3):
        raise InputError(
            f"an envelope of {len(loads)} numbers cannot be made; give the loads of two or three."
        )
    for load in (load for some in loads for load in some):
        if load.constant:
            raise InputError(
                f"the load on '{load.on}' is constant, but an envelope multiplies it; leave"
                " constant out, or declare it with the problem as a load that stays."
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


def _bounds(
    problem: Problem,
    adaptation: Adaptation | None,
    rtol: float,
    steps: Callable[[InteriorStep], None] | None,
) -> tuple[BodyBounds, BodyBounds]:
    """Return the results with the best lower and the best upper bound. Collective."""
    if adaptation is None:
        found = limit_bounds(problem, rtol, steps)
        return found, found
    adapted = adaptive_bounds(problem, adaptation, rtol, steps=steps)
    return adapted.low, adapted.high


def _side(bounds: BodyBounds, loads: Sequence[Sequence[Load]], ray: Floats) -> Floats:
    """Return the half-space of a mechanism, scaled to a normal of length 1. Collective.

    The bound along the ray is (D(v) − L₀(v))/(ray·w) with the works w = (A(v), B(v), ...), so that
    the half-space is x·w ≤ bound · ray·w.
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
        raise RuntimeError("a half-space of no bound")
    side: Floats = np.array([*works, value * (ray @ works)]) / np.linalg.norm(works)
    return side
