"""The quantity that a level prescribes: the load factor ζ or the work of the loads α."""

from enum import Enum
from typing import Protocol


class Loaded(Protocol):
    """Anything with a load factor and a work: a state, the report of a level, an iteration."""

    @property
    def zeta(self) -> float:
        """Load factor ζ."""
        ...

    @property
    def alpha(self) -> float:
        """Work α."""
        ...


class Prescribed(Enum):
    """The prescribed quantity of an algorithm; it finds the other one.

    The values are the names by which results are filed: an attribute of :class:`state.State` and
    :class:`report.LevelReport`, a column of ``path.csv``, ``prescribed`` in ``summary.json``.
    """

    LOAD_FACTOR = "zeta"
    WORK = "alpha"

    def of(self, level: Loaded) -> float:
        """Return the prescribed value of a state, a report or an iteration."""
        return level.zeta if self is Prescribed.LOAD_FACTOR else level.alpha
