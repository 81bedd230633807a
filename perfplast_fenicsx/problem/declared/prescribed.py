"""Define the quantity that a level prescribes: the load factor ζ or the work of the loads α."""

from enum import Enum
from typing import Protocol


class Loaded(Protocol):
    """An object with a load factor and a work: a state, a level report, an iteration."""

    @property
    def zeta(self) -> float:
        """Return the load factor ζ."""
        ...

    @property
    def alpha(self) -> float:
        """Return the work α."""
        ...


class Prescribed(Enum):
    """The quantity that an algorithm prescribes; the algorithm computes the other quantity.

    Results use the values of this enumeration as names: for an attribute of :class:`state.State`
    and :class:`report.LevelReport`, for a column of ``path.csv``, and for ``prescribed`` in
    ``summary.json``.
    """

    LOAD_FACTOR = "zeta"
    WORK = "alpha"

    def of(self, level: Loaded) -> float:
        """Return the prescribed value of a state, a report or an iteration."""
        return level.zeta if self is Prescribed.LOAD_FACTOR else level.alpha
