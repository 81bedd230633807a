"""Which pairs of two loads are carried."""

from dataclasses import dataclass, replace
from typing import ClassVar

from perfplast_fenicsx.controls.control import OfBody, Run
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.body.interaction import envelope
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.declared.stage import called


@dataclass(frozen=True)
class EnvelopeControl(OfBody):
    """No loading: bounds of the set of pairs of two loads that are carried.

    Args:
        first: Names of the loads that the first number of a pair multiplies, or their surfaces
            where they have none.
        second: The same of the second number; constant loads are beside any pair.
        until: Distance of the two polygons, relative, at which directions are enough.
        directions: In which limit loads are bounded, at most.
        around: Whether the numbers may be negative; without, they are from 0 on.
        limit_tolerance: How near each bound comes to the best of its kind on its mesh, relative,
            between 0 and 1.

    Raises:
        InputError: A tolerance, or a number of directions, that is none.
    """

    design: ClassVar[None] = None
    together: ClassVar[bool] = False

    first: list[str]
    second: list[str]
    until: float = 0.02
    directions: int = 12
    around: bool = False
    limit_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        if not 0 < self.until < 1:
            raise InputError(f"until = {self.until} is not between 0 and 1; try 0.02.")
        if self.directions < 3:
            raise InputError(f"directions = {self.directions} is too few; give 3 or more.")

    def check(self, given: Given) -> None:
        """Refuse names of no load, loads of both or of neither, and obstacles that move."""
        given.require_load()
        given.refuse_moves()
        known = [called(load) for load in given.loads if not load.constant]
        for key, names in (("first", self.first), ("second", self.second)):
            if not names:
                raise InputError(f"{key} is empty; give the name of a load at least.")
            for name in names:
                if name not in known:
                    raise InputError(
                        f"{key} names '{name}', no load that grows; {nearest(name, known)}"
                    )
        for name in known:
            if (name in self.first) == (name in self.second):
                where = "in both first and second" if name in self.first else "in neither"
                raise InputError(
                    f"the load '{name}' is {where}; give it in one of first and second, or"
                    " constant = true to a load that stays."
                )

    def find(self, run: Run) -> LimitLoad:
        """Bound the limit load in one direction after the other. Collective."""
        growing = [load for load in run.problem.given.loads if not load.constant]
        found = envelope(
            run.problem,
            [load for load in growing if called(load) in self.first],
            [load for load in growing if called(load) in self.second],
            directions=self.directions,
            until=self.until,
            around=self.around,
            rtol=self.limit_tolerance,
            adaptation=run.adapt,
            monitor=run.record.direction,
            steps=run.record.interior,
        )
        run.record.envelope(found, (" + ".join(self.first), " + ".join(self.second)))
        return replace(found.last.mesh, levelled_off=found.gap <= self.until)
