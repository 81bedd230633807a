"""Compute an upper bound of a mechanism's dissipation by slip, for any slip between nodes.

The jump w of a quadratic velocity has Bernstein coefficients on a facet (:mod:`contact_facets`),
whose polynomials are not negative and add up to 1. So ‖w_t‖ is at most the mean of the
coefficients' norms with these weights. ∫c‖w_t‖ is at most c times the area times their plain mean.
And w lies in the cone w_n ≥ μ‖w_t‖ of associated Coulomb friction if its coefficients do.
"""

import math
from dataclasses import dataclass, field
from itertools import combinations

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags, matrices
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import strength_of
from perfplast_fenicsx.limit_analysis.facets.contact_facets import (
    UNSEEN,
    ContactFacets,
    contact_facets,
    face_jumps,
    flat_faces,
    has_pair,
)
from perfplast_fenicsx.problem.problem import Problem

UNKNOWN = "slip of nodes that supports hold along their normal is not known"

CLOSED = "surfaces with Coulomb's friction slip and separate too little between nodes"


@dataclass(frozen=True)
class SlipWork:
    """The work of slip.

    Attributes:
        power: Upper bound of ∫c‖w_t‖, on all ranks together.
        squares: Value of ∫(‖w_t‖/h)² for layers as thick as the size h of a facet: the counterpart
            of ∫‖ε(v)‖² in cells.
        why_not: Reasons why the work may be larger, or the slip wrong, in words.
        shares: Share of the slip at each owned cell's facets in the gap between the velocity and a
            stress, shape (num_cells,): ∫c‖w_t‖ − r·w, half of it on either side; 0 without a
            stress.
    """

    power: float
    squares: float
    why_not: tuple[str, ...]
    shares: Floats = field(repr=False)


def slip_work(problem: Problem, velocity: fem.Function, stress: Floats | None = None) -> SlipWork:
    """Return the dissipation of a velocity by slip. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
        stress: Mandel vectors at the vertices of the owned cells, shape (num_cells, d + 1, m).
    """
    topology = problem.tagged_mesh.mesh.topology
    shares = np.zeros(topology.index_map(topology.dim).size_local)
    strengths = [strength_of(source) for source in problem.constraints.sources]
    flat = flat_faces(problem) is not None
    if not flat or not any(it.adhesion or it.friction for it in strengths):
        return SlipWork(0.0, 0.0, (), shares)
    comm = problem.comm
    facets = contact_facets(problem)
    nodes, gdim = facets.nodes, facets.normals.shape[1]
    constraints = problem.constraints
    moves = ~has_pair(problem) & ~problem.fixed.all(axis=1)
    unknown = bool(moves[nodes[_that_rub(problem, facets)]].any())
    sums, lacking = np.zeros(2), 0.0
    for face in face_jumps(problem, velocity):
        strength = strengths[face.source]
        if not (strength.adhesion or strength.friction):
            continue
        unknown |= bool(face.moves[nodes[face.here]].any())
        sides = 2 if constraints.sources[face.source].inner else 1
        mine = facets.areas > 0
        owned, sizes = np.flatnonzero(face.here & mine), face.across[mine[face.here]]
        area, at = facets.areas[owned] / sides, nodes[owned]
        lost = strength.adhesion * area * sizes.mean(axis=1)
        layers = area * facets.areas[owned] ** (-1 / (gdim - 1))
        sums += lost.sum(), layers @ (sizes**2).mean(axis=1)
        if stress is not None:
            cells, out = facets.cells[owned], facets.normals[owned]
            around = _others(gdim)[facets.sides[owned]]
            tractions = (
                matrices(stress[cells[:, None], around])[..., :gdim, :gdim] @ out[:, None, :, None]
            )
            towards = np.sign(out @ face.normal)
            order = np.concatenate(
                [np.tile(np.arange(gdim), (len(at), 1)), facets.middles[owned]], axis=1
            )
            there = face.w[np.take_along_axis(at, order.astype(np.int64), axis=1)]
            means = np.einsum("fai,an,fni->f", tractions[..., 0], _means(at.shape[1], gdim), there)
            np.add.at(shares, cells, lost + towards * area * means)
        if strength.friction:
            lacking = max(lacking, face.entered(strength.friction))
    why = {
        UNKNOWN: comm.allreduce(unknown, MPI.LOR),
        CLOSED: comm.allreduce(lacking, MPI.MAX) > UNSEEN,
    }
    found = tuple(words for words, is_so in why.items() if is_so)
    power, squares = comm.allreduce(sums)
    return SlipWork(float(power), float(squares), found, shares)


def _that_rub(problem: Problem, facets: ContactFacets) -> PairFlags:
    """Return flags of the facets of surfaces with friction."""
    names = {
        name
        for contact in problem.given.contacts
        if contact.rubs
        for name in (contact.primary, contact.secondary)
    }
    names |= {obstacle.on for obstacle in problem.given.obstacles if obstacle.rubs}
    rubs: PairFlags = np.isin(facets.tags, problem.tagged_mesh.tags_of(names))
    return rubs


def _others(gdim: int) -> Ints:
    """Return the vertices of the facet opposite each vertex."""
    every = range(gdim + 1)
    return np.array([[b for b in every if b != a] for a in every])


def _means(num_nodes: int, gdim: int) -> Floats:
    """Return the means over a facet of linear functions times Bernstein's polynomials.

    Args:
        num_nodes: Number of nodes of a facet, and of polynomials: those of its vertices, and those
            of pairs.
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
