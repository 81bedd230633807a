"""Set up and solve the linear programs of rigid blocks, for joint forces and for motions.

A block has unlimited strength, so the forces on it only have to be in balance. Joint forces act at
points x on both sides of the joint, in the directions (n, t). The normal n points out of the first
side. A motion v has the jump w = v₁(x) − v₂(x). The forces f in the Coulomb cone

    f_n = −p ≤ 0,   ‖f_t‖ ≤ μp

do the work f·w ≥ 0 on all jumps with w_n + μ‖w_t‖ ≤ 0. By duality, two values are equal: the
largest λ for which forces in the cones balance λL₁ + L₀, and the minimum of −L₀(v) over all motions
v with these jumps and L₁(v) = 1. Because w is linear on a facet, the conditions are required only
at the vertices. If surfaces adhere, shear tractions also act. These tractions are linear on a
facet, have a norm of at most c, and do at most the work ∫c‖w_t‖.

In 2D each problem is one linear program. In 3D, polyhedral cones replace the circular cones:
inscribed cones for the forces, and circumscribed cones for the motions. Both bounds are therefore
strict for any number of edges. The search adds edges where the dual solution of a linear program
violates a circular cone.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.sparse import coo_array, csr_array, hstack

from perfplast_fenicsx.arrays import Floats, Longs

FIRST_EDGES = 8
"""Initial number of edges of a polyhedral cone in 3D."""

MOST_ROUNDS = 60

INNER_STEPS = 7
"""Number of powers of ten over which the distances of inner forces from their limits range."""


class Outcome(StrEnum):
    """The outcome of a linear program."""

    FOUND = "found"
    UNBOUNDED = "unbounded"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Places:
    """Points of joints, each with its set of admissible forces: a cone or a tangential disc.

    Attributes:
        jump: Matrix that maps motions to the components of w along (n, t) at each point (for a disc
            only along t), shape (num_places · components, num_motions).
        size: Coefficient μ of each cone, or radius of each disc (force), shape (num_places,).
        cone: Whether the sets are cones; otherwise they are discs.
        components: Number of components of a force.
    """

    jump: csr_array
    size: Floats
    cone: bool
    components: int

    @property
    def count(self) -> int:
        """Return the number of points."""
        return len(self.size)

    @property
    def across(self) -> int:
        """Return the number of tangential components."""
        return self.components - self.cone

    def jumps(self, motion: Floats) -> Floats:
        """Return the jumps of a motion at the points, shape (num_places, components)."""
        return np.asarray(self.jump @ motion, dtype=np.float64).reshape(-1, self.components)


@dataclass(frozen=True, eq=False)
class JointProgram:
    """Joints and loads of blocks, in units that scale the linear program.

    Attributes:
        cones: Points with contact and friction forces.
        discs: Points with adhesive tractions, each inside its part of the facet, for the forces.
        outer_discs: Points with adhesive tractions at the vertices, which overestimate the
            dissipation, for the motions.
        sought: Work of the loads with the unknown factor, for each unknown motion, shape
            (num_motions,).
        constant: Work of the constant loads for each unknown motion.
        others: Work of the free loads for each unknown motion. Free loads may have any factor.
        most: The largest λ for which forces are sought. It is finite if the joints may carry the
            loads at any factor, because forces for one factor are then enough for a proof.
    """

    cones: Places
    discs: Places
    outer_discs: Places
    sought: Floats
    constant: Floats
    others: Floats
    most: float = np.inf


@dataclass(frozen=True, eq=False)
class JointForces:
    """Joint forces from a linear program, at the largest λ or near it.

    Attributes:
        outcome: Whether forces were found.
        value: Load factor λ.
        aside: Factor of the free loads.
        cones: Forces at the points with cones, shape (num_cones, d).
        discs: Forces at the points with discs, shape (num_discs, d − 1).
    """

    outcome: Outcome
    value: float
    aside: float
    cones: Floats
    discs: Floats


@dataclass(frozen=True, eq=False)
class BlockMotion:
    """The motion that gives the smallest upper bound on λ.

    Attributes:
        outcome: Whether a motion was found.
        value: Upper bound on λ.
        motion: Amplitudes of the motion v with L₁(v) = 1, shape (num_motions,).
    """

    outcome: Outcome
    value: float
    motion: Floats


@dataclass
class _Edges:
    """Edges of polygons that approximate discs of radius 1.

    Attributes:
        of: Index of the point of each edge.
        angle: Angle of each edge (rad); in 2D 0 or π.
    """

    of: Longs
    angle: Floats

    @classmethod
    def first(cls, places: Places) -> "_Edges":
        """Return the initial edges at the points whose ``size`` is positive."""
        rubs = np.flatnonzero(places.size > 0)
        count = 2 if places.across == 1 else FIRST_EDGES
        angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return cls(np.repeat(rubs, count), np.tile(angles, len(rubs)))

    def add(self, of: Longs, angle: Floats) -> int:
        """Add the new edges among the given edges, and return the number of new edges."""
        angle = np.mod(angle, 2 * np.pi)
        near = 1e-7  # Angles that differ by less (in turns) count as equal.
        keys, wanted = (np.sort(self.of + self.angle / (2 * np.pi)), of + angle / (2 * np.pi))
        after = np.searchsorted(keys, wanted)
        keys = np.concatenate([[-np.inf], keys, [np.inf]])
        fresh = np.minimum(wanted - keys[after], keys[after + 1] - wanted) > near
        self.of = np.append(self.of, of[fresh])
        self.angle = np.append(self.angle, angle[fresh])
        return int(fresh.sum())

    def inside(self, places: Places) -> tuple[Longs, Floats]:
        """Return the point and the direction for each corner of the inscribed polygons."""
        return self.of, _directions(self.angle, places.across)

    def outside(self, places: Places) -> tuple[Longs, Floats]:
        """Return the point and the direction for each corner of the circumscribed polygons."""
        if places.across == 1:
            return self.inside(places)
        order = np.lexsort([self.angle, self.of])
        of, angle = self.of[order], self.angle[order]
        start = np.flatnonzero(np.diff(of, prepend=-1))
        counts = np.diff(np.append(start, len(of)))
        after = np.arange(1, len(of) + 1)
        after[start + counts - 1] = start
        turn = np.mod(angle[after] - angle, 2 * np.pi)
        return of, _directions(angle + turn / 2, 2) / np.cos(turn / 2)[:, None]


def _directions(angle: Floats, across: int) -> Floats:
    """Return unit vectors, shape (n, across)."""
    values = np.column_stack([np.cos(angle), np.sin(angle)])[:, :across]
    return np.asarray(np.round(values) if across == 1 else values, dtype=np.float64)


def best_of_joints(
    inner: JointProgram, outer: JointProgram, rtol: float
) -> tuple[JointForces, BlockMotion, int]:
    """Return the joint forces with the largest λ, and the motion with the smallest bound on λ.

    Args:
        inner: Linear program for the forces.
        outer: Linear program for the motions, at the same points and with at least as much
            friction.
        rtol: Permitted relative distance of each result from its optimum with circular cones.

    Returns:
        The forces, the motion, and the number of linear programs that were solved.
    """
    forces, rounds = _sharpened(inner, rtol, inside=True)
    motion, more = _sharpened(outer, rtol, inside=False)
    assert isinstance(forces, JointForces)
    assert isinstance(motion, BlockMotion)
    return forces, motion, rounds + more


def inner_forces(program: JointProgram, best: JointForces) -> JointForces | None:
    """Return forces strictly inside their limits, at the best factor or a smaller one, or None.

    If the linear program has no solution, the function returns None.

    A linear program maximises a weighted sum of the distances of the forces from the sides of the
    cones. Each distance is a sum of parts. The limit of each part is a tenth of the previous limit,
    and its weight is ten times the previous weight. Adhesive tractions use at most half of the
    adhesion.

    Args:
        program: Linear program for the forces.
        best: Solution of this program.
    """
    every = (program.cones, program.discs)
    generators = [_generators(of, _Edges.first(of), True) for of in every]
    blocks = [_columns(*pair) for pair in zip(every, generators, strict=True)]
    loads = np.column_stack([program.sought, program.others])[:, : 1 + program.others.any()]
    of_cones, of_discs = (of[0] for of in generators)
    count = program.cones.count
    sums = coo_array((np.ones(len(of_cones)), (np.arange(len(of_cones)), of_cones)))
    sums.resize((len(of_cones), count))
    steps = 10.0 ** -np.arange(INNER_STEPS)  # fractions of the loads, which have magnitude 1
    inside = blocks[0] @ sums.tocsr()
    columns = hstack([*blocks, coo_array(loads), *[inside] * INNER_STEPS], format="csr")
    forces, total = sum(block.shape[1] for block in blocks), columns.shape[1]
    first = forces + loads.shape[1]
    objective, bounds = np.zeros(total), np.zeros((total, 2))
    objective[first:] = -np.repeat(1 / steps, count)
    bounds[:, 1] = np.inf
    bounds[first:, 1] = np.repeat(steps, count)
    bounds[forces] = best.value - max(abs(best.value), 1.0), best.value
    bounds[forces + 1 : first] = -np.inf, np.inf
    budget = None
    if len(of_discs):
        at = blocks[0].shape[1] + np.arange(len(of_discs))
        shape = (program.discs.count, total)
        budget = coo_array((np.ones(len(of_discs)), (of_discs, at)), shape=shape).tocsr()
    from scipy.optimize import linprog  # slow to import, and few cases need it

    found = linprog(
        objective,
        A_ub=budget,
        b_ub=None if budget is None else np.full(program.discs.count, 0.5),
        A_eq=columns,
        b_eq=-program.constant,
        bounds=bounds,
        method="highs-ds",
    )
    if found.status != 0:
        return None
    margins = found.x[first:].reshape(INNER_STEPS, count).sum(axis=0)
    sizes = found.x[:forces].copy()
    sizes[: len(of_cones)] += margins[of_cones]
    parts, start = list[Floats](), 0
    for places, (of, vectors) in zip(every, generators, strict=True):
        parts.append(np.zeros((places.count, places.components)))
        np.add.at(parts[-1], of, vectors * sizes[start : start + len(of), None])
        start += len(of)
    aside = float(found.x[forces + 1]) if first > forces + 1 else 0.0
    return JointForces(Outcome.FOUND, float(found.x[forces]), aside, *parts)


def _sharpened(
    program: JointProgram, rtol: float, inside: bool
) -> tuple[JointForces | BlockMotion, int]:
    """Return the result of the last of several linear programs, and the number of programs.

    Each program has more edges than the previous program. If ``inside`` is true, cones and discs
    are inscribed, and otherwise circumscribed.
    """
    discs = program.discs if inside else program.outer_discs
    every = (program.cones, discs)
    edges = [_Edges.first(places) for places in every]
    rounds = 0
    while True:
        rounds += 1
        found = _Solved.of(program, every, edges, inside)
        if found.outcome is not Outcome.FOUND or rounds == MOST_ROUNDS:
            break
        # Allowed violation of a circular cone, relative to the largest force or jump.
        close = 0.01 * rtol
        if not found.sharpen(every, edges, inside, close):
            break
    return (found.forces(every) if inside else found.block_motion(every)), rounds


@dataclass(eq=False)
class _Solved:
    """The result of a linear program.

    Attributes:
        outcome: Whether the linear program was solved.
        value: Load factor λ.
        columns: Work of each unit force, and of each load, on the unknown motions, shape
            (num_motions, num_columns).
        generators: Points and components of the unit forces of cones, and of discs.
        sizes: Magnitude of each unit force in the solution, shape (num_forces,).
        aside: Factor of the free loads.
        motion: The motion in the dual solution.
        program: The joints and loads of the linear program.
    """

    outcome: Outcome
    value: float
    columns: csr_array
    generators: list[tuple[Longs, Floats]]
    sizes: Floats
    aside: float
    motion: Floats
    program: JointProgram

    @classmethod
    def of(
        cls, program: JointProgram, every: tuple[Places, ...], edges: list[_Edges], inside: bool
    ) -> "_Solved":
        """Solve a linear program and return its result."""
        generators = [_generators(*pair, inside) for pair in zip(every, edges, strict=True)]
        blocks = [_columns(*pair) for pair in zip(every, generators, strict=True)]
        loads = np.column_stack([program.sought, program.others])[:, : 1 + program.others.any()]
        columns = hstack([*blocks, coo_array(loads)], format="csr")
        forces, total = sum(block.shape[1] for block in blocks), columns.shape[1]
        objective = np.zeros(total)
        objective[forces] = -1.0
        bounds = np.zeros((total, 2))
        bounds[:, 1] = np.inf
        bounds[forces:, 0] = -np.inf
        if inside:
            bounds[forces, 1] = program.most
        of_discs = generators[1][0]
        budget = None
        if len(of_discs):  # The weights of a polygon's corners sum to at most 1.
            at = blocks[0].shape[1] + np.arange(len(of_discs))
            ones = np.ones(len(of_discs))
            budget = coo_array((ones, (of_discs, at)), shape=(every[1].count, total)).tocsr()
        from scipy.optimize import linprog  # slow to import, and few cases need it

        found = linprog(
            objective,
            A_ub=budget,
            b_ub=None if budget is None else np.ones(every[1].count),
            A_eq=columns,
            b_eq=-program.constant,
            bounds=bounds,
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        outcomes = {0: Outcome.FOUND, 2: Outcome.INFEASIBLE, 3: Outcome.UNBOUNDED}
        outcome = outcomes.get(found.status, Outcome.FAILED)
        none = np.zeros(len(program.sought))
        if outcome is not Outcome.FOUND:
            nothing = np.zeros(forces)
            return cls(outcome, np.nan, columns, generators, nothing, 0.0, none, program)
        x = _balanced(columns, -program.constant, np.asarray(found.x, dtype=np.float64), forces)
        aside = float(x[forces + 1]) if total > forces + 1 else 0.0
        motion = -np.asarray(found.eqlin.marginals, dtype=np.float64)
        return cls(
            *(outcome, float(x[forces]), columns, generators, x[:forces], aside, motion, program)
        )

    def sharpen(
        self, every: tuple[Places, ...], edges: list[_Edges], inside: bool, close: float
    ) -> int:
        """Add edges where the solution violates circular cones, and return the number of new edges.

        Args:
            every: Points with cones, and points with discs.
            edges: Edges of the polygons.
            inside: Whether the polygons are inscribed.
            close: Allowed violation of a circular cone, relative to the largest force or jump.
        """
        added = 0
        parts = self.parts(every)
        for places, mine, part in zip(every, edges, parts, strict=True):
            if places.across == 1 or not len(mine.of):
                continue
            if inside:  # The new edges are forces that oppose the slip.
                jump = places.jumps(self.motion)
                slip = -jump[:, int(places.cone) :]
                off = places.size * np.linalg.norm(slip, axis=1)
                off = off + jump[:, 0] if places.cone else off
                weight = np.linalg.norm(jump, axis=1)
            else:  # The new edges cut off forces outside the circular cone.
                slip = part[:, int(places.cone) :]
                limit = -part[:, 0] if places.cone else np.ones(places.count)
                weight = np.linalg.norm(slip, axis=1)
                off = weight - places.size * limit
            most = float(weight.max(initial=0.0))
            chosen = (off > close * most) & (places.size > 0)
            here = np.flatnonzero(chosen)
            added += mine.add(here, np.arctan2(slip[here, 1], slip[here, 0]))
        return added

    def parts(self, every: tuple[Places, ...]) -> list[Floats]:
        """Return the forces at all points with cones, and at all points with discs."""
        found, first = list[Floats](), 0
        for places, (of, vectors) in zip(every, self.generators, strict=True):
            sizes = self.sizes[first : first + len(of)]
            first += len(of)
            total = np.zeros((places.count, places.components))
            np.add.at(total, of, vectors * sizes[:, None])
            found.append(total)
        return found

    def forces(self, every: tuple[Places, ...]) -> JointForces:
        """Return the forces of a linear program with inscribed cones."""
        return JointForces(self.outcome, self.value, self.aside, *self.parts(every))

    def block_motion(self, every: tuple[Places, ...]) -> BlockMotion:
        """Return the motion and its upper bound on λ from a program with circumscribed cones."""
        if self.outcome is not Outcome.FOUND:
            return BlockMotion(self.outcome, np.nan, self.motion)
        motion, program = self._admissible(every), self.program
        discs = every[1]
        dissipation = float(discs.size @ np.linalg.norm(discs.jumps(motion), axis=1))
        work = float(program.sought @ motion)
        value = (dissipation - float(program.constant @ motion)) / work
        return BlockMotion(self.outcome, value, np.asarray(motion / work, dtype=np.float64))

    def _admissible(self, every: tuple[Places, ...]) -> Floats:
        """Return the motion with a correction that removes violations due to rounding errors."""
        program, count = self.program, len(self.generators[0][0])
        power = np.asarray(self.columns[:, :count].T @ self.motion)
        scale = np.abs(self.columns[:, :count]).T @ np.abs(self.motion)
        # A force counts as idle if its power, relative to the terms of the power, is below idle.
        idle = 1e-8
        active = np.flatnonzero(np.abs(power) <= idle * scale)
        rows = np.vstack(
            [self.columns[:, active].T.toarray(), program.sought[None], program.others[None]]
        )
        wanted = np.zeros(len(rows))
        wanted[-2] = 1.0
        sizes = np.linalg.norm(rows, axis=1)
        some = sizes > 0
        rows, wanted = rows[some] / sizes[some, None], wanted[some] / sizes[some]
        motion = self.motion
        for _ in range(2):
            off = wanted - rows @ motion
            motion = motion + np.linalg.lstsq(rows, off, rcond=1e-10)[0]
        return np.asarray(motion)


def _generators(places: Places, edges: _Edges, inside: bool) -> tuple[Longs, Floats]:
    """Return the points and the components of the unit forces that generate admissible sets."""
    of, across = edges.inside(places) if inside else edges.outside(places)
    across = across * places.size[of][:, None]
    if not places.cone:
        return of, across
    smooth = np.flatnonzero(places.size == 0)
    pushes = np.zeros((len(smooth), places.components))
    pushes[:, 0] = -1.0
    rubs = np.column_stack([np.full(len(of), -1.0), across])
    return np.append(smooth, of), np.vstack([pushes, rubs])


def _columns(places: Places, generators: tuple[Longs, Floats]) -> csr_array:
    """Return the work of unit forces on unknown motions, shape (num_motions, num_forces)."""
    of, vectors = generators
    number = np.repeat(np.arange(len(of)), places.components)
    row = (of[:, None] * places.components + np.arange(places.components)).ravel()
    shape = (len(of), places.count * places.components)
    pick = coo_array((vectors.ravel(), (number, row)), shape=shape).tocsr()
    return (pick @ places.jump).T.tocsr()


def _balanced(columns: csr_array, wanted: Floats, x: Floats, forces: int) -> Floats:
    """Return the solution ``x`` with a correction that reduces imbalances to rounding errors."""
    used = np.append(x[:forces] > 1e-9 * np.abs(x).max(initial=0.0), np.ones(len(x) - forces, bool))
    some = columns[:, used].toarray()
    found = np.where(used, x, 0.0)
    for _ in range(2):
        off = wanted - columns @ found
        found[used] += np.linalg.lstsq(some, off, rcond=1e-12)[0]
    found[:forces] = np.maximum(found[:forces], 0.0)
    return found
