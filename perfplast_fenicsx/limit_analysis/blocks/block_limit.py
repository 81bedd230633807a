"""Compute the limit load of rigid blocks, with joint forces and a mechanism as proofs."""

from dataclasses import dataclass, replace

from mpi4py import MPI

import numpy as np
from scipy.sparse import coo_array, csr_array

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import on_rank0
from perfplast_fenicsx.limit_analysis.blocks.joint_program import (
    JointForces,
    JointProgram,
    Outcome,
    Places,
    best_of_joints,
    inner_forces,
)
from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import (
    Frames,
    JointFacets,
    RigidBlocks,
    held_directions,
)
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import ContactStrength
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question

NOTHING = 1e-9
"""Load factors below this value count as zero, in units in which the loads have magnitude 1."""

ROUNDING = 1e-15
"""Load factors below this value differ from zero only by rounding, in the same units."""

ENOUGH = 2.0
"""Multiple of the constant loads up to which joint forces are sought if no load grows. If joints
without adhesion carry the loads, they also carry any multiple of the loads."""


@dataclass(frozen=True, eq=False)
class FoundForces:
    """Joint forces that balance the loads.

    Attributes:
        factor: Load factor λ.
        aside: Factor of the free loads.
        forces: Forces on the blocks at the vertices of the owned exterior facets, shape (num_outer,
            d, d).
        tractions: Adhesive tractions at the same vertices, interpolated linearly between them.
    """

    factor: float
    aside: float
    forces: Floats
    tractions: Floats


@dataclass(frozen=True, eq=False)
class BlockLimit:
    """The joint forces with the largest load factor, and the motion with the smallest bound.

    All ranks have the same data, except for arrays by facet.

    Attributes:
        lower: Outcome of the search for forces, and the load factor λ of the forces.
        upper: Outcome of the search for a motion, and the upper bound on λ from the motion.
        best: The forces with the largest λ.
        inner: Forces strictly inside the friction cones, at the λ of ``best`` or a smaller λ; None
            if no such forces were found.
        motion: Motion of each block, shape (num_blocks · modes,), with L₁(v) = 1.
        programs: Number of linear programs that were solved.
        resists: Whether there are constant loads or adhesion, or λ is positive or unknown.
    """

    lower: tuple[Outcome, float]
    upper: tuple[Outcome, float]
    best: FoundForces
    inner: FoundForces | None
    motion: Floats
    programs: int
    resists: bool


def block_limit(
    comm: MPI.Intracomm, blocks: RigidBlocks, question: Question, rtol: float
) -> BlockLimit:
    """Return the joint forces and the mechanism that bound the limit load best. Collective.

    Args:
        comm: The ranks.
        blocks: The blocks.
        question: The loads that the bounded factor multiplies.
        rtol: Permitted relative distance of each bound from the best bound of its kind.
    """
    solved = on_rank0(comm, lambda: _solve(blocks, question, rtol))
    rows = comm.scatter(None if solved is None else solved.by_rank(comm.size), root=0)
    sets, motion, limits = comm.bcast(None if solved is None else solved.shared, root=0)
    every = [_on_facets(blocks, *both) for both in zip(sets, rows, strict=True)]
    lower, upper, programs, resists = limits
    inner = every[1] if len(every) > 1 else None
    return BlockLimit(lower, upper, every[0], inner, motion, programs, resists)


def _on_facets(
    blocks: RigidBlocks,
    of: tuple[float, float, Floats],
    rows: tuple[Longs, Floats, Floats],
) -> FoundForces:
    """Return the forces on the exterior facets that this rank owns.

    Args:
        blocks: The blocks.
        of: Load factor λ, the factor of the free loads, and the support reactions of the blocks.
        rows: Facets, forces and tractions of the joints.
    """
    (factor, aside, reactions), (places, on_joints, along_joints) = of, rows
    d = blocks.corners.shape[2]
    forces, tractions = np.zeros((2, *blocks.corners.shape))
    np.add.at(forces, places, on_joints)
    np.add.at(tractions, places, along_joints)
    held = held_directions(blocks.body)
    for vertex in range(d):
        moved = (
            blocks.frames.at(blocks.of_outer, blocks.corners[:, vertex])
            @ reactions.reshape(blocks.count, -1)[blocks.of_outer][..., None]
        )
        forces[:, vertex] += np.einsum("fki,fkj,fjl->fi", held, held, moved)
    return FoundForces(factor, aside, forces, tractions)


