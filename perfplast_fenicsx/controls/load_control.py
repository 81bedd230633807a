"""Loading by the load factor ζ."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from perfplast_fenicsx.controls.control import Moved, OfLevels, Run, none_moved
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.controls.level_values import check_rising, check_values, follow
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed


@dataclass(frozen=True)
class LoadControl(OfLevels):
    """Loading by the load factor ζ.

    Args:
        values: Load factors, increasing, not negative. Beside constant loads they may be negative
            or fall; ζ = 0 is then solved first.

    Raises:
        InputError: No value at all, or values that are not finite, or neither rise nor fall.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    drives: ClassVar[bool] = False

    values: list[float]

    def __post_init__(self) -> None:
        check_values(self.values, "load factors")

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """None."""
        return none_moved

    def check(self, given: Given) -> None:
        """Refuse bodies that nothing loads, obstacles that move, and unloading from nothing."""
        given.require_load(given.strained or given.settled)
        given.refuse_moves()
        if not given.stays:
            check_rising(self.values, "load factors")

    def find(self, run: Run) -> None:
        """Solve for each load factor. Collective."""
        follow(run, self.values)
