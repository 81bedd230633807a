"""Combine stresses in equilibrium with their loads by weighted means.

With permanent loads, a stress that has left yield cannot be scaled down. But the mean of two
stresses in equilibrium is in equilibrium with the mean of their load factors, and yield sets are
convex. A share of a stress well inside brings back one that has left yield by little. This costs
less than a new search.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram


@dataclass(frozen=True, eq=False)
class BalancedStress:
    """A stress at the points of a static program, in the user's units.

    Attributes:
        pressure: Mean stress in the coordinates of the cones, shape (count,).
        deviator: Deviator in these coordinates, shape (count, m).
        load: Load factor λ.
        aside: Factor of the loads of any factor.
    """

    pressure: Floats
    deviator: Floats
    load: float
    aside: float

    def part(self, share: float) -> "BalancedStress":
        """Return a share of the stress, in equilibrium with the same share of the loads."""
        return BalancedStress(*(share * it for it in vars(self).values()))

    def over(self, static: StaticProgram) -> float:
        """Return the relative excess over yield; negative inside. Collective."""
        scale = 1 / static.program.stress_unit
        return static.program.overstress((scale * self.pressure, scale * self.deviator)) - 1

    def with_some_of(
        self, others: "Sequence[BalancedStress]", static: StaticProgram
    ) -> "BalancedStress":
        """Return the best mean within yield of this stress, which is, and another, which is not.

        Collective.

        Args:
            others: Stresses that have left yield.
            static: The conditions.

        Returns:
            The mean with the largest load; this stress if none has a larger one.
        """
        best, room = self, -self.over(static)
        for other in others if room > 0 else ():
            beyond = other.over(static)
            rounding = 1e-3  # additional share of the stress inside
            share = min(1.0, (1 + rounding) * beyond / (beyond + room))
            mean = self.mean(other, share)
            if mean.load > best.load and mean.over(static) <= 0:
                best = mean
        return best

    def mean(self, other: "BalancedStress", share: float) -> "BalancedStress":
        """Return the mean of this stress, with the given share, and another."""
        rest = 1 - share
        return BalancedStress(
            share * self.pressure + rest * other.pressure,
            share * self.deviator + rest * other.deviator,
            share * self.load + rest * other.load,
            share * self.aside + rest * other.aside,
        )
