"""Find vertices without stress, and divide corners whose single cell cannot balance its loads.

In 2D, the stress of a cell has three components at a corner. The tractions on both sides of the
corner prescribe up to four combinations of these components. For example, a pressure next to a free
side prescribes four combinations. They contradict each other unless the sides are at right angles,
and the stress then balances no load at all. A free side next to contact prescribes three
combinations, which determine the contact pressure in the corner, often as zero. A free side next to
a surface with friction prescribes two combinations; shear and pressure are then proportional,
whatever the adhesion is. Two cells that meet in the corner have six components, and the tractions
prescribe at most six combinations.

In 3D, corners need no division, because each cell consists of four parts (:mod:`stress_cells`).
Three parts meet at a vertex that belongs to a single cell, and their stresses at this vertex have
18 components. The tractions on three facets, and continuity at three facets between the parts, are
also 18 conditions. These conditions are regular for one tetrahedron, and therefore for all
tetrahedra, because Piola's transformation maps symmetric stresses to symmetric stresses and
tractions to tractions.

:func:`bare_vertices` finds vertices at which unconfined, cohesionless ground has no stress. On a
free facet, σn = 0, so one principal stress is zero. Without cohesion, the yield condition then
requires σ = 0. At this vertex, the tractions on all other facets of the cell are then zero too, and
so is σ in the neighbouring cells. With a pore pressure this does not hold, because yielding depends
on effective stresses. Stresses at these vertices are not unknowns of a lower bound, because their
yield set has no interior.
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
    """Return the problem on a mesh with two cells in each corner of :func:`lone_corners`.

    Collective.

    The function divides the cell in each such corner from the corner to the midpoint of the
    opposite edge. Without such corners, it returns the problem itself.

    Args:
        problem: The bodies with their loads. In 3D, on curved cells, and if the data of the facets
            do not determine their tractions, the function returns the problem unchanged.
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
    log.info("%d corners that consist of one cell and could not carry loads are divided", count)
    pairs = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(fan(tagged_mesh, points, pairs).tagged_mesh)


def lone_corners(problem: Problem, body: BoundBody) -> Ints:
    """Return local vertices where a single cell allows no stress or no contact force. Collective.

    Only the rank that owns the cell returns the vertex.
    """
    topology, facets = problem.tagged_mesh.mesh.topology, body.numbers.facets
    outside = np.isin(facets, exterior_facet_indices(topology))
    # Facets at each vertex of a triangle: the facets opposite the other two vertices.
    others = np.array([[1, 2], [0, 2], [0, 1]])
    cell, corner = np.nonzero(outside[:, others].all(axis=2))
    side = others[corner]
    here = facets[cell[:, None], side]
    slopes, _ = gradients(body.vertices[cell])
    normal = -slopes[np.arange(len(cell))[:, None], side]
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)

    axes, told = body.facets.axes[here], ~body.facets.held[here]
    pressed = np.isin(here, body.facets.in_contact)
    told[..., 0] &= ~pressed  # the contact pressure is not known
    told[body.rigid.surface[here] >= 0] = False  # only resultants are known
    rubs = np.isin(here, body.facets.rubbing)
    told[rubs] = False  # the shear traction is not known
    # Basis of in-plane stresses.
    components: Floats = np.array(
        [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]]], dtype=float
    )
    every = np.einsum("nfai,nfj,mij->nfam", axes, normal, components)
    rows = (every * told[..., None]).reshape(-1, 4, 3)
    beside = corner[:, None] - (side < corner[:, None])  # index among the facet's vertices
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
    """Return flags of vertices without stress in this rank's cells. Collective.

    The result has the shape (num_cells, d + 1). The docstring of the module explains why these
    vertices have no stress.

    Args:
        problem: The bodies.
        at: Conditions on the facets of the bodies.
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
