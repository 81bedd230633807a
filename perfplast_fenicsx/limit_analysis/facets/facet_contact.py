"""Formulate contact on facets, so that mechanisms penetrate no facet of a curved surface.

Nodes of curved surfaces have an averaged normal. A velocity that satisfies it penetrates facets
beside the node. Here a pair of nodes has a cone of at most d directions around the normals of all
its facets (:mod:`enclosing_cones`), and at midsides Bernstein's coefficient of the jump has it. So
no facet is penetrated anywhere. If that would take more unknowns than nodes have, as where three
bodies meet, their nodes move together. This reduces the number of mechanisms, but the least load of
any mechanism remains an upper bound.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints, stacked
from perfplast_fenicsx.contact.rows.jump_basis import make_basis
from perfplast_fenicsx.contact.surfaces.surface_facets import LEAST_COSINE
from perfplast_fenicsx.limit_analysis.facets.enclosing_cones import enclosing_cones
from perfplast_fenicsx.limit_analysis.facets.facing_nodes import FacingNodes, facing_nodes, owners
from perfplast_fenicsx.limit_analysis.facets.matched_facets import matched_facets
from perfplast_fenicsx.parallel import send_rows
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

Flags = npt.NDArray[np.bool_]


def with_facet_contact(problem: Problem) -> Problem | None:
    """Return the same problem with mechanisms that penetrate no facet. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.

    Returns:
        A problem that shares all but contact with the given one; None with obstacles, friction,
        ties, or facets that do not match.
    """
    others = problem.given.obstacles or problem.friction.count or problem.num_tied
    matched = None if others or problem.constraints.in_mean else matched_facets(problem)
    if matched is None:
        return None
    pairs = facing_nodes(problem, matched)
    vectors, count = enclosing_cones(pairs.normals, pairs.known)
    free = ~pairs.held
    hosts = (free.sum(axis=2)[:, 1] > free.sum(axis=2)[:, 0]).astype(np.int64)
    every = np.arange(len(pairs))
    lacks = (free[every, 1 - hosts] & ~free[every, hosts]).any(axis=1)
    glued = (count < 0) | ((count > 1) & (pairs.crowded | lacks))
    one = (count == 1) & ~glued
    touching = _rows(problem, pairs, vectors, count, hosts, glued, one)
    if touching is None:
        return None
    contact, ties = touching
    rows = stacked(problem.V, [contact, ties])
    basis = make_basis(problem.V, rows, problem.fixed, len(ties.host))
    found = variant(problem, rows=(contact, problem.sliding), basis=basis)
    found.num_tied = problem.comm.allreduce(len(ties.host))
    return found


def _rows(
    problem: Problem,
    pairs: FacingNodes,
    vectors: Floats,
    count: Ints,
    hosts: Longs,
    glued: Flags,
    one: Flags,
) -> tuple[Constraints, Constraints] | None:
    """Return rows of pairs that may separate, and of nodes that are glued. Collective."""
    comm = problem.comm
    knots = _knots(problem, pairs, glued)
    # pairs within a knot add nothing; pairs at a knot have the other node as host
    place = np.searchsorted(knots.nodes, pairs.nodes)
    inside = np.isin(pairs.nodes, knots.nodes)
    label = np.full(pairs.nodes.shape, -1)
    label[inside] = knots.labels[place[inside]]
    kept = (count > 0) & ~glued & ~(inside.all(axis=1) & (label[:, 0] == label[:, 1]))
    along = np.abs(vectors[:, 0])[:, None] * ~pairs.held
    able = (along.max(axis=2) >= LEAST_COSINE) & ~inside
    hosts = np.where(one & ~able[np.arange(len(pairs)), hosts], 1 - hosts, hosts)
    lost = kept & inside[np.arange(len(pairs)), hosts]
    if comm.allreduce(int(lost.sum())):
        return None
    which = np.repeat(np.flatnonzero(kept), count[kept])
    slot = np.arange(len(which)) - np.repeat(np.cumsum(count[kept]) - count[kept], count[kept])
    gdim = vectors.shape[2]
    rows: npt.NDArray[np.void] = np.zeros(
        len(which),
        dtype=[
            ("host", np.int64),
            ("nodes", np.int64, (3, 2)),
            ("vector", np.float64, gdim),
            ("contact", np.int32),
        ],
    )
    rows["host"] = pairs.nodes[which, hosts[which]]
    rows["nodes"][:, 0], rows["nodes"][:, 1:] = pairs.nodes[which], pairs.ends[which]
    rows["vector"], rows["contact"] = vectors[which, slot], pairs.contact[which]
    rows = send_rows(comm, rows, owners(problem, rows["host"]))
    contact = _contact(problem, rows)
    return contact, _ties(problem, knots)


def _contact(problem: Problem, rows: npt.NDArray[np.void]) -> Constraints:
    """Return rows of jumps along vectors, with Bernstein's coefficients at midsides. Collective."""
    first = problem.V.dofmap.index_map.local_range[0]
    middle = rows["nodes"][:, 1, 0] >= 0
    factors = np.where(middle[:, None], [2.0, -0.5, -0.5], [1.0, 0.0, 0.0])
    row, which = np.nonzero(factors)
    terms = []
    for side, sign in enumerate((1.0, -1.0)):
        coefficients = sign * factors[row, which][:, None] * rows["vector"][row]
        terms.append((row, rows["nodes"][row, which, side], coefficients))
    return make_constraints(
        problem.V,
        (rows["host"] - first).astype(np.int32),
        np.zeros(len(rows)),
        rows["vector"],
        rows["contact"],
        terms,
        sources=problem.constraints.sources,
    )


