"""Find vertices that bear no stress, and divide corners whose single cell cannot bear its loads.

At the corner its stress has three components, and the tractions on both sides prescribe up to four.
For example a pressure next to a free side does, unless the sides are at right angles. Then no load
is carried at all. Next to contact three are prescribed, and they determine the pressure in the
corner, often as zero. If a surface has friction, a free side prescribes two; then shear and
pressure are proportional, whatever the adhesion. Two cells that meet in the corner have six
components, of which at most six are prescribed.

In space a cell has four parts. At a vertex that belongs to one cell, three of them meet, and their
stresses have 18 components. The tractions of three facets, and continuity at three facets between
the parts, are as many conditions. They are regular for one tetrahedron, and so for all, since
Piola's transformation maps symmetric stresses to symmetric stresses, and tractions to tractions.

Find vertices at which unconfined, cohesionless ground bears no stress. On a free facet σn = 0.
Without cohesion, the other principal stress then bounds a principal stress of zero, so all of σ is
zero. The tractions of all other facets of the cell at that vertex are then zero too, and so is σ in
its neighbours. This does not hold with water, since effective stresses depend on its pressure. Such
stresses are not unknowns of a lower bound, because their set has no interior.
"""

import logging

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.facets.bound_body import (
    BoundBody,
    bound_body,
)
from perfplast_fenicsx.mesh.refinement import fan
from perfplast_fenicsx.mesh.straight_geometry import gradients, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING

log = logging.getLogger(__name__)


def with_divided_corners(problem: Problem) -> Problem:
    """Return the problem on a mesh that has two cells in such corners. Collective.

    Cells are cut from the corner to the midpoint of the opposite edge. Without such corners the
    problem itself is returned.

    Args:
        problem: The bodies with their loads. In space, on curved cells, and if the facets do not
            determine tractions, they are returned unchanged.
    """
    tagged_mesh = problem.tagged_mesh
    if problem.bodies.gdim == 3 or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    body = bound_body(problem)
    if body.prevents is not None:
        return problem
    points = lone_corners(problem, body)
    count = problem.comm.allreduce(len(points))
    if count == 0:
        return problem
    log.info("%d corners of one cell are divided, which could carry no loads", count)
    pairs = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(fan(tagged_mesh, points, pairs).tagged_mesh)


def lone_corners(problem: Problem, body: BoundBody) -> Ints:
    """Return local vertices where tractions leave one cell no stress, or no contact. Collective.

    Each vertex is on the rank of that cell only.
    """
    topology, facets = problem.tagged_mesh.mesh.topology, body.numbers.facets
    outside = np.isin(facets, exterior_facet_indices(topology))
    # Facets at each vertex of a triangle: those opposite to the other vertices.
    others = np.array([[1, 2], [0, 2], [0, 1]])
    cell, corner = np.nonzero(outside[:, others].all(axis=2))
    side = others[corner]
    here = facets[cell[:, None], side]
    slopes, _ = gradients(body.vertices[cell])
    normal = -slopes[np.arange(len(cell))[:, None], side]
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)

    axes, told = body.facets.axes[here], ~body.facets.held[here]
    pressed = np.isin(here, body.facets.in_contact)
    told[..., 0] &= ~pressed  # the pressure there is not known
    told[body.rigid.surface[here] >= 0] = False  # only resultants are known
    rubs = np.isin(here, body.facets.rubbing)
    told[rubs] = False  # nor is the shear known there
    # Components of a plane stress.
    components: Floats = np.array(
        [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]]], dtype=float
    )
    every = np.einsum("nfai,nfj,mij->nfam", axes, normal, components)
    rows = (every * told[..., None]).reshape(-1, 4, 3)
    beside = corner[:, None] - (side < corner[:, None])  # the corner among the facet's vertices
    place = body.numbers.places[cell[:, None], side, beside]
    inverse = np.linalg.pinv(rows)
    wrong = np.zeros(len(cell), dtype=bool)
    for loads in (body.live, body.dead):
        pushes = np.take_along_axis(loads.tractions[here], place[..., None, None], axis=2)[:, :, 0]
        given = (np.einsum("nfai,nfi->nfa", axes, pushes) * told).reshape(-1, 4)
        left = np.einsum("nrm,nmq,nq->nr", rows, inverse, given) - given
        largest = problem.comm.allreduce(np.abs(loads.tractions).max(initial=0.0), MPI.MAX)
        wrong |= np.linalg.norm(left, axis=1) > ROUNDING * largest
    room = every - np.einsum("nfam,nmr,nrq->nfaq", every, inverse, rows)
    wrong |= (pressed & (np.linalg.norm(room[:, :, 0], axis=2) < ROUNDING)).any(axis=1)
    least = np.linalg.svd(room, compute_uv=False)[..., -1]
    wrong |= (rubs & (least < ROUNDING)).any(axis=1)
    vertices = topology.connectivity(2, 0).array.reshape(-1, 3)
    found: Ints = vertices[cell[wrong], corner[wrong]]
    return found


Flags = npt.NDArray[np.bool_]


def bare_vertices(problem: Problem, at: BoundBody, loose: Flags) -> Flags:
    """Return flags of these vertices in this rank's cells, shape (num_cells, d + 1). Collective.

    Args:
        problem: The bodies.
        at: Conditions on their facets.
        loose: Flags of the cells without cohesion, shape (num_cells,).
    """
    topology, on = problem.tagged_mesh.mesh.topology, at.numbers.facets
    tdim = topology.dim
    exterior = np.isin(on, exterior_facet_indices(topology))
    free = (
        exterior
        & ~at.facets.held[on].any(axis=2)
        & ~np.isin(on, at.facets.in_contact)
        & loose[:, None]
    )
    free &= at.rigid.surface[on] < 0
    pushed = (at.live.tractions != 0).any(axis=2) | (at.dead.tractions != 0).any(axis=2)
    vertices: Longs = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[: len(on)]
    others = np.array([[b for b in range(tdim + 1) if b != a] for a in range(tdim + 1)])
    bare = free[:, :, None] & ~np.take_along_axis(pushed[on], at.numbers.places, axis=2)
    wet = (at.live.pores != 0) | (at.dead.pores != 0)
    bare &= ~wet[:, others]
    flags = la.vector(topology.index_map(0), 1)
    flags.array[vertices[:, others][bare]] = 1.0
    flags.scatter_reverse(la.InsertMode.add)
    flags.scatter_forward()
    found: Flags = (flags.array[vertices] > 0) & loose[:, None]
    return found
