"""Return the limit load of a mesh for an iterate of the interior point method."""

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import kinematic_load, static_load
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.locking import locking_bodies
from perfplast_fenicsx.limit_analysis.discrete.point_coordinates import PointCoordinates
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.mesh_estimate import percent
from perfplast_fenicsx.problem.problem import Problem


def why_unbounded(problem: Problem) -> str:
    """Return the likely reason why there is no mechanism."""
    if any(on.law.dilates for on in problem.laws):
        return (
            "bodies that dilate as they flow may be confined, so that they carry any load, or"
            " elements have too few motions; leave them room, or use quadratic elements"
        )
    if problem.degree == 1:
        return (
            "linear elements lock in plastic flow, which keeps the volume; use quadratic ones"
            " (degree = 2 under [element]), or the loads are carried by bodies that do not yield"
        )
    return "they are carried by bodies that do not yield, or that cannot flow"


def _remedy(problem: Problem) -> str:
    """Return a remedy for a mesh without an admissible mechanism."""
    if problem.degree == 1:
        return (
            "since linear elements lock; quadratic ones (degree = 2 under [element]) may have one"
        )
    return "though a finer mesh may have one"


def discrete_result(
    problem: Problem,
    program: ConicProgram,
    iteration: InteriorIteration | None,
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
    rtol: float,
    question: Question,
) -> LimitLoad:
    """Return the limit load of an iterate, with bounds computed from its fields. Collective.

    Its ``lower`` is the bound of a stress, −∞ without one; the bound 0 without loads is not yet
    used.
    """
    mechanism = fem.Function(problem.V, name="mechanism")
    stress = fem.Function(problem.S, name="stress")
    forces: Floats = np.zeros(len(problem.basis.gap))
    lower = upper = estimate = None
    unbalanced = inadmissible = np.inf
    locked: tuple[str, ...] = ()
    if iteration is not None and steps:
        kinematic = (iteration.now.load + iteration.gap()) * program.load_unit
        power = (iteration.size() + iteration.gap()) * program.load_unit
        iterate = iteration.now
        low = static_load(iteration)
        lower, unbalanced = low.value, low.unbalanced
        if lower is None and verdict is Verdict.FOUND:
            reason += "; no stress within yield balances the forces, so that no load is"
            reason += " carried for certain"
        _write_stress(problem, iteration, stress)
        forces = iteration.now.forces * program.force_unit
        if verdict in (Verdict.FOUND, Verdict.STALLED):
            iteration.now = iterate  # pairs that push are those before balancing
            high = kinematic_load(iteration)
            upper, inadmissible = high.value, high.inadmissible
            if upper is None:
                locked = locking_bodies(problem, iteration)
                reason += f"; no admissible mechanism was found, {_remedy(problem)}"
                # A mechanism with a larger inadmissible part after the projection gives no
                # estimate.
                nearly = 1e-6
                verdict = verdict if inadmissible <= nearly else Verdict.STALLED
        if verdict is Verdict.FOUND or upper is not None:
            _write_mechanism(problem, iteration, question, mechanism)
        size = high.size if program.has_dead and upper is not None else abs(lower or 0.0)
        if lower is not None and upper is not None and size > 0:
            apart = f"static and kinematic load are {percent(abs(upper - lower) / size)} apart"
            if verdict is Verdict.STALLED:
                estimate = (lower + upper) / 2
                verdict = Verdict.FOUND if upper - lower <= rtol * size else verdict
            reason = apart if verdict is Verdict.FOUND else f"{reason}; {apart}"
        if verdict is Verdict.FOUND and estimate is None:
            # Excess of an upper bound over the last kinematic load, relative to the dissipation:
            # above it the bound contains rounding of bodies that are far too strong to flow.
            polluted = 0.01
            useful = upper is not None and upper <= kinematic + polluted * power
            known = [bound for bound in (lower, upper if useful else None) if bound is not None]
            estimate = sum(known) / len(known) if known else steps[-1].load
    return LimitLoad(
        method=LimitMethod.INTERIOR_POINT,
        lower=-np.inf if lower is None else lower,
        estimate=estimate,
        residual=None,
        upper=upper,
        alpha=None,
        levelled_off=verdict is Verdict.FOUND,
        reason=reason,
        iterations=len(steps),
        linear_solves=program.stiffness.solves,
        factorisations=program.stiffness.factorisations,
        mechanism=mechanism,
        stress=stress,
        contact_forces=forces,
        unbalanced=unbalanced,
        inadmissible=inadmissible,
        verdict=verdict,
        steps=steps,
        locked=locked,
    )


def _write_mechanism(
    problem: Problem, iteration: InteriorIteration, question: Question, mechanism: fem.Function
) -> None:
    """Write the velocity, scaled to the work 1 of the loads, into a function of V. Collective."""
    problem.basis.T.mult(iteration.velocity, mechanism.x.petsc_vec)
    mechanism.x.scatter_forward()
    load, _, _ = question.loads(problem.loads.live, problem.loads.dead)
    mechanism.x.array[:] /= float(load.dot(mechanism.x.petsc_vec))


def _write_stress(problem: Problem, iteration: InteriorIteration, function: fem.Function) -> None:
    """Write the stress of the iterate into a function of S. Collective."""
    now = iteration.now
    pressure, deviator = iteration.program.whole(now.stress, now.load)
    count = problem.Q.dofmap.index_map.size_local  # points of friction follow them
    found = PointCoordinates(problem).whole(pressure[:count], deviator[:count])
    function.x.array[: found.size] = iteration.program.stress_unit * found.ravel()
    function.x.scatter_forward()
