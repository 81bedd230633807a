"""Find nodes of contact surfaces without contact or friction because their unknowns are taken."""

import numpy as np

from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.formulations.tangential_rows import rows_that_rub
from perfplast_fenicsx.contact.surfaces.surface_facets import can_host, surface_nodes
from perfplast_fenicsx.problem.problem import Problem


def left_out(problem: Problem) -> list[str]:
    """Return a sentence on each obstacle or friction that acts on only a part of its surface.

    Collective.

    A node of an obstacle is affected if supports leave it free along its normal, but it follows a
    tie or a rigid surface and so hosts no row. Friction is missing where faces meet at an edge, or
    where supports or ties hold a node in all directions along the surface.
    """
    given, constraints, comm = problem.given, problem.constraints, problem.comm
    told = []
    for obstacle in given.obstacles:
        count = comm.allreduce(_unseen(problem, obstacle))
        if count:
            told.append(
                f"the obstacle at '{obstacle.on}' does not act on {count} of its nodes, "
                "which follow a tie or a rigid surface; let the other body of the tie "
                "follow (hosts)"
            )
    rows = rows_that_rub(comm, constraints)
    smooth = np.setdiff1d(rows, problem.friction.pair)
    for number, source in enumerate(constraints.sources):
        of_this = constraints.surface == number
        counts = comm.allreduce(np.array([of_this[smooth].sum(), of_this[rows].sum()]))
        if counts[0]:
            told.append(
                f"{counts[0]} of the {counts[1]} nodes with friction at '{source.on}' have "
                "no friction: they are at an edge of two faces, or supports or ties hold "
                "them along the surface"
            )
    return told


def _unseen(problem: Problem, obstacle: Obstacle) -> int:
    """Return the number of nodes on this rank that could host a row but do not."""
    nodes = surface_nodes(problem.V, problem.tagged_mesh, obstacle.on, problem.fixed)
    nodes = nodes[np.unique(nodes["node"], return_index=True)[1]]
    _, into = obstacle.towards(nodes["x"][:, : problem.bodies.gdim])
    constraints = problem.constraints
    name = f"obstacle {obstacle.name or obstacle.on}"
    numbers = [i for i, source in enumerate(constraints.sources) if source.name == name]
    hosts = constraints.host[np.isin(constraints.surface, numbers)]
    return int((can_host(nodes, into) & ~np.isin(nodes["node"], hosts)).sum())
