"""Ties of surfaces whose facets match, in bounds of the body: they are glued for good."""

import logging
from dataclasses import replace

from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.facets.divided_interfaces import with_divided_interfaces
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.mesh.glued_bodies import glue
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_matching_facets(problem: Problem) -> Problem:
    """The problem on a mesh whose facets match where bodies meet, and are one where they are tied.

    As far as that can be had. Contact is at each point, also where mortar rows were asked for.
    Collective.
    """
    return with_glued_ties(with_divided_interfaces(_at_each_point(problem)))


def _at_each_point(problem: Problem) -> Problem:
    """Return the problem with contact of nodes wherever they match. Collective."""
    given, mesh = problem.given, problem.tagged_mesh.mesh
    in_mean = any(it.formulation == "mortar" for it in given.contacts)
    if not in_mean or not problem.as_declared or has_curved_cells(mesh):
        return problem
    contacts = [replace(it, formulation=None, hosts=None) for it in given.contacts]
    return Problem(problem.tagged_mesh, **(vars(given) | {"contacts": contacts}))


def with_glued_ties(problem: Problem) -> Problem:
    """The problem on a mesh whose cells share their vertices where bodies are tied. Collective.

    The velocity and the tractions of a tie whose facets match are the same at both sides, as those
    of cells that share a facet.

    Args:
        problem: The bodies; those whose ties do not match, and those on curved cells, are left as
            they are.
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
