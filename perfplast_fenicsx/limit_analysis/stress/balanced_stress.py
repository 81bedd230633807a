"""Stresses in equilibrium with their loads, and weighted means of two of them.

Beside constant loads a stress that has left yield cannot be made smaller. But the mean of two that
are in equilibrium is so with the mean of their load factors, and yield sets are convex: some of a
stress that is well inside brings one back that has left yield by little, and costs less than the
search for the former.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram


@dataclass(frozen=True, eq=False)
class BalancedStress:
    """A stress at the points of a static program, in the user's units.

    Attributes:
        pressure: In the coordinates of the cones, shape (count,).
        deviator: The same, shape (count, m).
        load: λ.
        aside: Factor of the loads of any factor.
    """

    pressure: Floats
    deviator: Floats
    load: float
    aside: float

    def part(self, share: float) -> "BalancedStress":
        """Return a part of it, which is in equilibrium with the same part of the loads."""
        return BalancedStress(*(share * it for it in vars(self).values()))

    def over(self, static: StaticProgram) -> float:
        """By how much it has left yield, relative; negative inside. Collective."""
        scale = 1 / static.program.stress_unit
        return static.program.overstress((scale * self.pressure, scale * self.deviator)) - 1

    def with_some_of(
        self, others: "Sequence[BalancedStress]", static: StaticProgram
    ) -> "BalancedStress":
        """Return the mean within yield of this one, which is, and one that is not. Collective.

        Args:
            others: Those that have left yield.
            static: The conditions.

        Returns:
            That with the largest load; this one where none has a larger one.
        """
        best, room = self, -self.over(static)
        for other in others if room > 0 else ():
            beyond = other.over(static)
            rounding = 1e-3  # more of the stress that is inside than has to be
            share = min(1.0, (1 + rounding) * beyond / (beyond + room))
            mean = self.mean(other, share)
            if mean.load > best.load and mean.over(static) <= 0:
                best = mean
        return best

    def mean(self, other: "BalancedStress", share: float) -> "BalancedStress":
        """So much of this one, and the rest of another."""
        rest = 1 - share
        return BalancedStress(
            share * self.pressure + rest * other.pressure,
            share * self.deviator + rest * other.deviator,
            share * self.load + rest * other.load,
            share * self.aside + rest * other.aside,
        )
