"""Define the length of edges of a plane mesh by the change of the solution along them.

In slip layers the velocity changes only across the layers. Where principal stresses rotate about a
point, they change only around the point. Cells that are long in the other direction are equally
good. Of two edges of equal length, the metric makes the one with the larger change longer.
"""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.mesh.straight_geometry import corners


def edge_metric(found: BodyBounds) -> Floats | None:
    """Return a matrix M for each owned cell; the squared length of an edge e is e·M e. Collective.

    M = GᵀG + 3 SᵀS with the gradients G of the mechanism in the middle of the cell, and S of the
    in-plane stress deviator. Each is scaled so that its largest squared singular value is 1. An
    edge along which neither changes is short.

    Args:
        found: Bounds on the mesh, of quadratic velocities on triangles.

    Returns:
        Matrices, shape (num_cells, 2, 2); None without both bounds, and in axisymmetry.
    """
    tagged_mesh = found.problem.tagged_mesh
    plane = tagged_mesh.mesh.topology.dim == 2 and not tagged_mesh.axisymmetric
    if not plane or found.stress is None or found.shares is None or found.problem.degree != 2:
        return None
    vertices, points = corners(tagged_mesh.mesh)
    x = points[vertices]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1])  # maps x − x₀ to coordinates of the cell
    slopes = np.concatenate([-inverse.sum(axis=2)[:, None], inverse.transpose(0, 2, 1)], axis=1)

    space = found.mechanism.function_space
    u = found.mechanism.x.array.reshape(-1, 2)[space.dofmap.list[: len(x)]]
    a, b = np.array([(1, 2), (0, 2), (0, 1)]).T  # ends of the edges, whose nodes come last
    in_middle = np.concatenate([slopes / 3, (slopes[:, a] + slopes[:, b]) * 4 / 3], axis=1)
    of_velocity = np.einsum("cni,cnj->cij", u, in_middle)

    deviator = np.stack(
        [(found.stress[..., 0] - found.stress[..., 1]) / np.sqrt(2), found.stress[..., 3]], axis=2
    )
    of_stress = np.einsum("cni,cnj->cij", deviator, slopes)
    more = 3.0  # weight of the stress: a fan with slip layers also needs directions
    comm, apart = tagged_mesh.mesh.comm, np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    sizes = apart.max(axis=1)
    of_mechanism = _stretches(comm, of_velocity * sizes[:, None, None], u)
    return of_mechanism + more * _stretches(comm, of_stress * sizes[:, None, None], deviator)


def _stretches(comm: MPI.Intracomm, changes: Floats, values: Floats) -> Floats:
    """Return GᵀG of gradients G, scaled to the larger eigenvalue 1 and a bounded smaller one.

    Collective.

    Args:
        comm: The ranks.
        changes: G times the size of the cell, shape (n, 2, 2).
        values: Values whose change is measured, shape (n, k, 2). If they change only by rounding
            errors, both eigenvalues are 1.
    """
    longest = 8.0  # largest ratio of length to width of cells
    nothing = 1e-4  # relative to the largest value
    largest = comm.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)
    squares, axes = np.linalg.eigh(np.einsum("cki,ckj->cij", changes, changes))
    small, large = np.sqrt(np.maximum(squares, 0.0)).T
    ratio = np.divide(small, large, out=np.ones_like(small), where=large > nothing * largest)
    stretched = np.column_stack([np.maximum(ratio, 1 / longest), np.ones_like(ratio)])
    stretches: Floats = np.einsum("cik,ck,cjk->cij", axes, stretched**2, axes)
    return stretches
