"""Loading by the work of the loads, or until the limit load."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from perfplast_fenicsx.controls.control import Moved, Run, none_moved
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.controls.level_values import check_rising, check_values, follow
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.limit_bounds import bounds_of_mesh
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.limit_methods import TOLERANCE
from perfplast_fenicsx.limit_analysis.limit_search import check_limit_load, limit_load
from perfplast_fenicsx.limit_analysis.statements.design_factor import check_design
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance, ignored
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class WorkControl:
    """Loading by the work of the loads α = L(u), with given values or until the limit load.

    Args:
        values: Works, increasing, not negative. Beside constant loads and supports that move, where
            α = α₀ at ζ = 0, they may be negative or fall.
        until: "limit" seeks the limit load, or with Coulomb's friction the load at which the path
            loses equilibrium.
        limit_tolerance: How near to each other its bounds must be, or to its limit ζ(α), relative,
            between 0 and 1; 1e-3 where it is not given. With ``until`` only.
        limit_method: "interior-point" finds the limit load alone, in 5 to 30 factorisations;
            "path" follows ζ(α), by steps of its own, until it has levelled off. The default is the
            former where it knows the laws and a factorisation fits, unless there is a [solve] to
            follow a path with or Coulomb's friction. With ``until`` only.
        design: Load factor of the load that the bodies are designed for, often 1.0: results report
            how many times it is carried. With ``until`` only.

    Raises:
        InputError: Not exactly one of ``values`` and ``until``, or values out of their range.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.WORK
    element: ClassVar[Mapping[str, Any]] = {}
    drives: ClassVar[bool] = False
    together: ClassVar[bool] = True
    of_body: ClassVar[bool] = False
    divides: ClassVar[bool] = False

    values: list[float] | None = None
    until: Literal["limit"] | None = None
    limit_tolerance: float | None = None
    limit_method: Literal["interior-point", "path"] | None = None
    design: float | None = None

    def __post_init__(self) -> None:
        if (self.values is None) == (self.until is None):
            what = "neither values nor until" if self.values is None else "both values and until"
            raise InputError(f"there is {what}; give either values = [...] or until = 'limit'.")
        if self.values is not None:
            check_values(self.values, "works")
            for key in ("limit_tolerance", "limit_method", "design"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key} goes with until = 'limit'; leave it out.")
        else:
            tolerance = TOLERANCE if self.limit_tolerance is None else self.limit_tolerance
            check_tolerance(tolerance)
            check_design(self.design)
            object.__setattr__(self, "limit_tolerance", tolerance)

    def in_turn(self) -> Sequence[Stage]:
        """None."""
        return ()

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """None."""
        return none_moved

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on data that do not change the limit load. Collective."""
        return ignored(problem)

    def check(self, given: Given) -> None:
        """Refuse loads that do not grow, obstacles that move, and unloading from nothing."""
        given.require_load()
        given.refuse_moves()
        if not given.stays:
            check_rising(self.values or (), "works")
        if all(load.constant for load in given.loads):
            raise InputError(
                "control = 'work' goes with a load that grows, but all loads are constant; take"
                " constant = true from one of them, or give control = 'load', or 'bounds', which"
                " bounds how many times they are carried."
            )

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems without a limit load that the method can find. Collective."""
        if self.limit_tolerance is not None:
            check_limit_load(problem, self.limit_tolerance, solver)

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return no sentence: ζ is a load factor."""
        return ""

    def find(self, run: Run) -> LimitLoad | None:
        """Solve for each work, or find the limit load of the mesh. Collective."""
        record, rtol = run.record, self.limit_tolerance
        if rtol is None:
            follow(run, self.values or ())
            return None
        if run.solver is None:
            direct = LimitMethod.INTERIOR_POINT
            limit = limit_load(run.problem, rtol, method=direct, monitor=record.interior)
            record.limit(limit, bounds_of_mesh(run.problem, limit))
            return limit
        limit = limit_load(
            run.problem,
            rtol,
            run.solver,
            monitor=record.iteration,
            on_level=record.level,
            search=run.search,
            reached=run.reached,
        )
        record.limit(limit)
        return limit
