"""Contact and ties of plane meshes that do not match, in bounds of the body: made to match."""

import logging

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.tie import Tie
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.mesh.divided_surfaces import divided, surface_points
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_divided_interfaces(problem: Problem) -> Problem:
    """The problem on a mesh with a node wherever the other side has one. Collective.

    Bodies stay the same, and facets that lie on each other match, so that tractions and velocities
    of both sides are compared point by point.

    Args:
        problem: In space, on curved cells and where surfaces do not lie on each other it is left as
            it is.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    pairs: list[Contact | Tie] = [*given.contacts, *given.ties]
    plane = problem.bodies.gdim == 2
    if not pairs or not plane or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    finer = tagged_mesh
    for pair in pairs:
        one, other = (surface_points(finer, name) for name in (pair.primary, pair.secondary))
        finer = divided(divided(finer, pair.primary, other), pair.secondary, one)
    if finer is tagged_mesh:
        return problem
    log.info("cells at interfaces are divided, so that facets of both sides match")
    return problem.on(finer)
