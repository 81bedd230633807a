"""Points of an iterate where bodies dilate: their cone (γ − αp, s) bounds the mean stress as well.

The rates of such a point are z = (w tr ε/α, −w dev ε), and with the scaling W of Nesterov and Todd
the members change by dS = W r − W² dz where the products are to change by W z ∘ r: dp = −dS₀/α.
"""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.conic_unknowns import Unknowns
from perfplast_fenicsx.limit_analysis.conic.discretisation import Moduli
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import Scaling


class DilatingPoints:
    """The points of this rank with α > 0.

    Attributes:
        among: Which of the round points they are.
        at: Their numbers among all points.
        off: By how much z differs from the rates of the velocity, shape (num, 1 + m).
    """

    among: npt.NDArray[np.bool_]
    at: npt.NDArray[np.int64]
    off: Floats

    def __init__(
        self, program: ConicProgram, now: Unknowns, trace: Floats, deviator: Floats
    ) -> None:
        """Find the scaling of their cones. Not collective.

        Args:
            program: The program that was solved.
            now: The iterate.
            trace: Trace of the strain rate of its velocity, at all points.
            deviator: As ``trace``.
        """
        self.among = program.dilating
        self.at = np.arange(program.strains.count)[program.round][self.among]
        self._slopes, self._weights = program.slopes[self.among], program.weights[self.at]
        self._scaling = Scaling(now.S[self.among], now.Z[self.among])
        self.off = now.Z[self.among] - self.rates(trace, deviator)

    def moduli(self, moduli: Moduli) -> Moduli:
        """Return those of all points, with κ and b of these."""
        bulk, along = moduli.bulk.copy(), np.zeros_like(moduli.normal)
        bulk[self.at], along[self.at] = self._scaling.coupled(self._slopes)
        return Moduli(bulk, moduli.a, moduli.normal, along)

    def rates(self, trace: Floats, deviator: Floats) -> Floats:
        """Z of a strain rate at all points, shape (num, 1 + m)."""
        heads = self._weights * trace[self.at] / self._slopes
        return np.column_stack([heads, -self._weights[:, None] * deviator[self.at]])

    def members(self, rates: Floats, aim: Floats | None = None) -> Floats:
        """Return how the cones' members change with their rates, shape (num, 1 + m).

        Args:
            rates: dz.
            aim: r at all round points; none for zero.
        """
        scaled = -self._scaling.apply(rates)
        return self._scaling.apply(scaled if aim is None else scaled + aim[self.among])

    def put(self, members: Floats, pressure: Floats, deviator: Floats) -> None:
        """Write the change of the stress into arrays of all points."""
        pressure[self.at] = -members[:, 0] / self._slopes
        deviator[self.at] = members[:, 1:]
