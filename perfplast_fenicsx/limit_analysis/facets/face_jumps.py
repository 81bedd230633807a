"""Evaluate jumps of a velocity on the flat faces of contact, as the checker of a proof does.

The jump w of a quadratic velocity along a fixed normal is quadratic on a facet. Its Bernstein
coefficients are those at the vertices and 2 w_m − (w_a + w_b)/2 at a midside m between a and b.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.limit_analysis.facets.contact_facets import contact_facets
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem

SAME = 1e-9
"""Normals whose components differ by less are equal."""

UNSEEN = 5e-13
"""Penetration, relative to the velocities at a facet, that is allowed: half of the checker's limit.
"""


@dataclass(frozen=True, eq=False)
class FaceJumps:
    """The jump of a velocity on the facets of one flat face.

    Attributes:
        source: Number of the contact or obstacle among the sources of constraints.
        normal: Normal of its pairs, shape (d,); a jump along it is positive where bodies penetrate.
        here: Flags of the contact facets (:func:`contact_facets.contact_facets`) on the face.
        moves: Flags of local nodes without a pair of this face that supports do not hold
            completely.
        w: Bernstein's coefficients of the jump at local nodes, shape (num_nodes, d); 0 where
            supports prevent penetration.
        along: Components along the facets' own normals, shape (here.sum(), num_nodes_of_facet).
        across: Norms of the remaining components, same shape.
        speeds: Largest velocity component on each facet and the opposite one, shape (here.sum(),).
    """

    source: int
    normal: Floats
    here: PairFlags
    moves: PairFlags
    w: Floats
    along: Floats
    across: Floats
    speeds: Floats

    def entered(self, friction: float = 0.0) -> float:
        """Return the largest relative penetration here, or lack of separation for the slip.

        Args:
            friction: Coefficient μ of Coulomb's friction with associated slip.
        """
        most = (self.along + friction * self.across).max(axis=1, initial=0.0)
        found = np.divide(most, self.speeds, out=np.zeros_like(most), where=self.speeds > 0)
        return float(found.max(initial=0.0))


def face_jumps(problem: Problem, velocity: fem.Function) -> Iterator[FaceJumps]:
    """Yield the jumps of each face in turn. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
    """
    faces = flat_faces(problem)
    if faces is None or not len(faces):
        return
    facets = contact_facets(problem)
    nodes, fixed = facets.nodes, problem.fixed
    paired, jumps = has_pair(problem), jump_vectors(problem, velocity)
    beside = _speeds_of_pairs(problem, velocity)
    sizes = np.abs(velocity.x.array.reshape(fixed.shape)).max(axis=1, initial=0.0)
    for face in faces:
        chosen, normal = rows_of(problem, face), face[1:]
        of = [at_nodes(problem, values, chosen) for values in (*jumps.T, beside)]
        w, known = np.column_stack([values for values, _ in of[:-1]]), of[0][1]
        kept = ~paired & (fixed | (np.abs(normal) <= SAME)).all(axis=1)
        here = known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
        if problem.degree == 2:
            middle, *ends = facets.edges(here).T
            w[middle] = 2 * w[middle] - (w[ends[0]] + w[ends[1]]) / 2
        own, at = facets.normals[here], w[nodes[here]]
        own = own * np.sign(own @ normal)[:, None]
        along = np.einsum("fni,fi->fn", at, own)
        across = np.linalg.norm(at - along[:, :, None] * own[:, None], axis=2)
        speeds = np.maximum(sizes, of[-1][0])[nodes[here]].max(axis=1, initial=0.0)
        moves = ~known & ~fixed.all(axis=1)
        yield FaceJumps(int(face[0]), normal, here, moves, w, along, across, speeds)


@once_a_problem
def has_pair(problem: Problem) -> PairFlags:
    """Return flags of the local nodes, ghosts too, that have a pair. Collective."""
    every = np.ones(len(problem.constraints.host), dtype=bool)
    return at_nodes(problem, np.zeros(len(every)), every)[1]


def jump_vectors(problem: Problem, velocity: fem.Function) -> Floats:
    """Return the jump vectors of pairs, shape (num_pairs, d). Collective.

    Along the normal, a jump is positive where a pair penetrates.
    """
    weights, gdim = problem.constraints.weights, problem.V.dofmap.index_map_bs
    on_nodes, on_rows = weights.createVecs()
    values = velocity.x.array.reshape(-1, gdim)[: problem.V.dofmap.index_map.size_local]
    jumps = np.zeros((on_rows.getLocalSize(), gdim))
    for axis in range(gdim):
        on_nodes.array[:] = values[:, axis]
        weights.mult(on_nodes, on_rows)
        jumps[:, axis] = on_rows.array_r
    for vector in (on_nodes, on_rows):
        vector.destroy()
    return jumps


def least_speed(problem: Problem, velocity: fem.Function) -> float:
    """Return the least value by which velocities at facets count. Collective.

    Jumps below the rounding of the largest velocity count as zero, however slow a body itself is.
    """
    slowest = 1e-8  # share of the largest velocity, as in the checker of jumps
    mine = float(np.abs(velocity.x.array).max(initial=0.0))
    return slowest * float(problem.comm.allreduce(mine, MPI.MAX))


def _speeds_of_pairs(problem: Problem, velocity: fem.Function) -> Floats:
    """Return the largest velocity component of each pair, shape (num_pairs,). Collective."""
    constraints = problem.constraints
    sizes = np.abs(velocity.x.array.reshape(problem.fixed.shape)).max(axis=1, initial=0.0)
    on_nodes, on_rows = constraints.shares.createVecs()
    on_nodes.array[:] = sizes[: on_nodes.getLocalSize()]
    constraints.shares.mult(on_nodes, on_rows)
    at_host = sizes[constraints.host]
    found = np.maximum(at_host, on_rows.array_r - at_host)
    for vector in (on_nodes, on_rows):
        vector.destroy()
    return np.maximum(found, least_speed(problem, velocity))


@once_a_problem
def flat_faces(problem: Problem) -> Floats | None:
    """Return (number of the contact, normal) of all pairs; None if there are too many. Collective.

    Surfaces with too many different normals are not flat.
    """
    constraints = problem.constraints
    mine = _distinct(np.column_stack([constraints.surface, constraints.normal]))
    most_faces = 64  # directions of contact beyond which surfaces count as curved
    faces = _distinct(np.concatenate(problem.comm.allgather(mine[: most_faces + 1])))
    return faces if len(faces) <= most_faces else None


def rows_of(problem: Problem, face: Floats) -> PairFlags:
    """Return flags of the pairs of a flat face."""
    rows = np.column_stack([problem.constraints.surface, problem.constraints.normal])
    return np.asarray((np.abs(rows - face) <= SAME).all(axis=1))


def _distinct(rows: Floats) -> Floats:
    """Return one row of each set of rows that are equal to rounding."""
    _, first = np.unique(np.round(rows / SAME / 100), axis=0, return_index=True)
    return rows[first]


def at_nodes(problem: Problem, jumps: Floats, chosen: PairFlags) -> tuple[Floats, PairFlags]:
    """Return jumps of chosen pairs at all their nodes, and flags of these nodes. Collective.

    Returns:
        Values for each local node, ghosts too; 0 and False at other nodes.
    """
    shares = problem.constraints.shares
    on_nodes, on_rows = shares.createVecs()

    def summed(values: Floats) -> Floats:
        on_rows.array[:] = values
        shares.multTranspose(on_rows, on_nodes)
        sums = la.vector(problem.V.dofmap.index_map, 1)
        sums.array[: on_nodes.getLocalSize()] = on_nodes.array_r
        sums.scatter_forward()
        return np.array(sums.array, dtype=np.float64)

    jump, weight = summed(np.where(chosen, jumps, 0.0)), summed(chosen.astype(np.float64))
    for thing in (on_nodes, on_rows):
        thing.destroy()
    known: PairFlags = weight > 0
    jump[known] /= weight[known]
    return jump, known
