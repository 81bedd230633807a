"""Equilibrium of a stress row by row, each in the units of what its rest could hide."""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, rebalance
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram


class StaticIteration(InteriorIteration):
    """The iteration of a stress, whose balance is judged row by row once it has ended.

    While it goes on what is without balance is relative to the loads. In the end it is to be small
    beside the strengths: where hydrostatic pressures are large that is another thing, and where a
    weak body touches a strong one.
    """

    def __init__(self, static: StaticProgram) -> None:
        """As :class:`InteriorIteration`. Collective."""
        super().__init__(static.program)
        self._static = static
        self._rows: Floats | None = None

    def unbalanced(self) -> float:
        """Largest force that nothing balances, relative to loads or strengths. Collective."""
        if self._rows is None:
            return super().unbalanced()
        mine = float((np.abs(self.balance().array_r) / self._rows).max(initial=0.0))
        return float(self.program.comm.allreduce(mine, MPI.MAX)) * self.program.force_unit

    def row_units(self) -> Floats | float:
        """See :meth:`InteriorIteration.row_units`."""
        return super().row_units() if self._rows is None else self._rows

    def settle(self) -> None:
        """Bring stress and loads into balance, row by row, as far as rounding lets. Collective."""
        pressure, _ = self.program.whole(self.now.stress, self.now.load)
        self._rows = self._static.forces_of_strengths(self.program.stress_unit * pressure)
        left = self.unbalanced()
        # Forces without balance, relative to strengths, that need not be
        # corrected: what is left of bounds that have met to 1e-7 is still large
        # beside the sum of them over some thousand rows.
        rounding = 1e-14
        most_corrections = 4  # with the same factors, as long as they halve what is left
        for _ in range(most_corrections):
            if left <= rounding:
                return
            before = left
            self.equilibrate()
            left = self.unbalanced()
            if not left < before / 2:
                break
        # Forces without balance, relative to strengths, that are left to correct with other
        # factors than those of the last step.
        almost_balanced = 1e-13
        if not left <= almost_balanced:
            rebalance(self)
