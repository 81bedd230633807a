"""Test paths to the limit load on which one body reaches its limit before a gap closes."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Contact, Pressure, Problem, State, Support, limit_load, read_gmsh
from perfplast_fenicsx.solvers.load_stepping import closing_work, has_closed
from tests.models import STEEL

GAP = 0.03


@pytest.fixture
def tubes(shared_tmp_path: Path) -> Problem:
    """Return a tube loosely inside another tube, under internal pressure."""
    file = shared_tmp_path / "tubes.msh"
    if MPI.COMM_WORLD.rank == 0:
        write_thick_tube(file, outer=2.0, interface=1.5, size=0.15, finer=4.0)
    MPI.COMM_WORLD.barrier()
    return Problem(
        read_gmsh(MPI.COMM_WORLD, file),
        {"inner_tube": STEEL, "outer_tube": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam", gap=GAP)],
        degree=2,
    )


@pytest.mark.long
def test_the_path_goes_through_the_gap(tubes: Problem) -> None:
    """The path does not leap across the gap; earlier, 39 Newton steps did so on this mesh."""
    path = limit_load(tubes, method="path")
    direct = limit_load(tubes, method="interior-point")
    assert path.levelled_off
    assert path.estimate is not None
    assert path.estimate == pytest.approx(direct.estimate, rel=1e-3)
    assert max(level.report.newton_iterations for level in path.levels) <= 30
    plateau = [level.report for level in path.levels if level.report.active_contacts == 0]
    assert plateau[-1].zeta < 0.6 * path.estimate  # the inner tube only


def expanded(problem: Problem, by: float) -> State:
    """Return a displacement that only expands the inner tube, by a given amount at the seam."""
    u = fem.Function(problem.V)
    mesh = problem.tagged_mesh
    inner = mesh.cell_tags.find(mesh.volumes["inner_tube"])
    u.interpolate(lambda x: by / 1.5 * x[:2], cells0=inner)
    u.x.scatter_forward()
    nothing = np.zeros(len(problem.basis.gap), dtype=np.bool_)
    return State(u, 1.0, by, nothing)


def test_a_step_ends_where_half_of_the_pairs_close(tubes: Problem) -> None:
    first, second = expanded(tubes, 0.1 * GAP), expanded(tubes, 0.2 * GAP)
    assert closing_work(tubes, first, second, 2.0 * GAP) == pytest.approx(GAP, rel=0.01)
    assert closing_work(tubes, first, second, 0.9 * GAP) == pytest.approx(0.9 * GAP)
    assert closing_work(tubes, second, first, 2.0 * GAP) == pytest.approx(2.0 * GAP)


def test_pairs_that_have_closed(tubes: Problem) -> None:
    apart, touching = expanded(tubes, 0.2 * GAP), expanded(tubes, 1.1 * GAP)
    assert has_closed(tubes, apart, touching)
    assert not has_closed(tubes, apart, apart)
    assert not has_closed(tubes, touching, touching)
