"""Apply a loading by prescribed motions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from perfplast_fenicsx.controls.control import (
    Given,
    Moved,
    OfLevels,
    Run,
    all_moved,
    check_values,
    follow,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.solvers.load_stepping import stroke


@dataclass(frozen=True)
class DisplacementControl(OfLevels):
    """Loading by prescribed motions: ζ multiplies the motions of supports and obstacles.

    Args:
        values: Load factors, in increasing or in decreasing order.
        until: The last load factor, not 0; the program chooses the load factors before it, starting
            from first yield.

    Raises:
        InputError: If both or neither of ``values`` and ``until`` are given, or if values are out
            of their range.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    drives: ClassVar[bool] = True

    values: list[float] | None = None
    until: float | None = None

    def __post_init__(self) -> None:
        if (self.values is None) == (self.until is None):
            what = "neither values nor until" if self.values is None else "both values and until"
            raise InputError(f"[loading] has {what}; give either values = [...] or until = 1.0.")
        if self.values is not None:
            check_values(self.values, "load factors", "or all decrease")
        elif self.until == 0 or not math.isfinite(self.until or 0.0):
            raise InputError(
                f"until = {self.until} is not a valid load factor; give a finite number other than "
                "0."
            )

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that always returns True."""
        return all_moved

    def check(self, given: Given) -> None:
        """Refuse loads that grow, and cases without motions."""
        for load in given.loads:
            if not load.constant:
                raise InputError(
                    "control = 'displacement' moves supports and obstacles, but the load on "
                    f"'{load.on}' would grow; set constant = true for this load, or give control = "
                    "'load'."
                )
        if not given.moving:
            raise InputError(
                "control = 'displacement' needs a motion, but the case defines no motion; give a "
                "[[support]] a value, an [[obstacle]] a move, a [[rigid_surface]] a displacement "
                "or rotation, or a [[contact]] interference = true and constant = false."
            )

    def find(self, run: Run) -> None:
        """Solve a level for each load factor. Collective."""
        follow(run, self.values or stroke(run.solver, self.until or 0.0))
