"""Does a factorisation fit into memory, and what does it cost? MUMPS's analysis, which is quick."""

import math
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.machine_memory import has_memory, spare_memory
from perfplast_fenicsx.solvers.linear.failed_factors import forget_factors

OPERATIONS, ENTRIES = 3, 29
"""MUMPS's numbers of: operations of the factorisation there is, and entries of its factors."""


@dataclass(frozen=True)
class Price:
    """The cost of a factorisation.

    Attributes:
        iterations: CG iterations with multigrid that take as long. The more operations there are
            for an entry of the matrix, the quicker they are: their number's square root is right
            to a factor of 2, for linear and quadratic elements, slender and stout bodies, from 19
            to 270 thousand unknowns (benchmarks/NOTEBOOK.md).
        fits: Whether the ranks have the memory.
    """

    iterations: float
    fits: bool


@dataclass(frozen=True)
class Analysis:
    """The estimates of MUMPS before it factorises.

    Attributes:
        operations: Operations of a factorisation, of all ranks.
        per_entry: The same for an entry of the factors.
        needed: Memory that this rank needs at least (bytes).
    """

    operations: float
    per_entry: float
    needed: float


def price(ksp: PETSc.KSP, matrix: PETSc.Mat) -> Price:
    """Return the price of a factorisation by MUMPS. Collective.

    Args:
        ksp: With its options and operators, not set up yet; it is left so.
        matrix: What would be factorised.
    """
    comm = ksp.comm.tompi4py()
    found = _analyse(ksp)
    fits = comm.allreduce(found.needed / 1e6 <= spare_memory(comm), MPI.LAND)
    entries = matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return Price(math.sqrt(found.operations / max(entries, 1)), fits)


def entries_of(factors: PETSc.Mat, which: int) -> float:
    """Entries of factors by one of MUMPS's numbers, which has millions of them where negative."""
    entries = factors.getMumpsInfog(which)
    return float(entries if entries >= 0 else -1e6 * entries)


def _analyse(ksp: PETSc.KSP) -> Analysis:
    """Analyse a matrix. Collective.

    MUMPS is allowed next to nothing, so that it stops after the analysis.
    """
    pc = ksp.getPC()
    pc.setFactorSetUpSolverType()
    factors = pc.getFactorMatrix()
    # MUMPS's numbers of: more room to work in (%), what a rank needs, and what it may take (MB).
    room, needed, most = 14, 15, 23
    factors.setMumpsIcntl(most, 1)
    ksp.setUp()
    least = factors.getMumpsInfo(needed) * 1e6 / (1 + factors.getMumpsIcntl(room) / 100)
    # MUMPS's numbers of the operations that a factorisation would take, and of its entries.
    estimated_operations, estimated_entries = 1, 20
    operations = factors.getMumpsRinfog(estimated_operations)
    entries = entries_of(factors, estimated_entries)
    forget_factors(ksp)
    return Analysis(operations, operations / max(entries, 1), least)


class TooLarge(InputError):
    """A factorisation that does not fit into memory."""


def check_memory(ksp: PETSc.KSP) -> Analysis | None:
    """Refuse a factorisation that takes more memory than there is, before it starts. Collective.

    Args:
        ksp: With its options and operators, not set up yet; it is left so.

    Returns:
        What MUMPS says; None where another solver is used, which is not asked.

    Raises:
        TooLarge: With what is needed and what there is.
    """
    pc, (matrix, _) = ksp.getPC(), ksp.getOperators()
    if pc.getType() not in ("cholesky", "lu") or pc.getFactorSolverType() != "mumps":
        return None
    found = _analyse(ksp)
    enough, needed, has = has_memory(ksp.comm.tompi4py(), found.needed)
    if not enough:
        raise TooLarge(
            f"a factorisation for {matrix.getSize()[0]} unknowns needs at least"
            f" {needed / 2**30:.3g} GiB of memory, and there are {has / 2**30:.3g}; use a coarser"
            " mesh, or more machines."
        )
    return found
