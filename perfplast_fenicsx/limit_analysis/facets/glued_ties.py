"""Glue ties of surfaces whose facets match, in bounds of the body."""

import logging
from dataclasses import replace

from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.facets.divided_interfaces import with_divided_interfaces
from perfplast_fenicsx.mesh.glued_bodies import glue
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_matching_facets(problem: Problem) -> Problem:
    """Return the problem with matching facets in contact, and shared facets at ties. Collective.

    This is done as far as possible. Contact acts at each point, also if mortar rows were requested.
    """
    return with_glued_ties(with_divided_interfaces(_at_each_point(problem)))


def _at_each_point(problem: Problem) -> Problem:
    """Return the problem with node-to-node contact wherever nodes match. Collective."""
    given, mesh = problem.given, problem.tagged_mesh.mesh
    in_mean = any(it.formulation == "mortar" for it in given.contacts)
    if not in_mean or not problem.as_declared or has_curved_cells(mesh):
        return problem
    contacts = [replace(it, formulation=None, hosts=None) for it in given.contacts]
    return Problem(problem.tagged_mesh, **(vars(given) | {"contacts": contacts}))


def with_glued_ties(problem: Problem) -> Problem:
    """Return the problem on a mesh whose cells share vertices where bodies are tied. Collective.

    The velocity and the tractions of a tie with matching facets are the same on both sides, as for
    cells that share a facet.

    Args:
        problem: The bodies. They are returned unchanged if ties do not match or cells are curved.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    if not given.ties or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    pairs = opposite_vertices(tagged_mesh, given.ties)
    surfaces = {name for tie in given.ties for name in (tie.primary, tie.secondary)}
    glued = glue(tagged_mesh, pairs, surfaces)
    if glued is None:
        return problem
    log.info("the facets of all ties match, and bodies share their vertices there")
    return Problem(glued, **(vars(given) | {"ties": []}))