@dataclass(frozen=True, eq=False)
class _OnJoints:
    """Joint forces, on rank 0.

    Attributes:
        factor: Load factor λ.
        aside: Factor of the free loads.
        forces: Forces at the vertices of facets on the first side, shape (n, d, d).
        tractions: Adhesive tractions at the same vertices.
        reactions: Forces of the supports on the blocks.
    """

    factor: float
    aside: float
    forces: Floats
    tractions: Floats
    reactions: Floats


@dataclass(frozen=True, eq=False)
class _Solution:
    """The solution on rank 0.

    Attributes:
        facets: Facets of joints.
        sets: The best forces, and forces strictly inside the cones if they were found.
        motion: Rigid motions of the blocks.
        limits: Outcomes and values of both searches, the number of programs, and ``resists``.
    """

    facets: JointFacets
    sets: list[_OnJoints]
    motion: Floats
    limits: tuple

    @property
    def shared(self) -> tuple[list[tuple[float, float, Floats]], Floats, tuple]:
        """Return the data that all ranks receive."""
        return [(of.factor, of.aside, of.reactions) for of in self.sets], self.motion, self.limits

    def by_rank(self, count: int) -> list[list[tuple[Longs, Floats, Floats]]]:
        """Return each rank's facets, forces and tractions on both sides, for each set of forces."""
        facets, back = self.facets, np.argsort(self.facets.order, axis=1)[..., None]
        two = ~facets.alone
        rank, place = (
            np.append(facets.rows[name], facets.others[name][two]) for name in ("rank", "place")
        )
        found: list[list[tuple[Longs, Floats, Floats]]] = [[] for _ in range(count)]
        for of in self.sets:
            forces, tractions = (
                np.append(one, -np.take_along_axis(one, back, axis=1)[two], axis=0)
                for one in (of.forces, of.tractions)
            )
            for number, rows in enumerate(found):
                mine = np.flatnonzero(rank == number)
                rows.append((place[mine], forces[mine], tractions[mine]))
        return found


@dataclass(frozen=True, eq=False)
class _Jumps:
    """Matrices that map motions of blocks to velocity jumps at joints.

    Attributes:
        axes: Orthonormal axes of each facet, with the normal first, shape (n, d, d).
        vertices: Matrix that maps motions to the jumps along the axes at all vertices, shape (n · d
            · d, blocks · modes).
        middles: Matrix that maps motions to the jumps at the points of adhesive tractions.
        kept: Index of one vertex from each set of coinciding vertices with the same normal.
    """

    axes: Floats
    vertices: csr_array
    middles: csr_array
    kept: Longs


