"""Compute the directions in which velocity and stress of bounds in space change, cell by cell.

A mesh should be fine across slip bands, which the velocity shows, and across the thickness of
bending parts, which the stress shows. Along them it may be coarse.
"""

from mpi4py import MPI

import numpy as np
from dolfinx import la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.parts_of_cells import of_parents
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def directions_of_change(found: BodyBounds) -> Floats:
    """Return gradients of the velocity and of the stress deviator, scaled to the norms 1 and 1/2.

    Collective.

    The gradients are those of fields that are linear in each cell. Their values at its corners are
    the velocity, and the mean stress of the surrounding cells. Without a stress only the velocity
    counts.

    Args:
        found: Bounds with a mechanism, which is zero if none was found.

    Returns:
        ∂f_j/∂x_i in row i, for the owned cells before the split, shape (num_cells, 3, 3 or 9); zero
        where nothing changes.
    """
    tagged_mesh, space = found.problem.tagged_mesh, found.mechanism.function_space
    cells, points = corners(tagged_mesh.mesh)
    places = points[cells]
    at_vertices = space.dofmap.list[: len(cells), : cells.shape[1]]  # independent of the degree
    velocity = found.mechanism.x.array.reshape(-1, space.dofmap.index_map_bs)[at_vertices]
    changes = [_gradients(tagged_mesh, places, velocity)]
    if found.stress is not None:
        deviator = found.stress.copy()
        deviator[..., :3] -= deviator[..., :3].mean(axis=2, keepdims=True)
        around = _around_vertices(tagged_mesh, cells, places, deviator)
        changes.append(_gradients(tagged_mesh, places, around))
    weights = 1.0, 0.5  # a larger norm for the stress worsens punches more than it improves plates
    sized = [_in_their_size(found.problem.comm, it) for it in changes]
    return np.concatenate([w * it for w, it in zip(weights, sized, strict=False)], axis=2)


def _gradients(tagged_mesh: TaggedMesh, places: Floats, values: Floats) -> Floats:
    """Return gradients in cells before the split, from values at corners of the parts."""
    matrices, changes = places[:, 1:] - places[:, :1], values[:, 1:] - values[:, :1]
    gradients = np.asarray(np.linalg.solve(matrices, changes), dtype=np.float64)
    if not isinstance(tagged_mesh, AlfeldSplit):
        return gradients
    # The parts of a cell have equal volumes, so that their mean is the gradient from the cell's own
    # corners.
    flat = gradients.reshape(len(gradients), -1) / places.shape[1]
    sums = np.stack([of_parents(column, tagged_mesh) for column in flat.T], axis=1)
    return sums.reshape(-1, *gradients.shape[1:])


def _around_vertices(
    tagged_mesh: TaggedMesh, cells: Ints, places: Floats, values: Floats
) -> Floats:
    """Return means over all cells around each corner, weighted by their volumes. Collective.

    Args:
        tagged_mesh: The mesh.
        cells: Vertices of the owned cells, shape (num_cells, 4).
        places: Coordinates of these vertices, shape (num_cells, 4, 3).
        values: Values at corners of cells, shape (num_cells, 4, m), as in the result.
    """
    vertices = tagged_mesh.mesh.topology.index_map(0)
    volumes = np.abs(np.linalg.det(places[:, 1:] - places[:, :1]))
    weighted = np.concatenate([values, np.ones_like(values[..., :1])], axis=2)
    weighted *= volumes[:, None, None]
    width = weighted.shape[2]
    sums = la.vector(vertices, width, dtype=np.float64)
    table = sums.array.reshape(-1, width)
    np.add.at(table, cells.ravel(), weighted.reshape(-1, width))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    means: Floats = (table[:, :-1] / table[:, -1:])[cells]
    return means


def _in_their_size(comm: MPI.Intracomm, gradients: Floats) -> Floats:
    """Return each gradient divided by its norm, except for rounding errors. Collective."""
    sizes = np.linalg.norm(gradients, axis=(1, 2), keepdims=True)
    least = 1e-4 * comm.allreduce(float(sizes.max(initial=0.0)), MPI.MAX)
    return np.divide(
        gradients, sizes + least, out=np.zeros_like(gradients), where=sizes + least > 0
    )
