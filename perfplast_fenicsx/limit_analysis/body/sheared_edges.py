"""Edges in space at which a shear ends, with too few cells around them to carry it.

Stresses are symmetric: of one stress at an edge the traction on either side has the same component
along the normal of the other. Where tractions that are given have not, such as a shear beside a
free side, the stress turns from one side to the other, in as many steps as there are cells. One or
two carry a small part of what the body carries, and no more on finer meshes, as bisection leaves
such cells where they are.
"""

import logging

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.opposite_vertices import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.singular_edges import angles_at_edges
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, bound_body
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.mesh.refinement import fan_around
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


def with_sheared_edges_divided(problem: Problem) -> Problem:
    """The problem on a mesh with fans around such edges; itself where it has none. Collective.

    Args:
        problem: The bodies with their loads; in the plane, on curved cells and where facets say
            nothing certain of tractions it is left as it is.
    """
    if problem.bodies.gdim == 2 or has_curved_cells(problem.tagged_mesh.mesh):
        return problem
    most = 3  # times that cells are cut in two, which make eight of one
    for _ in range(most):
        body = bound_body(problem)
        if body.prevents is not None or not problem.as_declared:
            break
        edges = sheared_edges(problem, body)
        count = problem.comm.allreduce(int(edges.any(axis=1).sum()))
        if count == 0:
            break
        log.info("%d cells at edges where a shear ends are divided", count)
        pairs = opposite_vertices(problem.tagged_mesh, problem.given.contacts)
        problem = problem.on(fan_around(problem.tagged_mesh, edges, pairs).tagged_mesh)
    return problem


def sheared_edges(problem: Problem, body: BoundBody) -> npt.NDArray[np.bool_]:
    """Return edges of owned cells where shears differ, and too few cells meet. Collective.

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
    noticed = 0.05  # of the largest traction: less costs as little
    for k, push in enumerate(pushes):
        # (t − s)·(m + n) − (t·m − s·n) = t·n − s·m
        at = 6 + 4 * k
        across = np.einsum("ei,ei->e", table[:, at : at + 3], table[:, 3:6]) - table[:, at + 3]
        largest = problem.comm.allreduce(np.abs(push).max(initial=0.0), MPI.MAX)
        wrong |= np.abs(across) > noticed * largest
    right = np.pi / 2
    valence = 2  # cells that meet there at least in each right angle of the body
    rounding = 1e-6  # of cells, by that of angles
    straight = 1.8  # right angles, from which on there is no corner
    few = table[:, 1] < valence * table[:, 0] / right - rounding
    few &= table[:, 0] < straight * right
    found: npt.NDArray[np.bool_] = (wrong & few & (table[:, 2] > 1.5))[of_cell]
    return found


def _sides(ends: Longs, points: Floats, numbers: Longs, facets: Floats, normals: Floats) -> Floats:
    """1 or −1 for each of three edges of a facet, not the same on both sides of an edge.

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
    """On which facets tractions are given in all directions, shape (num_facets,)."""
    told = ~np.asarray(body.facets.held.any(axis=1), dtype=np.bool_)
    told[body.facets.in_contact] = False
    told[body.facets.rubbing] = False
    told[body.rigid.surface >= 0] = False
    return told
