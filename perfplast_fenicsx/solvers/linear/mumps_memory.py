"""Estimate whether a factorisation fits into memory, and its cost.

The estimate is MUMPS's analysis, which is fast.
"""

import math
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.machine_memory import has_memory, spare_memory
from perfplast_fenicsx.solvers.linear.failed_factors import forget_factors

OPERATIONS, ENTRIES = 3, 29
"""MUMPS's indices of the operations of the present factorisation, and of the entries of its
factors."""


@dataclass(frozen=True)
class Price:
    """The cost of a factorisation.

    Attributes:
        iterations: Number of multigrid CG iterations that take as long. Operations are faster, the
            more of them there are per matrix entry: the square root of their number is accurate to
            a factor of 2, for linear and quadratic elements, slender and stout bodies, from 19 to
            270 thousand unknowns (benchmarks/NOTEBOOK.md).
        fits: Whether the ranks have enough memory.
    """

    iterations: float
    fits: bool


@dataclass(frozen=True)
class Analysis:
    """MUMPS's estimates before a factorisation.

    Attributes:
        operations: Operations of a factorisation on all ranks.
        per_entry: Operations per entry of the factors.
        needed: Least memory that this rank needs (bytes).
    """

    operations: float
    per_entry: float
    needed: float


def price(ksp: PETSc.KSP, matrix: PETSc.Mat) -> Price:
    """Return the price of a factorisation by MUMPS. Collective.

    Args:
        ksp: Solver with its options and operators, not set up; it is left in this state.
        matrix: Matrix to be factorised.
    """
    comm = ksp.comm.tompi4py()
    found = _analyse(ksp)
    fits = comm.allreduce(found.needed / 1e6 <= spare_memory(comm), MPI.LAND)
    entries = matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return Price(math.sqrt(found.operations / max(entries, 1)), fits)


def entries_of(factors: PETSc.Mat, which: int) -> float:
    """Return entries of factors by one of MUMPS's indices, which are millions if negative."""
    entries = factors.getMumpsInfog(which)
    return float(entries if entries >= 0 else -1e6 * entries)


def _analyse(ksp: PETSc.KSP) -> Analysis:
    """Analyse a matrix. Collective.

    MUMPS gets almost no memory, so that it stops after the analysis.
    """
    pc = ksp.getPC()
    pc.setFactorSetUpSolverType()
    factors = pc.getFactorMatrix()
    # MUMPS's indices: additional working space (%), memory that a rank needs, and memory that it
    # may use (MB).
    room, needed, most = 14, 15, 23
    factors.setMumpsIcntl(most, 1)
    ksp.setUp()
    least = factors.getMumpsInfo(needed) * 1e6 / (1 + factors.getMumpsIcntl(room) / 100)
    # MUMPS's indices of the operations of a factorisation, and of its entries.
    estimated_operations, estimated_entries = 1, 20
    operations = factors.getMumpsRinfog(estimated_operations)
    entries = entries_of(factors, estimated_entries)
    forget_factors(ksp)
    return Analysis(operations, operations / max(entries, 1), least)


class TooLarge(InputError):
    """Raised for a factorisation that does not fit into memory."""


def check_memory(ksp: PETSc.KSP) -> Analysis | None:
    """Refuse a factorisation that needs more memory than is available, before it starts.

    Collective.

    Args:
        ksp: Solver with its options and operators, not set up; it is left in this state.

    Returns:
        MUMPS's analysis; None for another solver, which is not checked.

    Raises:
        TooLarge: With the needed and the available memory.
    """
    pc, (matrix, _) = ksp.getPC(), ksp.getOperators()
    if pc.getType() not in ("cholesky", "lu") or pc.getFactorSolverType() != "mumps":
        return None
    found = _analyse(ksp)
    enough, needed, has = has_memory(ksp.comm.tompi4py(), found.needed)
    if not enough:
        raise TooLarge(
            f"a factorisation for {matrix.getSize()[0]} unknowns needs at least "
            f"{needed / 2**30:.3g} GiB of memory, but {has / 2**30:.3g} GiB are available; "
            "use a coarser mesh, or more machines."
        )
    return found
