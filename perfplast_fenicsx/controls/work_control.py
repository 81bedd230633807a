"""Apply a loading by prescribed work of the loads, or compute the limit load."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from perfplast_fenicsx.controls.control import (
    Given,
    Moved,
    Run,
    check_rising,
    check_values,
    follow,
    none_moved,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.limit_bounds import bounds_of_mesh
from perfplast_fenicsx.limit_analysis.discrete.limit_load import TOLERANCE, LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.limit_search import check_limit_load, limit_load
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance, ignored
from perfplast_fenicsx.limit_analysis.statements.load_factor import check_design
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class WorkControl:
    """Loading by the work of the loads α = L(u), at given values or up to the limit load.

    Args:
        values: Values of the work, increasing and not negative. With constant loads or moving
            supports the work is α₀ at ζ = 0, and the values may be negative or decrease.
        until: "limit" computes the limit load. With Coulomb's friction it computes the load at
            which the path loses equilibrium.
        limit_tolerance: Relative difference between the bounds on the limit load, or relative
            distance from the limit of ζ(α), between 0 and 1; by default 1e-3. Only with ``until``.
        limit_method: "interior-point" computes only the limit load, in 5 to 30 factorisations;
            "path" follows ζ(α) to its plateau, and chooses its own steps. By default
            "interior-point" if it supports the laws and a factorisation fits in memory; "path" if
            not, if a ``[solve]`` table has keys for a path, or with Coulomb's friction. Only with
            ``until``.
        design: Load factor of the design load, often 1.0; results report the ratio of the limit
            load to the design load. Only with ``until``.

    Raises:
        InputError: If both or neither of ``values`` and ``until`` are given, or if values are out
            of their range.
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
            raise InputError(
                f"[loading] has {what}; give either values = [...] or until = 'limit'."
            )
        if self.values is not None:
            check_values(self.values, "works")
            for key in ("limit_tolerance", "limit_method", "design"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key} applies only to until = 'limit'; remove {key}.")
        else:
            tolerance = TOLERANCE if self.limit_tolerance is None else self.limit_tolerance
            check_tolerance(tolerance)
            check_design(self.design)
            object.__setattr__(self, "limit_tolerance", tolerance)

    def in_turn(self) -> Sequence[Stage]:
        """Return no stages."""
        return ()

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that always returns False."""
        return none_moved

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on data that do not affect the limit load. Collective."""
        return ignored(problem)

    def check(self, given: Given) -> None:
        """Refuse missing live loads, moving obstacles, and unloading without constant loads."""
        given.require_load()
        if self.until is not None:
            given.require_limit()
        given.refuse_moves()
        if not given.stays:
            check_rising(self.values or (), "works")
        if all(load.constant for load in given.loads):
            raise InputError(
                "control = 'work' needs a load that grows, but all loads are constant; "
                "remove constant = true from one of them, or give control = 'load', or "
                "'bounds', which computes the ratio of the collapse load to these loads."
            )

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems whose limit load the method cannot compute. Collective."""
        if self.limit_tolerance is not None:
            check_limit_load(problem, self.limit_tolerance, solver)

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return an empty text, because ζ is a load factor."""
        return ""

    def find(self, run: Run) -> LimitLoad | None:
        """Solve a level for each work, or compute the limit load of the mesh. Collective."""
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
