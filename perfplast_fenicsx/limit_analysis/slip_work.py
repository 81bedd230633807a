"""What a mechanism dissipates where surfaces rub, from above, whatever its slip is between nodes.

The jump w of a quadratic velocity has Bernstein coefficients on a facet (:mod:`entering`), whose
polynomials are not negative and add up to 1. So ‖w_t‖ is at most the mean of the coefficients'
norms with these weights, and ∫c‖w_t‖ at most c times the area times their plain mean. And w keeps
to the cone w_n ≥ μ‖w_t‖ of Coulomb's friction that follows its normal if its coefficients do.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.contact_strength import strength_of
from perfplast_fenicsx.limit_analysis.entering import (
    ROUNDING,
    SAME,
    at_nodes,
    contact_facets,
    edges_of,
    flat_faces,
    rows_of,
)
from perfplast_fenicsx.problem.problem import Problem

UNKNOWN = "slip of nodes that supports hold along their normal is not known"

CLOSED = "surfaces with Coulomb's friction slip and do not part by enough between nodes"


@dataclass(frozen=True)
class SlipWork:
    """What slip does.

    Attributes:
        power: ∫c‖w_t‖ from above, on all ranks together.
        why_not: Why it may be more, or the slip wrong, in words.
    """

    power: float
    why_not: tuple[str, ...]


def slip_work(problem: Problem, velocity: fem.Function) -> SlipWork:
    """What a velocity dissipates by slip. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Its ghosts up to date.
    """
    strengths = [strength_of(source) for source in problem.constraints.sources]
    faces = flat_faces(problem)
    if faces is None or not any(it.adhesion or it.friction for it in strengths):
        return SlipWork(0.0, ())
    comm = problem.comm
    nodes, areas = contact_facets(problem)
    constraints = problem.constraints
    _, paired = at_nodes(
        problem, np.zeros(len(constraints.host)), np.ones(len(constraints.host), dtype=bool)
    )
    jumps = _jump_vectors(problem, velocity)
    power, lacking, unknown = 0.0, 0.0, False
    for face in faces:
        strength = strengths[int(face[0])]
        if not (strength.adhesion or strength.friction):
            continue
        chosen, normal = rows_of(problem, face), face[1:]
        of = [at_nodes(problem, along, chosen) for along in jumps.T]
        w, known = np.column_stack([values for values, _ in of]), of[0][1]
        kept = ~paired & (problem.fixed | (np.abs(normal) <= SAME)).all(axis=1)
        here = known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
        moves = ~known & ~problem.fixed.all(axis=1)
        unknown |= bool(moves[nodes[here]].any())
        if problem.degree == 2:
            middle, *ends = edges_of(problem, nodes[here]).T
            w[middle] = 2 * w[middle] - (w[ends[0]] + w[ends[1]]) / 2
        enters = w @ normal
        sizes = np.linalg.norm(w - enters[:, None] * normal, axis=1)
        sides = 2 if constraints.sources[int(face[0])].inner else 1
        power += strength.adhesion / sides * float(areas[here] @ sizes[nodes[here]].mean(axis=1))
        if strength.friction:
            short = (strength.friction * sizes + enters)[nodes[here]]
            lacking = max(lacking, float(short.max(initial=0.0)))
    largest = comm.allreduce(float(np.abs(velocity.x.array).max(initial=0)), MPI.MAX)
    why = {
        UNKNOWN: comm.allreduce(unknown, MPI.LOR),
        CLOSED: comm.allreduce(lacking, MPI.MAX) > ROUNDING * largest,
    }
    found = tuple(words for words, is_so in why.items() if is_so)
    return SlipWork(float(comm.allreduce(power)), found)


def _jump_vectors(problem: Problem, velocity: fem.Function) -> Floats:
    """The whole jumps of pairs, shape (num_pairs, gdim); along the normal positive if they enter.

    Collective.
    """
    weights, gdim = problem.constraints.weights, problem.V.dofmap.index_map_bs
    on_nodes, on_rows = weights.createVecs()
    owned = problem.V.dofmap.index_map.size_local
    values = velocity.x.array.reshape(-1, gdim)[:owned]
    jumps = np.zeros((on_rows.getLocalSize(), gdim))
    for axis in range(gdim):
        on_nodes.array[:] = values[:, axis]
        weights.mult(on_nodes, on_rows)
        jumps[:, axis] = on_rows.array_r
    for vector in (on_nodes, on_rows):
        vector.destroy()
    return jumps
