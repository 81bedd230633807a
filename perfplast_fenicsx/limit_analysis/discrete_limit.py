"""The limit load of the discrete problem by an interior point method, without a loading path.

Static and kinematic limit load are brought together in 5 to 30 factorisations, whatever the mesh.
The bounds that are returned are those of the *discrete* problem: equilibrium is that of the finite
elements, and yield and dissipation are those of the points of the quadrature.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.discrete_bounds import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.interior_steps import (
    InteriorStep,
    StopSearch,
    Verdict,
    iterate,
)
from perfplast_fenicsx.limit_analysis.limit_checks import (
    check_bodies_have_limits,
    check_friction_has_limits,
    check_proportional,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.limit_program import limit_program
from perfplast_fenicsx.limit_analysis.locking import locking_bodies
from perfplast_fenicsx.limit_analysis.natural_units import (
    UNLIMITED,
    Start,
    choose_units,
    next_start,
)
from perfplast_fenicsx.limit_analysis.point_strains import axial_cone_of
from perfplast_fenicsx.mesh_estimate import percent
from perfplast_fenicsx.problem.problem import Problem

CLOSER = 0.1
"""Share of the tolerance that the steps leave between static and kinematic load: once the mechanism
is admissible, its load is larger."""

NEARLY = 1e-6
"""A mechanism that is less admissible, after it was projected, is none to estimate from."""

POLLUTED = 1.01
"""Ratio of an upper bound to the kinematic load of the last step from which on it tells nothing of
the limit load: rounding is in it, of the strain of bodies that are far too strong to flow."""


@dataclass(frozen=True)
class DiscreteLimit:
    """The limit load of a discretisation.

    Attributes:
        verdict: Whether there is one.
        reason: The same in words.
        lower: λ of a stress in equilibrium and within yield; None where there is none.
        estimate: Between the bounds; None without two, unless found.
        upper: Dissipation of an admissible mechanism with L(v) = 1; None where there is none.
        mechanism: Velocity v of the collapse or of the upper bound, with L(v) = 1; zero where there
            is neither.
        stress: σ at the lower bound, Mandel vectors at the quadrature points; in plane strain the
            stress out of the plane is the one that leaves the most room to yield.
        contact_forces: Forces of the pairs hosted by this rank there, shape (num_pairs,).
        unbalanced: Largest force there that nothing balances, relative to the largest load.
        inadmissible: Volume change of v in plastic bodies, and strain in elastic ones, relative to
            ‖ε(v)‖.
        steps: What was done.
        factorisations: Of a stiffness, the projections included.
        linear_solves: Linear systems solved with them.
        locked: Bodies that have most of what keeps v from being a mechanism, where there is none.
    """

    verdict: Verdict
    reason: str
    lower: float | None
    estimate: float | None
    upper: float | None
    mechanism: fem.Function
    stress: fem.Function
    contact_forces: npt.NDArray[np.float64]
    unbalanced: float
    inadmissible: float
    steps: list[InteriorStep]
    factorisations: int
    linear_solves: int
    locked: tuple[str, ...] = ()

    def __repr__(self) -> str:
        numbers = {"lower": self.lower, "estimate": self.estimate, "upper": self.upper}
        told = (f"{name}={'none' if x is None else f'{x:.6g}'}" for name, x in numbers.items())
        return f"DiscreteLimit({', '.join(told)}; {len(self.steps)} steps; {self.reason})"


def interior_point(
    problem: Problem, rtol: float = 1e-4, monitor: Callable[[InteriorStep], None] | None = None
) -> DiscreteLimit:
    """Find the discrete limit load, its mechanism and its stress. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Largest difference of the bounds, relative.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, supports move or loads are constant, or a
            body's yield set is none that the method knows (:func:`point_strains.axial_cone_of`).
    """
    check_bodies_have_limits(problem)
    check_tolerance(rtol)
    check_proportional(problem)
    check_friction_has_limits(problem)
    found, start = _search(problem, rtol, monitor, Start())
    while start is not None:
        before = found
        found, start = _search(problem, rtol, monitor, start)
        found = _together(before, found)
    return found


def _together(before: DiscreteLimit, after: DiscreteLimit) -> DiscreteLimit:
    """The better one of two searches, with what both have taken."""
    worse = after.verdict is not Verdict.FOUND and after.upper is None
    return replace(
        before if worse and before.upper is not None else after,
        steps=before.steps + after.steps,
        factorisations=before.factorisations + after.factorisations,
        linear_solves=before.linear_solves + after.linear_solves,
    )


def _search(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    start: Start,
) -> tuple[DiscreteLimit, Start | None]:
    """Search from a start, and tell where to begin anew; None to end. Collective."""
    with ExitStack() as made:
        program = limit_program(problem)
        made.callback(program.destroy)
        steps: list[InteriorStep] = []
        if program.degree == program.num_pairs:
            reason = "nothing can yield; give the bodies that may collapse a yield stress"
            return _result(problem, program, None, Verdict.UNBOUNDED, reason, steps, rtol), None
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            found = _result(problem, program, None, Verdict.STALLED, str(failure), steps, rtol)
            return found, next_start(start, program, None, found.verdict, rtol)
        if not limited:
            found = _result(problem, program, None, Verdict.UNBOUNDED, UNLIMITED, steps, rtol)
            return found, next_start(start, program, None, found.verdict, rtol)
        iteration = InteriorIteration(program)
        made.callback(iteration.destroy)
        try:
            verdict, reason = iterate(iteration, rtol, steps, monitor, CLOSER)
        except StopSearch as stop:
            reason = f"the search was stopped after {len(steps)} steps"
            verdict = Verdict.STALLED
            stop.found = _result(problem, program, iteration, verdict, reason, steps, rtol)
            raise
        if verdict is Verdict.UNBOUNDED:
            reason += f": {_why(problem)}"
        then = next_start(start, program, iteration.now, verdict, rtol)
        return _result(problem, program, iteration, verdict, reason, steps, rtol), then


def can_bound(problem: Problem) -> bool:
    """Whether the method knows the yield sets of all bodies."""
    return all(axial_cone_of(on.law) is not None for on in problem.laws)


def _why(problem: Problem) -> str:
    """Why no mechanism is in sight."""
    if any(on.law.dilates for on in problem.laws):
        return (
            "bodies that dilate where they flow may be confined, so that they carry any load, or"
            " elements have too few motions; leave them room, or use quadratic elements"
        )
    if problem.degree == 1:
        return (
            "linear elements lock in plastic flow, which keeps the volume; use quadratic ones"
            " (degree = 2 under [element]), or the loads are borne by bodies that do not yield"
        )
    return "they are borne by bodies that do not yield, or that cannot flow in any way"


def _remedy(problem: Problem) -> str:
    """What may have an admissible mechanism where this mesh has none."""
    if problem.degree == 1:
        return "as linear elements lock; quadratic ones (degree = 2 under [element]) may have one"
    return "though a finer mesh may have one"


def _result(
    problem: Problem,
    program: ConicProgram,
    iteration: InteriorIteration | None,
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
    rtol: float,
) -> DiscreteLimit:
    """What an iterate tells, its bounds computed anew, wherever it has ended. Collective."""
    mechanism = fem.Function(problem.V, name="mechanism")
    stress = fem.Function(problem.S, name="stress")
    forces: Floats = np.zeros(len(problem.basis.gap))
    lower = upper = estimate = None
    unbalanced = inadmissible = np.inf
    locked: tuple[str, ...] = ()
    if iteration is not None and steps:
        low = lower_bound(iteration)
        lower, unbalanced = low.value, low.unbalanced
        if lower is None and verdict is Verdict.FOUND:
            reason += "; forces were not brought into balance, so that no load is surely carried"
        _write_stress(iteration, stress)
        forces = iteration.now.forces * program.force_unit
        if verdict in (Verdict.FOUND, Verdict.STALLED):
            high = upper_bound(iteration)
            upper, inadmissible = high.value, high.inadmissible
            if upper is None:
                locked = locking_bodies(problem, iteration)
                reason += f"; no admissible mechanism was found, {_remedy(problem)}"
                verdict = verdict if inadmissible <= NEARLY else Verdict.STALLED
        if verdict is Verdict.FOUND or upper is not None:
            problem.basis.T.mult(iteration.velocity, mechanism.x.petsc_vec)
            mechanism.x.scatter_forward()
            mechanism.x.array[:] /= problem.loads.alpha(mechanism.x.petsc_vec)
        if lower is not None and upper is not None and lower > 0:
            apart = f"static and kinematic load are {percent(abs(upper - lower) / lower)} apart"
            if verdict is Verdict.STALLED:
                estimate = (lower + upper) / 2
                verdict = Verdict.FOUND if upper - lower <= rtol * lower else verdict
            reason = apart if verdict is Verdict.FOUND else f"{reason}; {apart}"
        if verdict is Verdict.FOUND and estimate is None:
            kinematic = steps[-1].load * (1 + steps[-1].gap)
            useful = upper is not None and upper <= POLLUTED * kinematic
            known = [bound for bound in (lower, upper if useful else None) if bound is not None]
            estimate = sum(known) / len(known) if known else steps[-1].load
    return DiscreteLimit(
        verdict=verdict,
        reason=reason,
        lower=lower,
        estimate=estimate,
        upper=upper,
        mechanism=mechanism,
        stress=stress,
        contact_forces=forces,
        unbalanced=unbalanced,
        inadmissible=inadmissible,
        steps=steps,
        factorisations=program.stiffness.factorisations,
        linear_solves=program.stiffness.solves,
        locked=locked,
    )


def _write_stress(iteration: InteriorIteration, function: fem.Function) -> None:
    """Write the stress of the iterate into a function of S. Collective."""
    now = iteration.now
    space = function.function_space.dofmap
    count = space.index_map.size_local  # points of friction follow behind them
    array = function.x.array[: count * space.index_map_bs].reshape(count, -1)
    pressure, deviator = iteration.program.whole((now.pressure, now.deviator), now.load)
    array[:] = deviator[:count]
    array[:, :3] += pressure[:count, None]
    slopes = iteration.program.strains.slopes[:count]
    if iteration.program.strains.gdim == 2:  # what leaves the most room
        array[:, 2] -= slopes / 2 * np.linalg.norm(deviator[:count], axis=1)
    array *= iteration.program.stress_unit
    function.x.scatter_forward()
