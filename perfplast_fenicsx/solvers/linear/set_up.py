"""The state of a linear solver's set-up, which shows when it has aged."""

from dataclasses import dataclass

import numpy as np


@dataclass
class SetUp:
    """The state of the present set-up.

    Attributes:
        usual: Krylov iterations a decimal digit that a full solve took when the last set-up before
            it was new; 0 if none has.
        due: Nothing has been solved with it yet.
        kept: It is that of an earlier matrix.
        rate: Krylov iterations a decimal digit that its first full solve took, or ``usual`` where
            the set-up was no longer new; 0 before that.
        excess: Krylov iterations beyond that rate which it has cost since.
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
        """Count the solve for a small part of a solution, where full ones show what is usual."""
        usual = self.rate or self.usual
        if usual:
            self.excess += iterations + usual * float(np.log10(rtol))


def iterations_a_digit(iterations: int, rtol: float) -> float:
    """Krylov iterations that a decimal digit took."""
    return iterations / -float(np.log10(rtol))
