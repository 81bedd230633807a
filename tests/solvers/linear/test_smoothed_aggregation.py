"""Test coarse spaces: their content, and additional motions."""

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx.solvers.linear import smoothed_aggregation
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import CoarseSpaces
from tests.models import two_blocks_problem
from tests.solvers.linear.systems import elastic_operator


@pytest.mark.mpi3
def test_coarse_spaces_hold_what_is_held(multigrid: None) -> None:
    problem = two_blocks_problem(4)
    operator = elastic_operator(problem)
    spaces = CoarseSpaces(problem, operator.nodal())
    finest = spaces.interpolations[0]
    index = problem.basis.index
    before = _row_sizes(finest, index)
    pc = PETSc.PC().create(problem.comm)
    pc.setType("mg")
    pc.setMGLevels(spaces.levels)
    held = index[::2]
    operator.hold(held)
    spaces.project(operator.matrix, held, pc)
    sizes = _row_sizes(finest, index)
    assert not sizes[::2].any()  # assigned, not computed
    assert problem.comm.allreduce(before.sum()) > 0
    np.testing.assert_allclose(sizes[1::2], before[1::2], rtol=1e-14)
    operator.hold(index[:0])
    spaces.project(operator.matrix, index[:0], pc)
    np.testing.assert_allclose(_row_sizes(finest, index), before, rtol=1e-14)


@pytest.mark.parametrize("large", [10**9, 0], ids=["small", "large"])
@pytest.mark.parametrize("flow", ["none", "some"])
def test_coarse_spaces_have_the_motion_that_they_are_given(
    multigrid: None, flow: str, large: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A zero motion adds nothing."""
    monkeypatch.setattr(smoothed_aggregation, "LARGE", large)
    problem = two_blocks_problem(4)
    operator = elastic_operator(problem)
    held = problem.basis.index[::3]
    operator.hold(held)
    motion = problem.loads.live.duplicate()
    nodes = problem.V.tabulate_dof_coordinates()[: motion.getLocalSize() // 3]
    if flow == "some":
        motion.array[:] = np.sin(4 * nodes).ravel()
    motion.array[held] = 0.0
    spaces = CoarseSpaces(problem, operator.nodal())
    left = []
    for _ in range(3):  # the third motion replaces the second
        pc = PETSc.PC().create(problem.comm)
        pc.setType("mg")
        pc.setMGLevels(spaces.levels)
        spaces.project(operator.matrix, held, pc)
        left.append(_energy_beyond(operator.matrix, spaces.interpolations[0], motion))
        spaces.add(motion, operator.nodal)
    if flow == "some":
        assert left[1] < 0.5 * left[0]
        assert left[2] == pytest.approx(left[1], rel=1e-6)
    else:
        assert left == [0.0, 0.0, 0.0]


def _energy_beyond(A: PETSc.Mat, P: PETSc.Mat, y: PETSc.Vec) -> float:
    """Return the energy of the part of y that the columns of P cannot represent."""
    coarse, image = P.createVecs()
    ksp = PETSc.KSP().create(A.comm)
    ksp.setType("cg")
    ksp.getPC().setType("jacobi")
    ksp.setTolerances(rtol=1e-12, max_it=2000)
    operator = A.PtAP(P)
    diagonal = operator.getDiagonal()
    diagonal.array[:] = diagonal.array == 0
    operator.setDiagonal(diagonal, PETSc.InsertMode.ADD_VALUES)
    ksp.setOperators(operator)
    A.mult(y, image)
    P.multTranspose(image, coarse)
    best = coarse.duplicate()
    ksp.solve(coarse, best)
    assert ksp.getConvergedReason() > 0
    P.mult(best, image)
    image.aypx(-1.0, y)
    product = image.duplicate()
    A.mult(image, product)
    return float(image.dot(product))


def _row_sizes(A: PETSc.Mat, local: np.ndarray) -> np.ndarray:
    first = A.getOwnershipRange()[0]
    return np.array([np.abs(A.getRow(first + i)[1]).sum() for i in local])
