"""Test aggregates: their motions are orthonormal, and include rigid motions of whole bodies."""

from itertools import pairwise
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Contact, Pressure, Problem, Support, read_gmsh
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import Aggregates, aggregate
from tests.models import STEEL, two_blocks_problem

COMM = MPI.COMM_WORLD
FEW = "perfplast_coarse_pc_gamg_coarse_eq_limit"


@pytest.fixture(params=["space", "plane"])
def problem(request: pytest.FixtureRequest, shared_tmp_path: Path) -> Problem:
    if request.param == "space":
        return two_blocks_problem(6)
    path = shared_tmp_path / "tube.msh"
    if COMM.rank == 0:
        write_thick_tube(path, size=0.03, interface=1.15)
    COMM.barrier()
    return Problem(
        read_gmsh(COMM, path),
        {"inner_tube": STEEL, "outer_tube": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
    )


@pytest.fixture
def levels(problem: Problem) -> list[Aggregates]:
    fields = QuadratureFields(problem)
    fields.update()
    PETSc.Options()[FEW] = 60
    try:
        stiffness = Stiffness(fields).assemble(1.0).convert("aij", PETSc.Mat())
        return aggregate(_nodes(problem), stiffness)
    finally:
        PETSc.Options().delValue(FEW)


@pytest.mark.mpi3("space")
def test_each_level_is_coarser(problem: Problem, levels: list[Aggregates]) -> None:
    sizes = [COMM.allreduce(len(level.members)) for level in levels]
    sizes.append(COMM.allreduce(levels[-1].count))
    assert len(sizes) >= 3
    assert all(2 * coarse < fine for fine, coarse in pairwise(sizes))


def test_motions_are_orthonormal(problem: Problem, levels: list[Aggregates]) -> None:
    flow = _vortex(problem)
    for level in levels:
        richer, flow = level.with_motion(flow, COMM)
        Q = richer.interpolation(COMM)
        size = richer.motions.shape[2]
        assert size == level.motions.shape[2] + 1
        product = Q.transposeMatMult(Q)
        pointer, column, value = product.getValuesCSR()
        row = np.repeat(
            np.arange(len(pointer) - 1) + product.getOwnershipRange()[0], np.diff(pointer)
        )
        assert np.abs(value[row != column]).max(initial=0) < 1e-9
        diagonal = value[row == column]
        assert np.abs(diagonal * (1 - diagonal)).max(initial=0) < 1e-9  # a few have no such motion
        assert COMM.allreduce((diagonal > 0.5).sum()) > 0.95 * COMM.allreduce(len(diagonal))


def test_bodies_move_rigidly_and_in_the_given_way(
    problem: Problem, levels: list[Aggregates]
) -> None:
    """Fine unknowns in no aggregate are held, like those at supports."""
    flow = _vortex(problem)
    for level in levels:
        richer, coarse = level.with_motion(flow, COMM)
        assert _lost(richer, flow) < 1e-12
        assert _lost(level, flow[:, : level.motions.shape[1]]) > 1e-3
        flow = coarse
    x = _nodes(problem)
    turn = np.zeros_like(x)
    turn[:, 0], turn[:, 1] = -x[:, 1], x[:, 0]
    assert _lost(levels[0], turn) < 1e-12


def test_a_rigid_motion_adds_none(problem: Problem, levels: list[Aggregates]) -> None:
    richer, coarse = levels[0].with_motion(np.ones_like(_nodes(problem)), COMM)
    assert not richer.motions[..., -1].any()
    assert not coarse[:, -1].any()
    assert np.abs(richer.motions[..., :-1] - levels[0].motions).max(initial=0) < 1e-14


def _nodes(problem: Problem) -> npt.NDArray[np.float64]:
    owned = problem.V.dofmap.index_map.size_local
    return problem.V.tabulate_dof_coordinates()[:owned, : problem.bodies.gdim]


def _vortex(problem: Problem) -> npt.NDArray[np.float64]:
    return np.roll(np.sin(5 * _nodes(problem)), 1, axis=1)


def _lost(level: Aggregates, motion: npt.NDArray[np.float64]) -> float:
    """Return the relative part of a motion that the aggregates cannot represent."""
    Q = level.interpolation(COMM)
    coarse, image = Q.createVecs()
    fine = image.duplicate()
    fine.array[:] = np.where((level.members >= 0)[:, None], motion, 0.0).ravel()
    Q.multTranspose(fine, coarse)
    Q.mult(coarse, image)
    image.axpy(-1.0, fine)
    return float(image.norm() / fine.norm())
