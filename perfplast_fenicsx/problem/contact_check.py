"""Check whether bodies can be in contact as declared, and find nodes that contact rows omit."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.formulations.tangential_rows import rows_that_rub
from perfplast_fenicsx.contact.rows.jump_basis import TooManyConditions
from perfplast_fenicsx.contact.surfaces.surface_facets import can_host, surface_nodes
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.tagged_mesh import read_gmsh
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class RefusedContacts:
    """Contacts that ``perfplast run`` would refuse.

    Attributes:
        why: The refusal in words, without a full stop.
        pairs: Primary and secondary surface of each of these contacts.
    """

    why: str
    pairs: list[tuple[str, str]]


def refused_contacts(case: str, mesh: Path) -> RefusedContacts | None:
    """Return the contacts of a case that ``perfplast run`` would refuse, or None.

    The function returns None if the case has no contacts, if all contacts are accepted, or if a
    fault of another kind ends the check.

    Not collective.

    With this check, the user need not complete the case to see the refusal.

    Args:
        case: Text of the case; supports and loads may be missing.
        mesh: Mesh of the case.
    """
    pairs = tomllib.loads(case).get("contact", [])
    if not pairs:
        return None
    contacts = [Contact(**pair) for pair in pairs]
    bodies = read_gmsh(MPI.COMM_SELF, mesh)
    some = Elastic(young=1.0, poisson=0.3)  # contact checks do not depend on the law
    try:
        Problem(bodies, dict.fromkeys(bodies.volumes, some), [], [], contacts, degree=2)
    except TooManyConditions as refusal:
        refused = [one for one in contacts if one.label in refusal.contacts]
        named = [(one.primary, one.secondary) for one in refused]
        why = f"perfplast run would refuse these contacts: {str(refusal).rstrip('.')}"
        return RefusedContacts(why, named)
    except InputError:  # the case has placeholders that the user must replace
        return None
    return None


def left_out(problem: Problem) -> list[str]:
    """Return a remark on each obstacle and each friction that acts on only a part of its surface.

    Collective.

    An obstacle omits nodes that supports leave free along its normal but that follow a tie or a
    rigid surface, because such nodes cannot be hosts. Friction is missing where faces meet at an
    edge, and where supports or ties hold a node in all directions along the surface.
    """
    given, constraints, comm = problem.given, problem.constraints, problem.comm
    told = []
    for obstacle in given.obstacles:
        count = comm.allreduce(_unseen(problem, obstacle))
        if count:
            told.append(
                f"the obstacle at '{obstacle.on}' does not act on {count} of its nodes, because "
                "they follow a tie or a rigid surface; at a tie, choose the surface of the other "
                "body by the key hosts"
            )
    rows = rows_that_rub(comm, constraints)
    smooth = np.setdiff1d(rows, problem.friction.pair)
    for number, source in enumerate(constraints.sources):
        of_this = constraints.surface == number
        counts = comm.allreduce(np.array([of_this[smooth].sum(), of_this[rows].sum()]))
        if counts[0]:
            told.append(
                f"{counts[0]} of the {counts[1]} nodes with declared friction at '{source.on}' "
                "have no friction: they are at an edge between two faces, or supports or ties hold "
                "them along the surface"
            )
    return told


def _unseen(problem: Problem, obstacle: Obstacle) -> int:
    """Return the number of nodes on this rank that could host an obstacle row but do not."""
    nodes = surface_nodes(problem.V, problem.tagged_mesh, obstacle.on, problem.fixed)
    nodes = nodes[np.unique(nodes["node"], return_index=True)[1]]
    _, into = obstacle.towards(nodes["x"][:, : problem.bodies.gdim])
    constraints = problem.constraints
    name = f"obstacle {obstacle.name or obstacle.on}"
    numbers = [i for i, source in enumerate(constraints.sources) if source.name == name]
    hosts = constraints.host[np.isin(constraints.surface, numbers)]
    return int((can_host(nodes, into) & ~np.isin(nodes["node"], hosts)).sum())
