"""The load factor that is sought beside permanent loads, and loads of any factor."""

from enum import StrEnum

from petsc4py import PETSc


class Question(StrEnum):
    """The question of a limit analysis.

    Beside dead loads L₀ that are too much by themselves no factor of the live ones L₁ is carried.
    How much too much is a limit load as well: the largest μ for which μL₀ + λL₁ is carried with any
    λ, whose mechanisms have L₀(v) = 1 and L₁(v) = 0. Where μ < 1 the strengths fall short by 1/μ.
    """

    LIMIT = "limit"
    STANDS = "stands"

    @property
    def enough(self) -> float:
        """A factor up to which a search goes on, however far beyond that of a viscous flow it is.

        Constant loads are carried or not: whether by little strength or by none matters below 1.
        """
        return 4.0 if self is Question.STANDS else 0.0

    def loads(self, live: PETSc.Vec, dead: PETSc.Vec) -> tuple[PETSc.Vec, PETSc.Vec, PETSc.Vec]:
        """Those whose factor is sought, those that stay, and those whose factor may be any.

        Vectors of zeros take the place of those that there are none of. Collective.
        """
        none = live.duplicate()
        none.set(0.0)
        return (live, dead, none) if self is Question.LIMIT else (dead, none, live)

    def of(self, live: float, dead: float) -> tuple[float, float, float]:
        """Return the same of numbers, such as works."""
        return (live, dead, 0.0) if self is Question.LIMIT else (dead, 0.0, live)
