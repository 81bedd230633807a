"""Test that a copy of the mesh on each rank has the same cells, names and order."""

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import TaggedMesh, stacked_blocks
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import facet_tags_of, values_of
from perfplast_fenicsx.mesh.whole_mesh import to_owners, whole_mesh
from tests.models import Read

COMM = MPI.COMM_WORLD


def vertices(mesh: TaggedMesh) -> Floats:
    """Return the vertices of each owned cell, shape (num_cells, d + 1, d)."""
    cells, points = corners(mesh.mesh)
    return points[cells]


@pytest.mark.mpi3("2")
@pytest.mark.parametrize("dim", [2, 3])
def test_every_rank_has_the_whole(read: Read, dim: int) -> None:
    shared = read(write_strip_footing, size=0.5) if dim == 2 else stacked_blocks(COMM, 2)
    copy = whole_mesh(shared)
    count = shared.mesh.topology.index_map(dim).size_global
    assert copy.mesh.comm.size == 1
    assert np.array_equal(np.sort(copy.numbers), np.arange(count))
    assert (copy.volumes, copy.surfaces) == (shared.volumes, shared.surfaces)
    own = len(vertices(shared))
    for root in range(COMM.size):
        mine = COMM.rank == root
        rows = {
            "x": vertices(copy),
            "body": values_of(copy.cell_tags, count),
            "facets": facet_tags_of(copy, count),
        }
        found = to_owners(shared, copy, root, rows if mine else {})
        assert np.allclose(found["x"], vertices(shared), rtol=0, atol=1e-14)
        assert np.array_equal(found["body"], values_of(shared.cell_tags, own))
        assert np.array_equal(found["facets"], facet_tags_of(shared, own))
