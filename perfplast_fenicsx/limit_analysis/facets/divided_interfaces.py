"""Make contact and ties of plane meshes match, for bounds of the body.

If both surfaces lie on each other, the bodies do not change. Two polygons that approximate one
curve overlap and leave gaps. Then bounds hold for a projected model: each body ends at the polygon
through the nodes of both.
"""

import logging
from dataclasses import replace

from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.mesh.divided_surfaces import divided, farthest, surface_ends
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
