"""What an iterate of the interior point method tells of the limit load of a mesh."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.discrete.locking import locking_bodies
from perfplast_fenicsx.limit_analysis.discrete.point_coordinates import PointCoordinates
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.statements.standing import Standing
from perfplast_fenicsx.mesh_estimate import percent
from perfplast_fenicsx.problem.problem import Problem


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
        has_dead: Whether constant loads are there.
        question: Of which loads the factor was sought: that of the dead ones, where no load grows,
            or no load factor is carried beside them. The mechanism is theirs then, with L₀(v) = 1
            and L₁(v) = 0.
        standing: How many times they are carried, where that was sought.
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
    has_dead: bool = False
    question: Question = Question.LIMIT
    standing: Standing | None = None

    def __repr__(self) -> str:
        numbers = {"lower": self.lower, "estimate": self.estimate, "upper": self.upper}
        told = (f"{name}={'none' if x is None else f'{x:.6g}'}" for name, x in numbers.items())
        return f"DiscreteLimit({', '.join(told)}; {len(self.steps)} steps; {self.reason})"


def why_unbounded(problem: Problem) -> str:
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


def discrete_result(
    problem: Problem,
    program: ConicProgram,
    iteration: InteriorIteration | None,
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
    rtol: float,
    question: Question,
) -> DiscreteLimit:
    """What an iterate tells, its bounds computed anew, wherever it has ended. Collective."""
    mechanism = fem.Function(problem.V, name="mechanism")
    stress = fem.Function(problem.S, name="stress")
    forces: Floats = np.zeros(len(problem.basis.gap))
    lower = upper = estimate = None
    unbalanced = inadmissible = np.inf
    locked: tuple[str, ...] = ()
    if iteration is not None and steps:
        kinematic = (iteration.now.load + iteration.gap()) * program.load_unit
        power = (iteration.size() + iteration.gap()) * program.load_unit
        low = lower_bound(iteration)
        lower, unbalanced = low.value, low.unbalanced
        if lower is None and verdict is Verdict.FOUND:
            reason += "; forces were not brought into balance within yield, so that no load is"
            reason += " surely carried"
        _write_stress(problem, iteration, stress)
        forces = iteration.now.forces * program.force_unit
        if verdict in (Verdict.FOUND, Verdict.STALLED):
            high = upper_bound(iteration)
            upper, inadmissible = high.value, high.inadmissible
            if upper is None:
                locked = locking_bodies(problem, iteration)
                reason += f"; no admissible mechanism was found, {_remedy(problem)}"
                # A mechanism that is less admissible, after it was
                # projected, is none to estimate from.
                nearly = 1e-6
                verdict = verdict if inadmissible <= nearly else Verdict.STALLED
        if verdict is Verdict.FOUND or upper is not None:
            problem.basis.T.mult(iteration.velocity, mechanism.x.petsc_vec)
            mechanism.x.scatter_forward()
            load, _, _ = question.loads(problem.loads.live, problem.loads.dead)
            mechanism.x.array[:] /= float(load.dot(mechanism.x.petsc_vec))
        size = high.size if program.has_dead and upper is not None else abs(lower or 0.0)
        if lower is not None and upper is not None and size > 0:
            apart = f"static and kinematic load are {percent(abs(upper - lower) / size)} apart"
            if verdict is Verdict.STALLED:
                estimate = (lower + upper) / 2
                verdict = Verdict.FOUND if upper - lower <= rtol * size else verdict
            reason = apart if verdict is Verdict.FOUND else f"{reason}; {apart}"
        if verdict is Verdict.FOUND and estimate is None:
            # Excess of an upper bound over the kinematic load of the last step, relative to what a
            # mechanism dissipates, from which on it tells nothing of the limit load: rounding is in
            # it, of the strain of bodies that are far too strong to flow.
            polluted = 0.01
            useful = upper is not None and upper <= kinematic + polluted * power
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
        has_dead=program.has_dead,
    )


def _write_stress(problem: Problem, iteration: InteriorIteration, function: fem.Function) -> None:
    """Write the stress of the iterate into a function of S. Collective."""
    now = iteration.now
    pressure, deviator = iteration.program.whole((now.pressure, now.deviator), now.load)
    count = problem.Q.dofmap.index_map.size_local  # points of friction follow behind them
    found = PointCoordinates(problem).whole(pressure[:count], deviator[:count])
    function.x.array[: found.size] = iteration.program.stress_unit * found.ravel()
    function.x.scatter_forward()
