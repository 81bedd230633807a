"""Track the state of a linear solver's set-up, to detect when it has aged."""

from dataclasses import dataclass

import numpy as np


@dataclass
class SetUp:
    """The state of the present set-up.

    Attributes:
        usual: Krylov iterations per decimal digit of a full solve with the last new set-up before
            it; 0 without one.
        due: Whether nothing has been solved with it yet.
        kept: Whether it belongs to an earlier matrix.
        rate: Krylov iterations per decimal digit of its first full solve, or ``usual`` if the
            set-up was no longer new; 0 before that.
        excess: Additional Krylov iterations beyond that rate since.
    """

    usual: float = 0.0
    due: bool = True
    kept: bool = False
    rate: float = 0.0
    excess: float = 0.0

    def note(self, iterations: int, rtol: float) -> None:
        """Count a full solve."""
        if not self.kept:
            self.usual = iterations_a_digit(iterations, rtol)
        self.rate = self.rate or self.usual or iterations_a_digit(iterations, rtol)
        self.excess += iterations + self.rate * float(np.log10(rtol))

    def note_correction(self, iterations: int, rtol: float) -> None:
        """Count the solve for a part of a solution, if full solves have defined the rate."""
        usual = self.rate or self.usual
        if usual:
            self.excess += iterations + usual * float(np.log10(rtol))


def iterations_a_digit(iterations: int, rtol: float) -> float:
    """Return the Krylov iterations per decimal digit."""
    return iterations / -float(np.log10(rtol))
