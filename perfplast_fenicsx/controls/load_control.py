"""Apply a loading by prescribed values of the load factor ζ."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from perfplast_fenicsx.controls.control import (
    Given,
    Moved,
    OfLevels,
    Run,
    check_rising,
    check_values,
    follow,
    none_moved,
)
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed


@dataclass(frozen=True)
class LoadControl(OfLevels):
    """Loading by prescribed values of the load factor ζ.

    Args:
        values: Load factors, increasing and not negative. With constant loads they may be negative
            or decrease; the program then solves ζ = 0 first.

    Raises:
        InputError: If there are no values, if a value is not finite, or if the values neither
            increase nor decrease.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    drives: ClassVar[bool] = False

    values: list[float]

    def __post_init__(self) -> None:
        check_values(self.values, "load factors")

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that always returns False."""
        return none_moved

    def check(self, given: Given) -> None:
        """Refuse cases without loads, moving obstacles, and unloading without constant loads."""
        given.require_load(given.strained or given.settled)
        given.refuse_moves()
        if not given.stays:
            check_rising(self.values, "load factors")

    def find(self, run: Run) -> None:
        """Solve a level for each load factor. Collective."""
        follow(run, self.values)
