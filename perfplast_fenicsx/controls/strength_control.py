"""Compute bounds on the factor of safety on strengths."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from perfplast_fenicsx.controls.control import Given, OfBody, Run, of_other_loads
from perfplast_fenicsx.limit_analysis.body.limit_bounds import check_bounds
from perfplast_fenicsx.limit_analysis.body.safety_factor import factor_of_safety
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import check_stands, weakened
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.limit_analysis.strength_search import check_curve, strength_path
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class StrengthControl(OfBody):
    """Bounds on the factor by which strengths may be divided before collapse.

    The factor divides yield stresses, cohesions and friction coefficients, including the friction
    of contacts and obstacles. Strengths with ``reduced = false`` do not change. All loads are
    constant.

    Args:
        limit_tolerance: Relative distance, between 0 and 1, of each factor from the factor at which
            its bound on the load factor equals 1.
        path: Whether to compute afterwards the curve of the factor F over the work of the loads, by
            Newton's method on the mesh of the upper bound. The plateau of this curve is an
            estimate, not a bound.

    Raises:
        InputError: For a tolerance that is not valid.
    """

    design: ClassVar[None] = None
    divides: ClassVar[bool] = True

    limit_tolerance: float = 1e-3
    path: bool = False

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)

    def check(self, given: Given) -> None:
        """Refuse missing or growing loads, moving obstacles, and bodies that F cannot weaken."""
        given.require_load()
        given.refuse_moves()
        check_stands(given.loads, given.materials, [*given.contacts, *given.obstacles])

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems without a strength to divide, or without bounds. Collective."""
        if self.path:
            check_curve(problem)
        check_bounds(weakened(problem, 1.0), self.limit_tolerance)

    def find(self, run: Run) -> LimitLoad:
        """Compute both bounds, and the curve of the factor if ``path`` is True. Collective."""
        told = (run.adapt, run.record.factor, run.record.interior, run.record.estimate)
        with of_other_loads():  # each factor gives different strengths
            safety = factor_of_safety(run.problem, self.limit_tolerance, *told)
        run.record.safety(safety)
        if self.path:
            path = strength_path(safety.bodies, self.limit_tolerance, run.record.iteration)
            run.record.safety(replace(safety, path=path))
        known = safety.lower is not None and safety.upper is not None
        return replace(safety.last.mesh, levelled_off=known)
