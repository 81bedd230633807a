"""Define the load factor that is sought: that of live loads, or that of permanent ones."""

from enum import StrEnum

from petsc4py import PETSc


class Question(StrEnum):
    """The question of a limit analysis.

    If permanent loads L₀ are too large by themselves, no factor of the live loads L₁ is carried. A
    limit load measures the excess: the largest μ for which μL₀ + λL₁ is carried with any λ. Its
    mechanisms have L₀(v) = 1 and L₁(v) = 0. If μ < 1, the strengths are too small by the factor
    1/μ.
    """

    LIMIT = "limit"
    STANDS = "stands"

    @property
    def enough(self) -> float:
        """The factor up to which a search continues, even beyond that of a viscous flow.

        Permanent loads are carried if their factor is 1. Below 1 the search must
        distinguish little strength from none.
        """
        return 4.0 if self is Question.STANDS else 0.0

    def loads(self, live: PETSc.Vec, dead: PETSc.Vec) -> tuple[PETSc.Vec, PETSc.Vec, PETSc.Vec]:
        """Return the loads whose factor is sought, the permanent ones, and those of any factor.

        Collective.

        Missing loads are vectors of zeros.
        """
        none = live.duplicate()
        none.set(0.0)
        return (live, dead, none) if self is Question.LIMIT else (dead, none, live)

    def of(self, live: float, dead: float) -> tuple[float, float, float]:
        """Return the numbers of these loads, such as works, in the same order."""
        return (live, dead, 0.0) if self is Question.LIMIT else (dead, 0.0, live)
