"""Test that nodes of two surfaces find their partners on any ranks."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.contact.surfaces.surface_facets import surface_node_type


@pytest.mark.mpi3
def test_points_find_their_partners_wherever_they_are(comm: MPI.Intracomm) -> None:
    generator = np.random.default_rng(0)
    nodes = np.zeros(200, dtype=surface_node_type(3))
    nodes["x"] = generator.random((200, 3)) * (3, 1, 1)
    nodes["number"] = np.arange(200)
    nodes["normal"] = (0.0, 0.0, 1.0)
    primary = nodes[np.arange(200) % comm.size == comm.rank]
    shuffled = nodes[generator.permutation(200)]
    shuffled["x"] += 1e-9 * generator.normal(size=(200, 3))
    shuffled["normal"] *= -1
    secondary = shuffled[np.arange(200) % comm.size == comm.rank]
    matching = match_nodes(comm, primary, secondary, 1e-7)
    assert (matching.primary["number"] == matching.secondary["number"]).all()
    assert comm.allreduce(len(matching.primary)) == 200
    assert matching.alone == 0
    assert matching.farthest == pytest.approx(0)

    missing = match_nodes(comm, primary, secondary[1:], 1e-7)
    assert missing.alone == comm.size
    assert missing.farthest > 1e-7
    twice = match_nodes(comm, primary, np.concatenate([secondary, secondary]), 1e-7)
    assert twice.alone == 200
