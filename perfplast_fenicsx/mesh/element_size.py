"""Measure the size of the elements of a mesh."""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def element_size(tagged_mesh: TaggedMesh) -> float:
    """Return the mean of the longest edges of the cells (length). Collective."""
    mesh = tagged_mesh.mesh
    tdim = mesh.topology.dim
    count = mesh.topology.index_map(tdim).size_local
    longest = mesh.h(tdim, np.arange(count, dtype=np.int32))
    sums = np.array([longest.sum(), count], dtype=np.float64)
    mesh.comm.Allreduce(MPI.IN_PLACE, sums)
    return float(sums[0] / sums[1])