def _solve(blocks: RigidBlocks, question: Question, rtol: float) -> _Solution:
    """Create and solve the linear programs on rank 0, and return the solution."""
    facets = blocks.facets
    assert facets is not None
    none = np.zeros_like(blocks.live)
    limit = question is Question.LIMIT
    every = (blocks.live, blocks.dead, none) if limit else (blocks.dead, none, blocks.live)
    sought, constant, others = every
    strengths = [it.strength for it in blocks.body.interfaces]
    number, d = facets.rows["interface"], blocks.corners.shape[2]
    adhesion = np.array([it.adhesion for it in strengths])[number]
    radius = np.repeat(adhesion * facets.rows["area"] / d, d)
    most = [float(np.abs(of).max(initial=0.0)) for of in every]
    unit = max(most[1], float(radius.sum())) or most[0] or 1.0
    scales = [most[0] or 1.0, unit, most[2] or 1.0]
    times = unit / scales[0]
    loads = [
        np.asarray(blocks.free.T @ of / by, dtype=np.float64)
        for of, by in zip(every, scales, strict=True)
    ]
    jumps, free = _jumps(facets, blocks.frames, blocks.count), csr_array(blocks.free)
    sticky = np.flatnonzero(radius > 0)
    kept = 1 - 1e-9  # fraction of the adhesion that forces may use, to allow for solver tolerances
    discs = [
        Places(
            jump=_some(of, sticky, d)[_across(len(sticky), d)] @ free,
            size=np.asarray(share * radius[sticky] / unit, dtype=np.float64),
            cone=False,
            components=d - 1,
        )
        for of, share in ((jumps.middles, kept), (jumps.vertices, 1.0))
    ]
    cones = _some(jumps.vertices, jumps.kept, d)
    programs = [
        JointProgram(
            cones=Places(cones @ free, np.repeat(frictions[number], d)[jumps.kept], True, d),
            discs=discs[0],
            outer_discs=discs[1],
            sought=loads[0],
            constant=loads[1],
            others=loads[2],
            most=np.inf if limit else ENOUGH / times,
        )
        for frictions in (_frictions(strengths, False), _frictions(strengths, True))
    ]
    low, high, count = best_of_joints(programs[0], programs[1], rtol)
    if low.outcome is Outcome.FOUND and not most[1] and low.value <= NOTHING:
        low = replace(low, value=0.0, aside=0.0, cones=0 * low.cones, discs=0 * low.discs)
    if low.outcome is Outcome.FOUND and abs(low.value) <= ROUNDING:
        low = replace(low, value=0.0)
    if high.outcome is Outcome.FOUND and not most[1] and -NOTHING <= high.value < 0:
        high = replace(high, value=0.0)  # without constant loads, blocks carry the factor 0
    inner = None
    if low.outcome is Outcome.FOUND and low.cones.any():
        inner = inner_forces(programs[0], low)
    motion: Floats = np.asarray(blocks.free @ high.motion / scales[0], dtype=np.float64)
    limits = (
        (low.outcome, low.value * times),
        (high.outcome, high.value * times),
        count,
        bool(most[1] or radius.any() or not low.value <= NOTHING),
    )
    placed = _Placed(blocks, facets, jumps, sticky, (unit, *scales), (sought, constant, others))
    sets = [placed.of(forces) for forces in (low, inner) if forces is not None]
    return _Solution(facets, sets, motion, limits)


@dataclass(frozen=True, eq=False)
class _Placed:
    """Convert the forces of a linear program to forces on joint facets, in the problem's units.

    Attributes:
        blocks: The blocks.
        facets: Facets of joints.
        jumps: Velocity jumps at the vertices of these facets.
        sticky: Points at which adhesive tractions act.
        units: Unit of forces, and unit of each kind of load.
        loads: Loads of each kind: with the unknown factor, constant, and free.
    """

    blocks: RigidBlocks
    facets: JointFacets
    jumps: _Jumps
    sticky: Longs
    units: tuple[float, ...]
    loads: tuple[Floats, Floats, Floats]

    def of(self, given: JointForces) -> _OnJoints:
        """Return the forces of a solution on joint facets, with the reactions of the supports."""
        facets, jumps, sticky = self.facets, self.jumps, self.sticky
        d, unit = self.blocks.corners.shape[2], self.units[0]
        shape = (len(facets.rows), d, d)
        forces: Floats = np.zeros((shape[0] * d, d))
        tractions: Floats = np.zeros((shape[0] * d, d))
        if given.outcome is not Outcome.FOUND:
            none = np.zeros(len(self.blocks.free))
            return _OnJoints(
                given.value, 0.0, forces.reshape(shape), tractions.reshape(shape), none
            )
        forces[jumps.kept] = given.cones * unit
        along = given.discs * unit
        axes = np.repeat(jumps.axes, d, axis=0)
        acts = _some(jumps.vertices, jumps.kept, d).T @ given.cones.ravel() * unit
        if len(sticky):
            rows = _some(jumps.middles, sticky, d)[_across(len(sticky), d)]
            acts = acts + rows.T @ along.ravel()
        share = np.repeat(facets.rows["area"], d)[sticky, None] / d
        tractions[sticky] = np.einsum("nk,nki->ni", along / share, axes[sticky, 1:])
        forces = np.einsum("nk,nki->ni", forces, axes)
        value, aside = (
            of * unit / by
            for of, by in ((given.value, self.units[1]), (given.aside, self.units[3]))
        )
        sought, constant, others = self.loads
        reactions = _reactions(self.blocks.gram, acts + value * sought + constant + aside * others)
        return _OnJoints(value, aside, forces.reshape(shape), tractions.reshape(shape), reactions)


