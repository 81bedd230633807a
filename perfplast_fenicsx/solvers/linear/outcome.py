"""Store the outcome of a linear solve, which every method returns."""

from dataclasses import dataclass

from petsc4py import PETSc

from perfplast_fenicsx.profiling import phase


@dataclass(frozen=True)
class Outcome:
    """The outcome of one solve, the same on every rank.

    Attributes:
        iterations: Number of Krylov iterations; 1 for a factorisation.
        failure: Reason, in words, why x is not a solution; None if x is a solution.
    """

    iterations: int
    failure: str | None = None

    @property
    def solved(self) -> bool:
        """Return whether x is a solution."""
        return self.failure is None


def run(ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> Outcome:
    """Renew the set-up if it is due, and solve; both are timed as separate phases. Collective."""
    _set_up(ksp)
    _iterate(ksp, b, x)
    reason = int(ksp.getConvergedReason())
    failure = None if reason > 0 else _REASONS.get(reason, str(reason))
    return Outcome(int(ksp.getIterationNumber()), failure)


@phase("linear set-up")
def _set_up(ksp: PETSc.KSP) -> None:
    ksp.setUp()


@phase("linear solve")
def _iterate(ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
    ksp.solve(b, x)


_REASONS = {
    value: name.lower().replace("_", " ")
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if isinstance(value, int)
}