class _Knots:
    """Groups of nodes that move together.

    Attributes:
        nodes: Global numbers in ascending order, on every rank, shape (n,).
        labels: Labels of their groups, shape (n,).
        held: Flags of components that supports hold, shape (n, d).
    """

    def __init__(self, edges: npt.NDArray[np.void], gdim: int) -> None:
        self.nodes, at = np.unique(edges["nodes"].ravel(), return_inverse=True)
        ends = at.reshape(-1, 2)
        size = len(self.nodes)
        graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
        self.labels = connected_components(graph, directed=False)[1] if size else ends[:, 0]
        self.held = np.zeros((size, gdim), dtype=np.bool_)
        self.held[ends] = edges["held"]


def _knots(problem: Problem, pairs: FacingNodes, glued: Flags) -> _Knots:
    """Join glued pairs to groups, such as those along edges where three bodies meet. Collective."""
    gdim = problem.bodies.gdim
    edge = [("nodes", np.int64, 2), ("held", np.bool_, (2, gdim))]
    mine = np.zeros(int(glued.sum()), dtype=edge)
    mine["nodes"], mine["held"] = pairs.nodes[glued], pairs.held[glued]
    return _Knots(np.concatenate(problem.comm.allgather(mine)), gdim)


def _ties(problem: Problem, knots: _Knots) -> Constraints:
    """Return rows that tie each free component in a group to its root: a held one, or the first."""
    V = problem.V
    first, last = V.dofmap.index_map.local_range
    parts = []
    gdim = problem.bodies.gdim
    size = len(knots.nodes)
    for axis in range(gdim):
        order = np.lexsort((~knots.held[:, axis], knots.labels))
        _, start = np.unique(knots.labels[order], return_index=True)
        roots = order[start][knots.labels] if size else order
        hosting = ~knots.held[:, axis] & (roots != np.arange(size))
        hosting &= (knots.nodes >= first) & (knots.nodes < last)
        host, root = knots.nodes[hosting], knots.nodes[roots[hosting]]
        direction = np.tile(np.eye(gdim)[axis], (len(host), 1))
        every = np.arange(len(host))
        parts.append(
            make_constraints(
                V,
                (host - first).astype(np.int32),
                np.zeros(len(host)),
                direction,
                np.zeros(len(host), dtype=np.int32),
                [(every, host, direction), (every, root, -direction)],
            )
        )
    return stacked(V, parts)
