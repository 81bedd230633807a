"""Evaluate the equilibrium of a stress row by row, relative to the strengths at each row."""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, rebalance
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram


class StaticIteration(InteriorIteration):
    """The iteration of a stress, with a measure of equilibrium by rows at its end.

    During the iteration, unbalanced forces are relative to the loads. At the end they must be small
    compared with the strengths. This differs if hydrostatic pressures are large, and where a weak
    body touches a strong one.
    """

    def __init__(self, static: StaticProgram) -> None:
        """Start as :class:`InteriorIteration`. Collective."""
        super().__init__(static.program)
        self._static = static
        self._rows: Floats | None = None

    def unbalanced(self) -> float:
        """Return the largest unbalanced force, relative to loads or strengths. Collective."""
        if self._rows is None:
            return super().unbalanced()
        mine = float((np.abs(self.balance().array_r) / self._rows).max(initial=0.0))
        return float(self.program.comm.allreduce(mine, MPI.MAX)) * self.program.force_unit

    def row_units(self) -> Floats | float:
        """See :meth:`InteriorIteration.row_units`."""
        return super().row_units() if self._rows is None else self._rows

    def settle(self) -> None:
        """Bring stress and loads into balance, row by row, as far as rounding permits.

        Collective.
        """
        pressure, _ = self.program.whole(self.now.stress, self.now.load)
        self._rows = self._static.forces_of_strengths(self.program.stress_unit * pressure)
        left = self.unbalanced()
        # Unbalanced forces, relative to strengths, that need no correction. The residuals of bounds
        # that have met to 1e-7 are still large compared with the sum of these forces over some
        # thousand rows.
        rounding = 1e-14
        most_corrections = 4  # with the same factors, as long as they halve the residual
        for _ in range(most_corrections):
            if left <= rounding:
                return
            before = left
            self.equilibrate()
            left = self.unbalanced()
            if not left < before / 2:
                break
        # Unbalanced forces, relative to strengths, above which other factors than those of the last
        # step correct them.
        almost_balanced = 1e-13
        if not left <= almost_balanced:
            rebalance(self)