def _frictions(strengths: list[ContactStrength], follows: bool) -> Floats:
    """Return the friction coefficients of joints.

    If ``follows`` is false, the coefficient is 0 for joints whose slip is not associated.
    """
    return np.array([it.friction if follows or it.associated else 0.0 for it in strengths])


def _some(rows: csr_array, places: Longs, d: int) -> csr_array:
    """Return the d matrix rows of each given point."""
    return rows[(places[:, None] * d + np.arange(d)).ravel()]


def _across(count: int, d: int) -> Longs:
    """Return the indices of the tangential matrix rows of ``count`` points."""
    return (np.arange(count)[:, None] * d + np.arange(1, d)).ravel()


def _reactions(gram: Floats, forces: Floats) -> Floats:
    """Return the reactions of supports that balance the given forces on the blocks."""
    count, modes = gram.shape[:2]
    inverse = np.linalg.pinv(gram, rcond=1e-12, hermitian=True)
    return -np.einsum("bij,bj->bi", inverse, forces.reshape(count, modes)).ravel()


def _jumps(facets: JointFacets, frames: Frames, count: int) -> _Jumps:
    """Return matrices that map rigid motions to the jumps at the vertices of joints."""
    d, n, modes = facets.into.shape[1], len(facets.rows), frames.modes
    axes = _axes(facets.into)
    one = facets.rows["corners"]
    other = np.take_along_axis(facets.others["corners"], facets.order[..., None], axis=1)
    found = []
    for middle in (False, True):
        parts = []
        for sign, x, rows in ((1.0, one, facets.rows), (-1.0, other, facets.others)):
            at = (x + x.sum(axis=1, keepdims=True)) / (d + 1) if middle else x
            block = np.repeat(rows["block"], d)
            values = frames.at(block, at.reshape(-1, d))
            values = np.einsum("nki,nim->nkm", np.repeat(axes, d, axis=0), values)
            values = sign * values * (~np.repeat(facets.alone, d) | (sign > 0))[:, None, None]
            row = np.broadcast_to(np.arange(n * d * d).reshape(-1, d, 1), values.shape)
            column = (block[:, None] * modes + np.arange(modes))[:, None]
            column = np.broadcast_to(column, values.shape)
            parts.append((values.ravel(), row.ravel(), column.ravel()))
        value, row, column = (np.concatenate(of) for of in zip(*parts, strict=True))
        shape = (n * d * d, count * modes)
        found.append(coo_array((value, (row, column)), shape=shape).tocsr())
    opposite = np.take_along_axis(facets.others["vertices"], facets.order, axis=1)
    same = 1e-9  # Normals whose components differ by less count as equal.
    keys = np.column_stack(
        [
            np.repeat(facets.rows["interface"], d),
            facets.rows["vertices"].ravel(),
            opposite.ravel(),
            np.repeat(np.round(facets.into / same), d, axis=0).astype(np.int64),
        ]
    )
    kept = np.sort(np.unique(keys, axis=0, return_index=True)[1])
    return _Jumps(axes, found[0], found[1], kept)


def _axes(normals: Floats) -> Floats:
    """Return orthonormal axes with the normal first, shape (n, d, d)."""
    d = normals.shape[1]
    if d == 2:
        return np.stack([normals, np.column_stack([-normals[:, 1], normals[:, 0]])], axis=1)
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([normals, first, np.cross(normals, first)], axis=1)
