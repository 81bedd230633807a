"""Test products with blocks of a symmetric matrix against PETSc."""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
from scipy import sparse

from perfplast_fenicsx.solvers.linear.blocked_interpolation import BlockedInterpolation
from perfplast_fenicsx.solvers.linear.blocked_products import BlockedProducts, BlockRows
from perfplast_fenicsx.solvers.linear.blocked_products import sizes as known_sizes
from perfplast_fenicsx.solvers.linear.petsc_calls import Rows

ROUNDING = {np.float32: 1e-6, np.float64: 1e-14}


def symmetric(comm: MPI.Intracomm, size: int, seed: int) -> PETSc.Mat:
    """Return a symmetric matrix of 40 block rows with gaps, distributed over the ranks."""
    rng = np.random.default_rng(seed)
    nodes = sparse.random(40, 40, density=0.15, rng=np.random.default_rng(1))
    entries = sparse.kron(nodes, np.ones((size, size))).tocsr()
    entries.data = rng.normal(size=entries.nnz)
    holes = np.random.default_rng(2).random(entries.nnz) < 0.2
    entries.data[holes] = 0
    entries.eliminate_zeros()
    whole = (entries + entries.T + 10 * sparse.identity(40 * size)).tocsr()
    whole.sort_indices()
    mine = np.array_split(np.arange(40), comm.size)[comm.rank]
    rows = whole[size * mine[0] : size * (mine[-1] + 1)]
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    sizes = (rows.shape[0], None)
    A = PETSc.Mat().createAIJ((sizes, sizes), bsize=size, csr=csr, comm=comm)
    A.assemble()
    return A


def interpolation(comm: MPI.Intracomm, sizes: tuple[int, int], seed: int) -> PETSc.Mat:
    """Return an interpolation from 15 coarse nodes to 40 fine nodes, distributed over the ranks."""
    rng = np.random.default_rng(seed)
    nodes = sparse.random(40, 15, density=0.2, rng=np.random.default_rng(1))
    entries = sparse.kron(nodes, np.ones(sizes)).tocsr()
    entries.data = rng.normal(size=entries.nnz)
    entries.sort_indices()
    fine, coarse = (np.array_split(np.arange(n), comm.size)[comm.rank] for n in (40, 15))
    rows = entries[sizes[0] * fine[0] : sizes[0] * (fine[-1] + 1)]
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    shape = ((rows.shape[0], None), (sizes[1] * len(coarse), None))
    P = PETSc.Mat().createAIJ(shape, csr=csr, comm=comm)
    P.assemble()
    P.setBlockSizes(*sizes)
    return P


@pytest.mark.mpi3("2-float32")
@pytest.mark.parametrize("precision", ROUNDING)
@pytest.mark.parametrize("size", known_sizes())
def test_products_are_those_of_petsc(size: int, precision: type[np.floating]) -> None:
    comm = MPI.COMM_WORLD
    products = None
    for seed in (3, 4):  # filled, and filled again
        A = symmetric(comm, size, seed)
        products = products or BlockedProducts(A, precision)
        products.fill(A)
        x, y = A.createVecs()
        image = y.duplicate()
        rows = np.arange(*A.getOwnershipRange())
        x.array[:] = np.sin(1.0 + rows)
        A.mult(x, y)
        for _ in range(2):  # a product leaves no trace
            products.matrix.mult(x, image)
            image.axpy(-1.0, y)
            assert image.norm() < ROUNDING[precision] * y.norm()
        A.destroy()


@pytest.mark.mpi3
def test_no_block_has_to_be_of_this_rank_or_of_others() -> None:
    comm = MPI.COMM_WORLD
    sizes = (2 * (3 if comm.rank == 0 else 0), None)
    A = PETSc.Mat().createAIJ((sizes, sizes), bsize=2, nnz=2, comm=comm)
    first, last = A.getOwnershipRange()
    for row in range(first, last):
        A.setValue(row, row, 1.0 + row)
    A.assemble()
    products = BlockedProducts(A)
    products.fill(A)
    x, y = A.createVecs()
    x.set(1.0)
    products.matrix.mult(x, y)
    np.testing.assert_allclose(y.array, 1.0 + np.arange(first, last), rtol=1e-14)


@pytest.mark.mpi3("sizes0")
@pytest.mark.parametrize("sizes", [(2, 3), (2, 4), (3, 3), (3, 6), (3, 7), (4, 4), (6, 6), (7, 7)])
def test_interpolations_are_those_of_petsc(sizes: tuple[int, int]) -> None:
    transfer = None
    for seed in (3, 4):  # filled, and filled again
        P = interpolation(MPI.COMM_WORLD, sizes, seed)
        transfer = transfer or BlockedInterpolation(P)
        transfer.fill(P)
        x, y = P.createVecs()
        x.array[:] = np.sin(1.0 + np.arange(*P.getOwnershipRangeColumn()))
        y.array[:] = np.cos(1.0 + np.arange(*P.getOwnershipRange()))
        whole, found = y.duplicate(), y.duplicate()
        P.mult(x, whole)
        transfer.matrix.mult(x, found)
        found.axpy(-1.0, whole)
        assert found.norm() < ROUNDING[np.float32] * whole.norm()
        transfer.matrix.multAdd(x, y, found)
        found.axpy(-1.0, y)
        found.axpy(-1.0, whole)
        assert found.norm() < ROUNDING[np.float32] * (whole.norm() + y.norm())
        expected, found = x.duplicate(), x.duplicate()
        P.multTranspose(y, expected)
        transfer.matrix.multTranspose(y, found)
        found.axpy(-1.0, expected)
        assert found.norm() < ROUNDING[np.float32] * expected.norm()
        total = y.copy()
        transfer.matrix.multAdd(x, total, total)
        total.axpy(-1.0, y)
        total.axpy(-1.0, whole)
        assert total.norm() < ROUNDING[np.float32] * (whole.norm() + y.norm())


def test_who_solves_is_told_of_other_entries() -> None:
    A = symmetric(MPI.COMM_WORLD, 3, 5)
    products = BlockedProducts(A)
    before = products.matrix.stateGet()
    products.fill(A)
    assert products.matrix.stateGet() > before


@pytest.mark.serial
@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("both", [(3, 3), (3, 6)])
def test_entries_where_there_were_none_are_seen(both: tuple[int, int], upper: bool) -> None:
    """Otherwise they would be stored in another block."""
    upper &= both[0] == both[1]

    def rows(column: int) -> Rows:
        """Return one entry in each of the first two block rows; the second is in a given column."""
        starts = np.repeat([0, 1, 2], [1, both[0], 2 * both[0]])
        columns = np.array([0, both[1] * column], dtype=PETSc.IntType)
        return Rows(starts.astype(PETSc.IntType), columns, np.ones(2))

    blocks = BlockRows(MPI.COMM_WORLD, np.float64, both, rows(1), 3 * both[1], upper=upper)
    blocks.fill(rows(1))
    for column in (2, 3):  # an empty place in a block, and a missing block
        with pytest.raises(AssertionError, match="1 entries are outside the first pattern"):
            blocks.fill(rows(column))
