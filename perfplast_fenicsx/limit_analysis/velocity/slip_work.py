"""What a mechanism dissipates where surfaces rub, from above, whatever its slip is between nodes.

The jump w of a quadratic velocity has Bernstein coefficients on a facet (:mod:`entering`), whose
polynomials are not negative and add up to 1. So ‖w_t‖ is at most the mean of the coefficients'
norms with these weights, and ∫c‖w_t‖ at most c times the area times their plain mean. And w keeps
to the cone w_n ≥ μ‖w_t‖ of Coulomb's friction that follows its normal if its coefficients do.
"""

import math
from dataclasses import dataclass, field
from itertools import combinations

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.limit_analysis.facets.contact_facets import ContactFacets, contact_facets
from perfplast_fenicsx.limit_analysis.facets.contact_strength import strength_of
from perfplast_fenicsx.limit_analysis.facets.entering import (
    ROUNDING,
    SAME,
    at_nodes,
    flat_faces,
    rows_of,
)
from perfplast_fenicsx.mandel_arrays import matrices
from perfplast_fenicsx.problem.problem import Problem

UNKNOWN = "slip of nodes that supports hold along their normal is not known"

CLOSED = "surfaces with Coulomb's friction slip and do not part by enough between nodes"


@dataclass(frozen=True)
class SlipWork:
    """What slip does.

    Attributes:
        power: ∫c‖w_t‖ from above, on all ranks together.
        squares: ∫(‖w_t‖/h)² of layers that are as thick as a facet is long, h: what ∫‖ε(v)‖² is of
            cells.
        why_not: Why it may be more, or the slip wrong, in words.
        shares: What the slip at the facets of each owned cell has of the gap between the velocity
            and a stress, ∫c‖w_t‖ − r·w, half of it at either side; 0 without a stress. Shape
            (num_cells,).
    """

    power: float
    squares: float
    why_not: tuple[str, ...]
    shares: Floats = field(repr=False)


def slip_work(problem: Problem, velocity: fem.Function, stress: Floats | None = None) -> SlipWork:
    """What a velocity dissipates by slip. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Its ghosts up to date.
        stress: Mandel vectors at the vertices of the owned cells, shape (num_cells, d + 1, m).
    """
    topology = problem.tagged_mesh.mesh.topology
    shares = np.zeros(topology.index_map(topology.dim).size_local)
    strengths = [strength_of(source) for source in problem.constraints.sources]
    faces = flat_faces(problem)
    if faces is None or not any(it.adhesion or it.friction for it in strengths):
        return SlipWork(0.0, 0.0, (), shares)
    comm = problem.comm
    facets = contact_facets(problem)
    nodes, gdim = facets.nodes, facets.normals.shape[1]
    constraints = problem.constraints
    _, paired = at_nodes(
        problem, np.zeros(len(constraints.host)), np.ones(len(constraints.host), dtype=bool)
    )
    jumps = _jump_vectors(problem, velocity)
    moves = ~paired & ~problem.fixed.all(axis=1)
    unknown = bool(moves[nodes[_that_rub(problem, facets)]].any())
    sums, lacking = np.zeros(2), 0.0
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
            middle, *ends = facets.edges(here).T
            w[middle] = 2 * w[middle] - (w[ends[0]] + w[ends[1]]) / 2
        enters = w @ normal
        sizes = np.linalg.norm(w - enters[:, None] * normal, axis=1)
        sides = 2 if constraints.sources[int(face[0])].inner else 1
        owned = np.flatnonzero(here & (facets.areas > 0))
        area, at = facets.areas[owned] / sides, nodes[owned]
        lost = strength.adhesion * area * sizes[at].mean(axis=1)
        layers = area * facets.areas[owned] ** (-1 / (gdim - 1))
        sums += lost.sum(), layers @ (sizes[at] ** 2).mean(axis=1)
        if stress is not None:
            cells, out = facets.cells[owned], facets.normals[owned]
            around = _others(gdim)[facets.sides[owned]]
            tractions = (
                matrices(stress[cells[:, None], around])[..., :gdim, :gdim] @ out[:, None, :, None]
            )
            towards = np.sign(out @ normal)
            order = np.concatenate(
                [np.tile(np.arange(gdim), (len(at), 1)), facets.middles[owned]], axis=1
            )
            there = w[np.take_along_axis(at, order.astype(np.int64), axis=1)]
            means = np.einsum("fai,an,fni->f", tractions[..., 0], _means(at.shape[1], gdim), there)
            np.add.at(shares, cells, lost + towards * area * means)
        if strength.friction:
            short = (strength.friction * sizes + enters)[nodes[here]]
            lacking = max(lacking, float(short.max(initial=0.0)))
    largest = comm.allreduce(float(np.abs(velocity.x.array).max(initial=0)), MPI.MAX)
    why = {
        UNKNOWN: comm.allreduce(unknown, MPI.LOR),
        CLOSED: comm.allreduce(lacking, MPI.MAX) > ROUNDING * largest,
    }
    found = tuple(words for words, is_so in why.items() if is_so)
    power, squares = comm.allreduce(sums)
    return SlipWork(float(power), float(squares), found, shares)


def _that_rub(problem: Problem, facets: ContactFacets) -> PairFlags:
    """Facets of surfaces that rub."""
    names = {
        name
        for contact in problem.given.contacts
        if contact.rubs
        for name in (contact.primary, contact.secondary)
    }
    names |= {obstacle.on for obstacle in problem.given.obstacles if obstacle.rubs}
    tags = [problem.tagged_mesh.surfaces[name] for name in names]
    rubs: PairFlags = np.isin(facets.tags, tags)
    return rubs


def _others(gdim: int) -> Ints:
    """Vertices of the facet opposite each."""
    every = range(gdim + 1)
    return np.array([[b for b in every if b != a] for a in every])


def _means(num_nodes: int, gdim: int) -> Floats:
    """Means over a facet of linear functions times Bernstein's polynomials.

    Args:
        num_nodes: Of a facet, as many as polynomials: those at its vertices, and those of pairs.
        gdim: Number of its vertices.

    Returns:
        Shape (gdim, num_nodes).
    """
    quadratic = num_nodes > gdim
    groups = [(a, a) if quadratic else (a,) for a in range(gdim)]
    groups += list(combinations(range(gdim), 2)) if quadratic else []
    found = np.zeros((gdim, num_nodes))
    for a in range(gdim):
        for column, group in enumerate(groups):
            factors = [a, *group]
            count = [factors.count(i) for i in range(gdim)]
            ways = math.prod(math.factorial(i) for i in count)
            share = ways * math.factorial(gdim - 1) / math.factorial(gdim - 1 + len(factors))
            found[a, column] = share * (2 if len(set(group)) > 1 else 1)
    return found


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
