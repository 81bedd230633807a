"""Compute which multiples of two or three loads the bodies carry."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from perfplast_fenicsx.controls.control import Given, OfBody, Run, of_other_loads
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.body.interaction import Progress, envelope
from perfplast_fenicsx.limit_analysis.body.limit_bounds import check_bounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class EnvelopeControl(OfBody):
    """Inner and outer bounds on the multiples of two or three loads that the bodies carry.

    Args:
        first: Names of the loads that the first factor multiplies; a load without a name has the
            name of its surface.
        second: Names of the loads that the second factor multiplies. Constant loads have their full
            value for all factors.
        third: Names of the loads that the third factor multiplies; without this key there are two
            factors.
        until: Relative distance between the inner and outer polygon (polytope for three factors) at
            which the search ends.
        directions: Largest number of directions in which the program computes bounds on the limit
            load.
        around: True if all factors may be negative, or the names of loads whose factor may be
            negative; by default all factors are at least 0.
        limit_tolerance: Permitted relative distance of each bound from the best of its kind on its
            mesh, between 0 and 1.

    Raises:
        InputError: For a tolerance, or a number of directions, that is not valid.
    """

    design: ClassVar[None] = None
    together: ClassVar[bool] = False

    first: list[str]
    second: list[str]
    third: list[str] | None = None
    until: float = 0.02
    directions: int = 12
    around: bool | list[str] = False
    limit_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        if not 0 < self.until < 1:
            raise InputError(f"until = {self.until} is not between 0 and 1; try 0.02.")
        if self.directions < 3:
            raise InputError(f"directions = {self.directions} is too few; give 3 or more.")

    @property
    def named(self) -> dict[str, list[str]]:
        """Return the names of the loads that each factor multiplies, by the key of the factor."""
        two = {"first": self.first, "second": self.second}
        return two if self.third is None else two | {"third": self.third}

    @property
    def signed(self) -> tuple[bool, ...]:
        """Return for each factor whether it may be negative."""
        if isinstance(self.around, bool):
            return (self.around,) * len(self.named)
        return tuple(bool({*names} & {*self.around}) for names in self.named.values())

    def check(self, given: Given) -> None:
        """Refuse unknown names, loads that are not in exactly one list, and moving obstacles."""
        given.require_load()
        given.require_limit()
        given.refuse_moves()
        known = [called(load) for load in given.loads if not load.constant]
        signs = {} if isinstance(self.around, bool) else {"around": self.around}
        for key, names in (self.named | signs).items():
            if not names:
                raise InputError(f"{key} is empty; give the name of at least one load.")
            for name in names:
                if name not in known:
                    raise InputError(
                        f"{key} contains '{name}', which is not a load that grows; "
                        f"{nearest(name, known)}"
                    )
        keys = " or ".join(self.named) if self.third is None else "first, second or third"
        for name in known:
            where = [key for key, names in self.named.items() if name in names]
            if len(where) != 1:
                said = f"in both {where[0]} and {where[1]}" if where else f"not in {keys}"
                raise InputError(
                    f"the load '{name}' is {said}; list it exactly once, or set constant = true if "
                    "no factor multiplies the load."
                )

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems for which bounds of the body are not available. Collective."""
        check_bounds(problem, self.limit_tolerance)

    def find(self, run: Run) -> LimitLoad:
        """Compute bounds on the limit load in one direction after another. Collective."""
        growing = [load for load in run.problem.given.loads if not load.constant]
        named = self.named.values()
        groups = [[load for load in growing if called(load) in names] for names in named]
        with of_other_loads():  # each direction has different loads
            found = envelope(
                run.problem,
                groups,
                directions=self.directions,
                until=self.until,
                around=self.signed,
                rtol=self.limit_tolerance,
                adaptation=run.adapt,
                progress=Progress(run.record.direction, run.record.interior, run.directions),
            )
        run.record.envelope(found, [" + ".join(names) for names in named])
        return replace(found.last.mesh, levelled_off=found.gap <= self.until)
