"""Test that host facets search where neighbouring facets have found their partners."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.mortar.mortar_contact import facing_facets
from perfplast_fenicsx.mesh.kinematics import KINDS
from tests.contact.test_clipping import area, grid


@pytest.mark.mpi2("1.0-True-1")
@pytest.mark.parametrize(
    ("height", "onward", "found_far"), [(1.0, True, 1), (1.0, False, 0), (-1.0, True, 0)]
)
def test_a_step_in_the_other_surface(
    comm: MPI.Intracomm, height: float, onward: bool, found_far: int
) -> None:
    """The search finds facets far in front of a facet, and no facets far behind it."""
    hosts = grid((4, 5), 0.0, 1, 1, 1.0)
    guests = grid((6, 6), 0.0, 1, 2, -1.0)
    guests["x"][..., 0] /= 2
    near, far = guests.copy(), guests.copy()
    near["x"][..., 0] -= 0.5
    far["x"] += [0.5, 0.0, height]
    mine = slice(comm.rank, None, comm.size)
    both = np.concatenate([near, far])[mine]
    facing = facing_facets(comm, hosts[mine], both, np.sqrt(8.0), KINDS["space"].around, onward)
    assert comm.allreduce(len(facing.hosts)) == len(hosts)
    found = facing.found
    beyond = (facing.hosts["x"][..., 0] > 0).all(axis=1)
    before = (facing.hosts["x"][..., 0] < 0).all(axis=1)
    areas = area(facing.hosts["x"])
    np.testing.assert_allclose(found.covered[before], areas[before], rtol=1e-12)
    np.testing.assert_allclose(found.covered[beyond], found_far * areas[beyond], rtol=1e-12)
    assert comm.allreduce(int(beyond.sum()))
    total = comm.allreduce(np.array([found.covered.sum(), found.on_guest.sum()]))
    assert total[0] == pytest.approx(total[1], rel=1e-12)
    weights = np.zeros_like(found.d)
    np.add.at(weights, found.host, found.M.sum(axis=2))
    assert weights == pytest.approx(found.d, abs=1e-12)


@pytest.mark.parametrize("slope", [0.2, 0.5])
def test_surfaces_that_lean_away_are_covered_in_whole(comm: MPI.Intracomm, slope: float) -> None:
    """The search covers facets beyond its first reach, wherever this reach ends."""
    hosts, guests = grid((5, 5), 0.0, 1, 1, 1.0), grid((9, 9), 0.0, 1, 2, -1.0)
    guests["x"][..., 2] += slope * (guests["x"][..., 0] + 1)
    mine = slice(comm.rank, None, comm.size)
    given = (np.sqrt(8.0), KINDS["space"].around, True)
    facing = facing_facets(comm, hosts[mine], guests[mine], *given)
    assert comm.allreduce(len(facing.hosts)) == len(hosts)
    np.testing.assert_allclose(facing.found.covered, area(facing.hosts["x"]), rtol=1e-12)
