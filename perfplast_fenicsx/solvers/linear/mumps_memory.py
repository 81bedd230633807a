"""Does a factorisation fit into memory? MUMPS tells after its analysis, which is quick."""

from petsc4py import PETSc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.machine_memory import has_memory

ROOM, NEEDED, MOST = 14, 15, 23
"""MUMPS's numbers of: more room to work in (%), what a rank needs, and what it may take (MB)."""


class TooLarge(InputError):
    """What does not fit into memory."""


def check_memory(ksp: PETSc.KSP) -> None:
    """Refuse a factorisation that takes more memory than there is, before it starts. Collective.

    MUMPS is allowed next to nothing, so that it stops after the analysis.

    Args:
        ksp: With its options and operators, not set up yet; it is left so.

    Raises:
        TooLarge: With what is needed and what there is.
    """
    pc, (matrix, _) = ksp.getPC(), ksp.getOperators()
    if pc.getType() not in ("cholesky", "lu") or pc.getFactorSolverType() != "mumps":
        return
    pc.setFactorSetUpSolverType()
    factors = pc.getFactorMatrix()
    factors.setMumpsIcntl(MOST, 1)
    ksp.setUp()
    least = factors.getMumpsInfo(NEEDED) * 1e6 / (1 + factors.getMumpsIcntl(ROOM) / 100)
    ksp.reset()
    ksp.setOperators(matrix)
    enough, needed, has = has_memory(ksp.comm.tompi4py(), least)
    if not enough:
        raise TooLarge(
            f"a factorisation for {matrix.getSize()[0]} unknowns needs at least"
            f" {needed / 2**30:.3g} GiB of memory, and there are {has / 2**30:.3g}; use a coarser"
            " mesh, or more machines."
        )
