"""Removal of a failed factorisation before the next one."""

from petsc4py import PETSc


def forget_factors(ksp: PETSc.KSP) -> None:
    """Let a solver analyse and factorise its matrix again. Collective.

    Where MUMPS has met a zero pivot, PETSc takes that for a failure of the analysis when it is to
    factorise again. It then does nothing, reports no failure, and solves with factors that are not
    there, which is a fault (INFOG(1) = −3) on all ranks (``MatFactorNumeric_MUMPS``).

    Args:
        ksp: With its operators; it keeps them and its options.
    """
    operators = ksp.getOperators()
    ksp.reset()
    ksp.setOperators(*operators)
