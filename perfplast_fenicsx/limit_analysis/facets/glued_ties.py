"""Make contact and ties of plane meshes match, and glue ties, for bounds of the body.

Make contact and ties of plane meshes match, for bounds of the body.
If both surfaces lie on each other, the bodies do not change. Two polygons that approximate one
curve overlap and leave gaps. Then bounds hold for a projected model: each body ends at the polygon
through the nodes of both.
"""

import logging
from dataclasses import replace

from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.mesh.divided_surfaces import divided, farthest, surface_ends
from perfplast_fenicsx.mesh.glued_bodies import glue
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_divided_interfaces(problem: Problem) -> Problem:
    """Return the problem on a mesh with a node wherever the other side has one. Collective.

    Facets that lie on each other then match, so that tractions and velocities of both sides are
    compared point by point. The new mesh states how its bodies differ from the old ones
    (``taken``).

    Args:
        problem: The problem. It is returned unchanged in space, on curved cells, and if surfaces
            neither lie on each other nor are polygons of one curve.

    Raises:
        InputError: If a cell is thinner than the deviation of its facet.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    pairs: list[Contact | Tie] = [*given.contacts, *given.ties]
    plane = problem.bodies.gdim == 2
    if not pairs or not plane or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    finer = tagged_mesh
    for pair in pairs:
        finer = _matching(finer, pair.primary, pair.secondary)
    if finer is tagged_mesh:
        return problem
    log.info("cells at interfaces are divided, so that facets of both sides match")
    return problem.on(finer)


def _matching(tagged_mesh: TaggedMesh, primary: str, secondary: str) -> TaggedMesh:
    """Return the mesh, divided at one pair of surfaces. Collective."""
    one, other = (surface_ends(tagged_mesh, name) for name in (primary, secondary))
    ends = one.reshape(-1, 2), other.reshape(-1, 2)
    away = farthest(one, ends[1]), farthest(other, ends[0])
    moved = 0.0 if None in away else max(it for it in away if it is not None)
    # Distance by which rounding moves vertices off straight surfaces, relative to their length.
    size = max((float(it.max() - it.min()) for it in ends if len(it)), default=0.0)
    bent = moved > 1e-8 * size
    finer = divided(tagged_mesh, primary, ends[1], one if bent else None)
    finer = divided(finer, secondary, ends[0], other if bent else None)
    if not bent:
        return finer
    words = (
        f"the bounds are those of a projected model: '{primary}' and '{secondary}', whose chords"
        f" differ, are both the polygon through the nodes of both, up to {moved:.2g} away"
    )
    return replace(finer, taken=(*finer.taken, words))


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
