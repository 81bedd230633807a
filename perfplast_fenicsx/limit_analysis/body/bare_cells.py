"""Divide cells of cohesionless ground whose vertices are all unconfined."""

import logging

import numpy as np
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.sheared_edges import with_sheared_edges_divided
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.facets.bound_body import bound_body
from perfplast_fenicsx.limit_analysis.facets.glued_ties import with_matching_facets
from perfplast_fenicsx.limit_analysis.facets.lone_corners import bare_vertices, with_divided_corners
from perfplast_fenicsx.mesh.refinement import fan
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_room_for_stress(problem: Problem) -> Problem:
    """Return the problem with all cells divided in which the stress is over-constrained.

    Collective.

    Args:
        problem: The bodies with their loads.
    """
    problem = with_sheared_edges_divided(with_divided_corners(with_matching_facets(problem)))
    return with_divided_bare_cells(problem)


def with_divided_bare_cells(problem: Problem) -> Problem:
    """Return the plane problem with all unconfined cells divided; unchanged without such cells.

    Collective.

    A cell is divided together with all others at the vertex opposite an inner edge.

    Args:
        problem: The bodies with their loads. The function returns them unchanged if tractions on
            facets are not known or cells are curved.
    """
    tagged_mesh, cones = problem.tagged_mesh, body_cones(problem)
    if problem.bodies.gdim == 3 or tagged_mesh.axisymmetric or not cones.loose:
        return problem
    if has_curved_cells(tagged_mesh.mesh):
        return problem
    body = bound_body(problem)
    if body.prevents is not None or not problem.as_declared:
        return problem
    topology, loose = tagged_mesh.mesh.topology, cones.at_cells()[0] == 0
    outside = np.isin(body.numbers.facets, exterior_facet_indices(topology))
    bare = bare_vertices(problem, body, loose).all(axis=1) & ~outside.all(axis=1)
    here = np.flatnonzero(bare)
    count = problem.comm.allreduce(len(here))
    if count == 0:
        return problem
    log.info("%d cells without cohesion and confinement are divided", count)
    vertices = topology.connectivity(2, 0).array.reshape(-1, 3)
    points = np.unique(vertices[here, np.argmin(outside[here], axis=1)])
    pairs = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(fan(tagged_mesh, points, pairs).tagged_mesh)
