"""The linear programs of rigid blocks: forces on their joints, and motions of the blocks.

A block of any strength asks of the forces on it no more than balance. Those of a joint act at
places x on both its sides, in the directions (n, t) with n out of the first side. With the jump
w = v₁(x) − v₂(x) of motions v, forces f of the Coulomb cone

    f_n = −p ≤ 0,   ‖f_t‖ ≤ μp

do the work f·w ≥ 0 on all that keep to w_n + μ‖w_t‖ ≤ 0. So of all λ whose loads λL₁ + L₀ such
forces balance the largest is the least −L₀(v) of such motions with L₁(v) = 1. As w is linear on a
facet, its vertices are enough. Where surfaces adhere, shear tractions that are linear on a facet
and at most c do work as well, no more than ∫c‖w_t‖.

In the plane both are one linear program. In space cones of few edges replace the round ones: inside
of them for the forces, outside of them for the motions. So both bounds are strict for any edges.
Edges are added where the dual solution of a program asks for them.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, hstack

from perfplast_fenicsx.arrays import Floats, Longs

FIRST_EDGES = 8
"""Edges of a cone in space to begin with."""

MOST_ROUNDS = 60

INNER_STEPS = 7
"""Powers of ten by which distances of inner forces from their limits may differ."""


class Outcome(StrEnum):
    """The outcome of a linear program."""

    FOUND = "found"
    UNBOUNDED = "unbounded"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Places:
    """Places of joints with a set of forces each: a cone, or a disc across the normal.

    Attributes:
        jump: Rows of w along (n, t) of each place, of a disc along t alone. The shape is
            (num_places · components, num_motions).
        size: μ of each cone, or the radius of each disc (force), shape (num_places,).
        cone: Whether they are cones.
        components: Components of a force.
    """

    jump: csr_array
    size: Floats
    cone: bool
    components: int

    @property
    def count(self) -> int:
        """How many places there are."""
        return len(self.size)

    @property
    def across(self) -> int:
        """Components along the joint."""
        return self.components - self.cone

    def jumps(self, motion: Floats) -> Floats:
        """Return the jumps of a motion, shape (num_places, components)."""
        return np.asarray(self.jump @ motion, dtype=np.float64).reshape(-1, self.components)


@dataclass(frozen=True, eq=False)
class JointProgram:
    """Joints and loads of blocks, in units of their own.

    Attributes:
        cones: Places where forces push and rub.
        discs: Those where adhesive tractions act, in the middle of what they stand for.
        outer_discs: The same at vertices, where the dissipation is no less than in between.
        sought: Work of the loads whose factor is sought on each unknown motion, (num_motions,).
        constant: That of loads that stay.
        others: That of loads of any factor.
        most: The largest λ that forces are sought for. It is finite where joints may carry the
            loads at any factor, and forces for one factor are to prove that they carry them.
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
    """The best forces.

    Attributes:
        outcome: Whether there are any.
        value: λ.
        aside: Factor of the loads of any factor.
        cones: Forces of cones, shape (num_cones, d).
        discs: Those of discs, shape (num_discs, d − 1).
    """

    outcome: Outcome
    value: float
    aside: float
    cones: Floats
    discs: Floats


@dataclass(frozen=True, eq=False)
class BlockMotion:
    """The best motion.

    Attributes:
        outcome: Whether there is any.
        value: λ.
        motion: Unknown motions v with L₁(v) = 1, shape (num_motions,).
    """

    outcome: Outcome
    value: float
    motion: Floats


@dataclass
class _Edges:
    """Edges of polygons in the place of discs of radius 1.

    Attributes:
        of: The place of each edge.
        angle: Its direction; in the plane 0 or π.
    """

    of: Longs
    angle: Floats

    @classmethod
    def first(cls, places: Places) -> "_Edges":
        """Return those to begin with."""
        rubs = np.flatnonzero(places.size > 0)
        count = 2 if places.across == 1 else FIRST_EDGES
        angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return cls(np.repeat(rubs, count), np.tile(angles, len(rubs)))

    def add(self, of: Longs, angle: Floats) -> int:
        """Add directions that are new; return how many."""
        angle = np.mod(angle, 2 * np.pi)
        near = 1e-7  # parts of a turn by which angles that are the same differ at most
        keys, wanted = (np.sort(self.of + self.angle / (2 * np.pi)), of + angle / (2 * np.pi))
        after = np.searchsorted(keys, wanted)
        keys = np.concatenate([[-np.inf], keys, [np.inf]])
        fresh = np.minimum(wanted - keys[after], keys[after + 1] - wanted) > near
        self.of = np.append(self.of, of[fresh])
        self.angle = np.append(self.angle, angle[fresh])
        return int(fresh.sum())

    def inside(self, places: Places) -> tuple[Longs, Floats]:
        """Return place and direction of the corners of polygons inside of discs."""
        return self.of, _directions(self.angle, places.across)

    def outside(self, places: Places) -> tuple[Longs, Floats]:
        """Return the same of polygons around them, whose sides touch them at the edges."""
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
    """Find the best forces of one program and the best motion of another.

    Args:
        inner: With the joints that forces have.
        outer: With those that motions have, at the same places, where these rub no less.
        rtol: How far both may be from the best of round cones, relative.

    Returns:
        Both, and the number of linear programs.
    """
    forces, rounds = _sharpened(inner, rtol, inside=True)
    motion, more = _sharpened(outer, rtol, inside=False)
    assert isinstance(forces, JointForces)
    assert isinstance(motion, BlockMotion)
    return forces, motion, rounds + more


