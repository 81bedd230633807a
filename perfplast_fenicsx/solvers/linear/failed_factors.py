"""Remove a failed factorisation before the next one."""

from petsc4py import PETSc


def forget_factors(ksp: PETSc.KSP) -> None:
    """Let a solver analyse and factorise its matrix again. Collective.

    After a zero pivot of MUMPS, PETSc treats the next factorisation as a failed analysis. PETSc
    then does nothing, reports no failure, and solves with missing factors, which is an error
    (INFOG(1) = −3) on all ranks (``MatFactorNumeric_MUMPS``).

    Args:
        ksp: Solver with its operators, which it keeps with its options.
    """
    operators = ksp.getOperators()
    ksp.reset()
    ksp.setOperators(*operators)
