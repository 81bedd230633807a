"""Test nodes that take over the forces of nodes with almost no covered area."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.mortar.mortar_rows import integrate, mortar_rows
from perfplast_fenicsx.mesh.kinematics import KINDS
from tests.contact.test_clipping import grid, number_nodes

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("degree", [1, 2])
def test_a_host_has_its_share_in_its_own_row(degree: int) -> None:
    """Slivers that host because other nodes cannot take over no forces.

    The jump basis divides by their rows.
    """
    for seed in range(60):
        random = np.random.default_rng(seed)
        counts = [(int(n), int(m)) for n, m in random.integers(2, 6, (2, 2))]
        hosts = grid(counts[0], 0.0, degree, seed, 1.0)
        guests = grid(counts[1], 3 * random.random(), degree, seed + 100, -1.0)
        guests["x"][..., :2] += 3 * (random.random(2) - 0.5)
        found = integrate(hosts, guests, 0.3, KINDS["space"].around)
        able = np.ones(number_nodes(hosts), dtype=np.bool_)
        number_nodes(guests)
        rows = mortar_rows(MPI.COMM_SELF, hosts, guests, found, able)
        own = rows.own & (rows.node == rows.place[rows.row])
        shares = np.bincount(rows.row[own], rows.weight[own], len(rows.d))
        assert len(shares), seed
        assert shares.min() > 0.5, seed