def inner_forces(program: JointProgram, best: JointForces) -> JointForces | None:
    """Return forces inside of the limits, with loads at a factor near the best; None without any.

    A linear program makes a sum of their distances from the sides of the cones large. The first
    tenth of each distance counts ten times. Adhesive tractions use half of the adhesion.

    Args:
        program: With the joints of the forces.
        best: Its solution.
    """
    every = (program.cones, program.discs)
    generators = [_generators(of, _Edges.first(of), True) for of in every]
    blocks = [_columns(*pair) for pair in zip(every, generators, strict=True)]
    loads = np.column_stack([program.sought, program.others])[:, : 1 + program.others.any()]
    of_cones, of_discs = (of[0] for of in generators)
    count = program.cones.count
    sums = coo_array((np.ones(len(of_cones)), (np.arange(len(of_cones)), of_cones)))
    sums.resize((len(of_cones), count))
    steps = 10.0 ** -np.arange(INNER_STEPS)  # parts of the loads of 1
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
    """Solve programs of ever more edges, for forces inside of cones or motions outside of them."""
    discs = program.discs if inside else program.outer_discs
    every = (program.cones, discs)
    edges = [_Edges.first(places) for places in every]
    rounds = 0
    while True:
        rounds += 1
        found = _Solved.of(program, every, edges, inside)
        if found.outcome is not Outcome.FOUND or rounds == MOST_ROUNDS:
            break
        # Forces and jumps that leave a round cone by less, relative to the largest, may do so.
        close = 0.01 * rtol
        if not found.sharpen(every, edges, inside, close):
            break
    return (found.forces(every) if inside else found.block_motion(every)), rounds


@dataclass(eq=False)
class _Solved:
    """A linear program that was solved, or not.

    Attributes:
        outcome: Whether it was.
        value: λ.
        columns: Work of a unit of each force on the unknown motions, (num_motions, num_columns).
        generators: These forces: place and components, of cones and of discs.
        sizes: How much there is of each, shape (num_columns,).
        aside: Factor of the loads of any factor.
        motion: The motion that belongs to it.
        program: The program that was solved.
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
        """Solve one."""
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
        if len(of_discs):  # what corners of a polygon add up to is at most 1
            at = blocks[0].shape[1] + np.arange(len(of_discs))
            ones = np.ones(len(of_discs))
            budget = coo_array((ones, (of_discs, at)), shape=(every[1].count, total)).tocsr()
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
        """Add the edges that the other side asks for; return how many.

        Args:
            every: Cones and discs.
            edges: Of them.
            inside: Whether these are inside of them.
            close: What may leave a round cone, relative to the largest.
        """
        added = 0
        parts = self.parts(every)
        for places, mine, part in zip(every, edges, parts, strict=True):
            if places.across == 1 or not len(mine.of):
                continue
            if inside:  # of forces against the slip
                jump = places.jumps(self.motion)
                slip = -jump[:, int(places.cone) :]
                off = places.size * np.linalg.norm(slip, axis=1)
                off = off + jump[:, 0] if places.cone else off
                weight = np.linalg.norm(jump, axis=1)
            else:  # of sides that cut off what is beyond the round cone
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
        """Return the forces of all places, of cones and of discs."""
        found, first = list[Floats](), 0
        for places, (of, vectors) in zip(every, self.generators, strict=True):
            sizes = self.sizes[first : first + len(of)]
            first += len(of)
            total = np.zeros((places.count, places.components))
            np.add.at(total, of, vectors * sizes[:, None])
            found.append(total)
        return found

    def forces(self, every: tuple[Places, ...]) -> JointForces:
        """Return the forces of a program inside of cones."""
        return JointForces(self.outcome, self.value, self.aside, *self.parts(every))

    def block_motion(self, every: tuple[Places, ...]) -> BlockMotion:
        """Return the motion of a program around cones, with its dissipation in round cones."""
        if self.outcome is not Outcome.FOUND:
            return BlockMotion(self.outcome, np.nan, self.motion)
        motion, program = self._admissible(every), self.program
        discs = every[1]
        dissipation = float(discs.size @ np.linalg.norm(discs.jumps(motion), axis=1))
        work = float(program.sought @ motion)
        value = (dissipation - float(program.constant @ motion)) / work
        return BlockMotion(self.outcome, value, np.asarray(motion / work, dtype=np.float64))

    def _admissible(self, every: tuple[Places, ...]) -> Floats:
        """Return the motion with what is rounding in its conditions removed."""
        program, count = self.program, len(self.generators[0][0])
        power = np.asarray(self.columns[:, :count].T @ self.motion)
        scale = np.abs(self.columns[:, :count]).T @ np.abs(self.motion)
        # Powers that are less, relative to their parts, are those of forces that do no work.
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
    """Return the forces whose sums a set has: place of each, and components."""
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
    """Return the work of forces on the unknown motions, shape (num_motions, num_forces)."""
    of, vectors = generators
    number = np.repeat(np.arange(len(of)), places.components)
    row = (of[:, None] * places.components + np.arange(places.components)).ravel()
    shape = (len(of), places.count * places.components)
    pick = coo_array((vectors.ravel(), (number, row)), shape=shape).tocsr()
    return (pick @ places.jump).T.tocsr()


def _balanced(columns: csr_array, wanted: Floats, x: Floats, forces: int) -> Floats:
    """Return forces that balance the loads to rounding, from those that do so to a tolerance."""
    used = np.append(x[:forces] > 1e-9 * np.abs(x).max(initial=0.0), np.ones(len(x) - forces, bool))
    some = columns[:, used].toarray()
    found = np.where(used, x, 0.0)
    for _ in range(2):
        off = wanted - columns @ found
        found[used] += np.linalg.lstsq(some, off, rcond=1e-12)[0]
    found[:forces] = np.maximum(found[:forces], 0.0)
    return found
