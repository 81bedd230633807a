"""Test the shares of cells in the gap between two bounds, with known stresses."""

import numpy as np
import pytest

from perfplast_fenicsx.limit_analysis import interior_point, strict_upper_bound
from perfplast_fenicsx.limit_analysis.velocity.strict_work import gap_shares
from tests.limit_analysis.test_interior_point import BLOCK, COMM, blocks


@pytest.mark.mpi3("1.0")
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_they_add_up_to_the_gap(share: float) -> None:
    """Two blocks with the yield stress 300 carry 300, by a uniform stress."""
    problem = blocks(BLOCK, BLOCK)
    mechanism = interior_point(problem, 1e-6).mechanism
    upper = strict_upper_bound(problem, mechanism).value
    assert upper is not None
    topology = problem.tagged_mesh.mesh.topology
    stress = np.zeros((topology.index_map(3).size_local, 4, 6))
    stress[:, :, 2] = -300.0 * share
    shares = gap_shares(problem, mechanism, stress)
    assert COMM.allreduce(shares.sum()) == pytest.approx(upper - 300.0 * share, abs=1e-8)
    assert (shares >= -1e-10).all()
