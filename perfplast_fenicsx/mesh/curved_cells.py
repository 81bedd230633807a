"""Check whether the geometry of a mesh is that of its vertices."""

from mpi4py import MPI

import numpy as np
from dolfinx.mesh import Mesh

from perfplast_fenicsx.compat import coordinate_map, geometry_dofmap


def has_curved_cells(mesh: Mesh) -> bool:
    """Return whether any cell is curved. Collective."""
    cmap, tdim = coordinate_map(mesh), mesh.topology.dim
    if cmap.degree == 1:
        return False
    x = mesh.geometry.x[geometry_dofmap(mesh)]
    vertices = x[:, : tdim + 1]
    layout = cmap.create_dof_layout()
    size = np.ptp(vertices, axis=1).max(axis=1)
    curved = False
    # Distance of a midside node from the middle that counts as rounding, relative to the cell.
    rounding = 1e-10
    for edge in range(3 if tdim == 2 else 6):
        ends = [d for d in layout.entity_closure_dofs(1, edge) if d <= tdim]
        (middle,) = layout.entity_dofs(1, edge)
        off = np.linalg.norm(x[:, middle] - vertices[:, ends].mean(axis=1), axis=1)
        curved |= bool((off > rounding * size).any())
    return bool(mesh.comm.allreduce(curved, MPI.LOR))
