"""How long edges of a plane mesh count, by what changes along them.

Where bodies slide in layers the velocity changes across these alone, and where principal stresses
turn about a point they change around it alone. Cells that are long the other way are as good. Of
two edges of the same length the one along which more changes counts as the longer one.
"""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.mesh.straight_geometry import corners


def edge_metric(found: BodyBounds) -> Floats | None:
    """Return a matrix M for each owned cell, in which the square of an edge e is e·M e. Collective.

    M = GᵀG + 3 SᵀS with the gradients G of the mechanism, in the middle of the cell, and S of the
    deviator in the plane, each scaled so that the larger eigenvalue of its square is 1: an edge
    along which neither changes counts less.

    Args:
        found: Bounds on the mesh, of quadratic velocities on triangles.

    Returns:
        Shape (num_cells, 2, 2); None without both bounds, and around an axis.
    """
    tagged_mesh = found.problem.tagged_mesh
    plane = tagged_mesh.mesh.topology.dim == 2 and not tagged_mesh.axisymmetric
    if not plane or found.stress is None or found.shares is None or found.problem.degree != 2:
        return None
    vertices, points = corners(tagged_mesh.mesh)
    x = points[vertices]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1])  # rows of x − x₀ to coordinates of the cell
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
    more = 3.0  # weight of the stress: of a fan whose layers slide too, it wants the directions
    comm, apart = tagged_mesh.mesh.comm, np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    sizes = apart.max(axis=1)
    of_mechanism = _stretches(comm, of_velocity * sizes[:, None, None], u)
    return of_mechanism + more * _stretches(comm, of_stress * sizes[:, None, None], deviator)


def _stretches(comm: MPI.Intracomm, changes: Floats, values: Floats) -> Floats:
    """GᵀG of gradients G, of the larger eigenvalue 1 and a smaller one not too small. Collective.

    Args:
        comm: The ranks.
        changes: G times the size of the cell, shape (n, 2, 2).
        values: What changes, shape (n, k, 2): where it does by next to nothing, the direction is
            one of rounding, and both eigenvalues are 1.
    """
    longest = 8.0  # times as long as they are wide: the most that cells are to become
    nothing = 1e-4  # of the largest value
    largest = comm.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)
    squares, axes = np.linalg.eigh(np.einsum("cki,ckj->cij", changes, changes))
    small, large = np.sqrt(np.maximum(squares, 0.0)).T
    ratio = np.divide(small, large, out=np.ones_like(small), where=large > nothing * largest)
    stretched = np.column_stack([np.maximum(ratio, 1 / longest), np.ones_like(ratio)])
    stretches: Floats = np.einsum("cik,ck,cjk->cij", axes, stretched**2, axes)
    return stretches
