"""The limit load of the discrete problem by an interior point method, without a loading path.

Static and kinematic limit load are brought together in 10 to 30 factorisations, whatever the mesh.
The bounds that are returned are those of the *discrete* problem: equilibrium is that of the finite
elements, and yield and dissipation are those of the points of the quadrature.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic_stiffness import SingularStiffness
from perfplast_fenicsx.limit_analysis.discrete_bounds import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.limit_program import LimitProgram
from perfplast_fenicsx.problem.problem import Problem

MOST_STEPS = 60

NEARLY = 1e-6
"""A mechanism that is less admissible, after it was projected, is none to estimate from."""

CLOSER = 0.1
"""Share of the tolerance that the steps leave between static and kinematic load."""

SETTLED = 1e-5
"""Forces without balance, and work that is missing, that the bounds then do away with."""

ALMOST = 1e-3
"""The same where no bound is sought; a velocity that is less admissible is far from a mechanism."""

FAR = 50.0
"""A load so many times that of a viscous flow, without any mechanism in sight, has no bound."""

NOTHING = 1e-7
"""A load below this share of that of a viscous flow is none."""

STUCK = 1e-6
"""Length of a step that counts as none."""


class Verdict(StrEnum):
    """What came of the search for a limit load."""

    FOUND = "found"
    UNBOUNDED = "unbounded"
    NO_RESISTANCE = "no resistance"
    STALLED = "stalled"


@dataclass(frozen=True)
class InteriorStep:
    """One step of the method.

    Attributes:
        number: From 1.
        load: λ of the stress, a lower bound once forces balance.
        gap: What λ of the velocity exceeds it by, relative, once that is admissible.
        unbalanced: Largest force that nothing balances, relative to the largest of the loads.
        inadmissible: Volume change of v in plastic bodies, and strain in elastic ones, relative to
            ‖ε(v)‖.
        length: Of the step, at most 1.
        seconds: Wall time so far.
    """

    number: int
    load: float
    gap: float
    unbalanced: float
    inadmissible: float
    length: float
    seconds: float


@dataclass(frozen=True)
class DiscreteLimit:
    """The limit load of a discretisation.

    Attributes:
        verdict: Whether there is one.
        reason: The same in words.
        lower: λ of a stress in equilibrium and within yield; None where there is none.
        estimate: Between the bounds; None unless found.
        upper: Dissipation of an admissible mechanism with L(v) = 1; None where there is none.
        mechanism: Velocity v of the collapse or of the upper bound, with L(v) = 1; zero where there
            is neither.
        stress: σ at the lower bound, Mandel vectors at the quadrature points; in plane strain the
            stress out of the plane is the mean of those in it.
        contact_forces: Forces of the pairs hosted by this rank there, shape (num_pairs,).
        unbalanced: Largest force there that nothing balances, relative to the largest load.
        inadmissible: Volume change of v in plastic bodies, and strain in elastic ones, relative to
            ‖ε(v)‖.
        steps: What was done.
        factorisations: Of a stiffness, the projections included.
        linear_solves: Linear systems solved with them.
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
            body's yield set is none that the method knows (:meth:`Law.cone`).
    """
    if not 0 < rtol < 1:
        raise InputError(f"limit_tolerance = {rtol} is not between 0 and 1; try 1e-4.")
    if problem.moves_supports or not problem.loads.is_proportional():
        raise InputError(
            "supports move or loads are constant, and a limit load is that of loads that all grow;"
            " leave out what does not grow with the load factor."
        )
    with ExitStack() as made:
        program = LimitProgram(problem)
        made.callback(program.destroy)
        steps: list[InteriorStep] = []
        if program.degree == problem.num_pairs:
            reason = "nothing can yield; give the bodies that may collapse a yield stress"
            return _result(program, None, Verdict.UNBOUNDED, reason, steps)
        try:
            program.choose_units()
        except SingularStiffness as failure:
            return _result(program, None, Verdict.STALLED, str(failure), steps)
        iteration = InteriorIteration(program)
        made.callback(iteration.destroy)
        verdict, reason = _iterate(iteration, rtol, steps, monitor)
        return _result(program, iteration, verdict, reason, steps)


def can_bound(problem: Problem) -> bool:
    """Whether the method knows the yield sets of all bodies."""
    return all(on.law.cone() is not None for on in problem.laws)


def _iterate(
    iteration: InteriorIteration,
    rtol: float,
    steps: list[InteriorStep],
    monitor: Callable[[InteriorStep], None] | None,
) -> tuple[Verdict, str]:
    """Step until it is known what the limit load is. Collective."""
    program, began = iteration.program, time.perf_counter()
    while len(steps) < MOST_STEPS:
        try:
            length = iteration.step()
        except SingularStiffness as failure:
            return Verdict.STALLED, str(failure)
        if length < STUCK:
            return Verdict.STALLED, "the steps became too short"
        load, gap = iteration.now.load, iteration.gap()
        unbalanced, missing = iteration.unbalanced(), iteration.missing_work()
        wrong, rate = iteration.rates()
        inadmissible = wrong / rate if rate > 0 else 0.0
        step = InteriorStep(
            number=len(steps) + 1,
            load=load * program.load_unit,
            gap=gap / abs(load) if load else np.inf,
            unbalanced=unbalanced,
            inadmissible=inadmissible,
            length=length,
            seconds=time.perf_counter() - began,
        )
        steps.append(step)
        if monitor is not None:
            monitor(step)
        if load > FAR * program.degree and unbalanced <= ALMOST < inadmissible:
            return Verdict.UNBOUNDED, _unbounded(program)
        at_rest = rate <= NOTHING  # bodies move as rigid ones, and what strains is rounding
        if max(unbalanced, missing) > SETTLED or (inadmissible > ALMOST and not at_rest):
            continue
        if abs(load) + gap <= NOTHING * program.degree:
            reason = (
                "no stress can carry the loads: they move bodies off what holds them,"
                " and meet no resistance"
            )
            return Verdict.NO_RESISTANCE, reason
        if gap <= CLOSER * rtol * load:
            return Verdict.FOUND, f"static and kinematic load are within {rtol:g} of each other"
    return Verdict.STALLED, f"the bounds have not met in {MOST_STEPS} steps"


def _unbounded(program: LimitProgram) -> str:
    told = (
        "stresses within yield carry the loads beyond ζ ="
        f" {FAR * program.load_unit * program.degree:.3g}, so that nothing seems to bound them: "
    )
    if program.problem.degree == 1:
        return told + (
            "linear elements lock in plastic flow, which keeps the volume; use quadratic ones"
            " (degree = 2 under [element]), or the loads are borne by bodies that do not yield"
        )
    return told + "they are borne by bodies that do not yield, or that cannot flow in any way"


def _result(
    program: LimitProgram,
    iteration: InteriorIteration | None,
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
) -> DiscreteLimit:
    """What an iterate tells, its bounds computed anew. Collective."""
    problem = program.problem
    mechanism = fem.Function(problem.V, name="mechanism")
    stress = fem.Function(problem.S, name="stress")
    forces = np.zeros(len(problem.basis.gap))
    lower = upper = estimate = None
    unbalanced = inadmissible = np.inf
    if iteration is not None and steps:
        low = lower_bound(iteration)
        lower, unbalanced = low.value, low.unbalanced
        iteration.stress_to(stress)
        forces = iteration.now.forces * program.force_unit
        if verdict in (Verdict.FOUND, Verdict.STALLED):
            high = upper_bound(iteration)
            upper, inadmissible = high.value, high.inadmissible
            if upper is None:
                reason += "; no admissible mechanism was found, and so no upper bound"
                verdict = verdict if inadmissible <= NEARLY else Verdict.STALLED
        if verdict is Verdict.FOUND or upper is not None:
            problem.basis.T.mult(iteration.velocity, mechanism.x.petsc_vec)
            mechanism.x.scatter_forward()
            mechanism.x.array[:] /= problem.loads.alpha(mechanism.x.petsc_vec)
        if verdict is Verdict.FOUND:
            known = [bound for bound in (lower, upper) if bound is not None]
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
    )
