"""Collect nodes that face each other in contact, with the normals of all facets around them."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.facets.matched_facets import MatchedFacets
from perfplast_fenicsx.parallel import Exchange, send_rows
from perfplast_fenicsx.problem.problem import Problem

Flags = npt.NDArray[np.bool_]

Record = npt.NDArray[np.void]


@dataclass(frozen=True, eq=False)
class FacingNodes:
    """Pairs of nodes, each on the rank that owns the first node.

    Attributes:
        nodes: Global numbers of both nodes, shape (n, 2).
        ends: For midsides the pairs at both ends of their edge, −1 for vertices, shape (n, 2, 2).
        held: Flags of components that supports hold at either node, shape (n, 2, d).
        normals: Normals of all facets out of the first node's body, shape (n, most, d); without
            components that supports hold on both sides.
        known: Flags of the existing normals, shape (n, most).
        contact: Smallest number of the contacts that the pair belongs to, shape (n,).
        crowded: Whether either node faces others as well, shape (n,).
    """

    nodes: Longs
    ends: Longs
    held: Flags
    normals: Floats
    known: Flags
    contact: Longs
    crowded: Flags

    def __len__(self) -> int:
        return len(self.nodes)


def owners(problem: Problem, nodes: Longs) -> Longs:
    """Return the ranks that own nodes, given by their global numbers. Collective."""
    ends = np.cumsum(problem.comm.allgather(problem.V.dofmap.index_map.size_local))
    found: Longs = np.searchsorted(ends, nodes, side="right")
    return found


def facing_nodes(problem: Problem, matched: list[MatchedFacets]) -> FacingNodes:
    """Collect the facets around each pair of nodes. Collective.

    Args:
        problem: The bodies and their contact.
        matched: Matched facets of each contact.
    """
    comm, gdim = problem.comm, problem.bodies.gdim
    rows = np.concatenate([_records(facets, i, gdim) for i, facets in enumerate(matched)])
    rows = send_rows(comm, rows, owners(problem, rows["nodes"][:, 0]))
    nodes, first, of, counts = np.unique(
        rows["nodes"], axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(of.ravel(), kind="stable")
    slot = np.empty(len(rows), dtype=np.int64)
    slot[order] = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    most = comm.allreduce(int(counts.max(initial=1)), MPI.MAX)
    normals = np.zeros((len(nodes), most, gdim))
    known = np.zeros((len(nodes), most), dtype=np.bool_)
    normals[of.ravel(), slot], known[of.ravel(), slot] = rows["normal"], True
    held = rows["held"][first]
    contact = np.full(len(nodes), len(matched), dtype=np.int64)
    np.minimum.at(contact, of.ravel(), rows["contact"])
    both: Flags = np.asarray(held.all(axis=1), dtype=np.bool_)
    normals = np.where(both[:, None], 0.0, normals)
    crowded = _crowded(problem, nodes)
    return FacingNodes(nodes, rows["ends"][first], held, normals, known, contact, crowded)


def _records(facets: MatchedFacets, contact: int, gdim: int) -> Record:
    """Return a row for each node of each facet."""
    n, count = facets.first.shape
    rows = np.zeros(
        (n, count),
        dtype=[
            ("nodes", np.int64, 2),
            ("ends", np.int64, (2, 2)),
            ("held", np.bool_, (2, gdim)),
            ("normal", np.float64, gdim),
            ("contact", np.int64),
        ],
    )
    pairs = np.stack([facets.first, facets.second], axis=2)
    rows["nodes"], rows["ends"], rows["contact"] = pairs, -1, contact
    rows["held"] = np.stack([facets.held_first, facets.held_second], axis=2)
    rows["normal"] = facets.normals[:, None]
    for node, edge in enumerate(facets.edges(), start=gdim):
        rows["ends"][:, node] = pairs[:, list(edge)]
    swapped = rows["nodes"][..., 0] > rows["nodes"][..., 1]  # the same pair from either side
    for name, axis in (("nodes", -1), ("ends", -1), ("held", -2)):
        rows[name][swapped] = np.flip(rows[name][swapped], axis=axis)
    rows["normal"][swapped] *= -1.0
    return rows.ravel()


def _crowded(problem: Problem, nodes: Longs) -> Flags:
    """Return whether either node of a pair is in several pairs. Collective."""
    asked = Exchange(problem.comm, owners(problem, nodes.ravel()))
    there = asked.forward(nodes.ravel())
    _, of, times = np.unique(there, return_inverse=True, return_counts=True)
    often = (asked.back(times[of.ravel()]) > 1).reshape(-1, 2).any(axis=1)
    return np.asarray(often, dtype=np.bool_)
