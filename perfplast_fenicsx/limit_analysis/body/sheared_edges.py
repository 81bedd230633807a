"""Refine edges in space at which a shear traction ends and too few cells carry it.

Stresses are symmetric: for one stress at an edge, the traction on either side has the same
component along the normal of the other side. If the given tractions violate this, as a shear next
to a free side does, the stress changes from one side to the other, in as many steps as there are
cells. One or two cells carry a small part of the body's load. Finer meshes by bisection carry no
more, since they keep these cells.
"""

import logging

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.singular_edges import angles_at_edges
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, bound_body
from perfplast_fenicsx.mesh.refinement import fan_around
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_sheared_edges_divided(problem: Problem) -> Problem:
    """Return the problem with fans around such edges; unchanged without such edges. Collective.

    Args:
        problem: The bodies with their loads. The function returns them unchanged in the plane, on
            curved cells, and if tractions on facets are not known.
    """
    if problem.bodies.gdim == 2 or has_curved_cells(problem.tagged_mesh.mesh):
        return problem
    most = 3  # bisections, which make eight cells of one
    for _ in range(most):
        body = bound_body(problem)
        if body.prevents is not None or not problem.as_declared:
            break
        edges = sheared_edges(problem, body)
        count = problem.comm.allreduce(int(edges.any(axis=1).sum()))
        if count == 0:
            break
        log.info("%d cells at edges where a shear traction ends are divided", count)
        pairs = opposite_vertices(problem.tagged_mesh, problem.given.contacts)
        problem = problem.on(fan_around(problem.tagged_mesh, edges, pairs).tagged_mesh)
    return problem


def sheared_edges(problem: Problem, body: BoundBody) -> npt.NDArray[np.bool_]:
    """Return edges of owned cells at which shears differ and too few cells meet. Collective.

    Returns:
        In DOLFINx's order of edges, shape (num_cells, 6).
    """
    topology = problem.tagged_mesh.mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    topology.create_connectivity(2, 1)
    topology.create_connectivity(1, 0)
    cells, points = corners(problem.tagged_mesh.mesh)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[: len(cells)]
    facets = body.geometry.exterior
    of_facet = topology.connectivity(2, 1).array.reshape(-1, 3)[facets]
    normals = body.geometry.normals(facets)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[of_facet]
    numbers = topology.index_map(0).local_to_global(np.arange(len(points), dtype=np.int32))
    sides = _sides(ends, points, numbers, body.geometry.corners(facets), normals)
    known = _told(body)[facets]
    pushes = [loads.tractions[facets].mean(axis=1) for loads in (body.live, body.dead)]

    edges = topology.index_map(1)
    sums = la.vector(edges, 14, dtype=np.float64)
    table = sums.array.reshape(edges.size_local + edges.num_ghosts, 14)
    angle = angles_at_edges(points[cells]).ravel()
    np.add.at(table[:, :2], of_cell.ravel(), np.column_stack([angle, np.ones(angle.size)]))
    of_facets = [known[:, None], normals]
    for push in pushes:
        of_facets += [push, np.einsum("fi,fi->f", push, normals)[:, None]]
    rows: Floats = np.repeat(np.hstack(of_facets).astype(np.float64)[:, None], 3, axis=1)
    rows[:, :, 4:] *= sides[:, :, None]
    np.add.at(table[:, 2:], of_facet.ravel(), rows.reshape(-1, 12))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    wrong = np.zeros(len(table), dtype=bool)
    noticed = 0.05  # relative to the largest traction; a smaller difference has little effect
    for k, push in enumerate(pushes):
        # (t − s)·(m + n) − (t·m − s·n) = t·n − s·m
        at = 6 + 4 * k
        across = np.einsum("ei,ei->e", table[:, at : at + 3], table[:, 3:6]) - table[:, at + 3]
        largest = problem.comm.allreduce(np.abs(push).max(initial=0.0), MPI.MAX)
        wrong |= np.abs(across) > noticed * largest
    right = np.pi / 2
    valence = 2  # required number of cells in each right angle of the body
    rounding = 1e-6  # cells, by their angles
    straight = 1.8  # right angles from which there is no corner
    few = table[:, 1] < valence * table[:, 0] / right - rounding
    few &= table[:, 0] < straight * right
    found: npt.NDArray[np.bool_] = (wrong & few & (table[:, 2] > 1.5))[of_cell]
    return found


def _sides(ends: Longs, points: Floats, numbers: Longs, facets: Floats, normals: Floats) -> Floats:
    """Return 1 or −1 for each edge of a facet, with opposite signs on its two sides.

    Args:
        ends: Vertices of the edges, shape (num_facets, 3, 2).
        points: Coordinates of all vertices.
        numbers: Numbers of all vertices, the same on all ranks.
        facets: Vertices of the facets, shape (num_facets, 3, 3).
        normals: Normals of the facets.
    """
    turned = np.diff(numbers[ends], axis=2) < 0
    along = np.where(turned, -1.0, 1.0) * np.diff(points[ends], axis=2)[:, :, 0]
    inwards = facets.mean(axis=1)[:, None] - points[ends].mean(axis=2)
    sides = np.sign(np.einsum("fei,fei->fe", np.cross(normals[:, None], along), inwards))
    return np.asarray(sides, dtype=np.float64)


def _told(body: BoundBody) -> npt.NDArray[np.bool_]:
    """Return on which facets all components of the traction are given, shape (num_facets,)."""
    told = ~np.asarray(body.facets.held.any(axis=1), dtype=np.bool_)
    told[body.facets.in_contact] = False
    told[body.facets.rubbing] = False
    told[body.rigid.surface >= 0] = False
    return told
