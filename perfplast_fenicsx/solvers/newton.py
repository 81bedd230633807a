"""ALG1: damped semismooth Newton method with the contact conditions in every step.

Section 3.1 of Čermák, Haslinger, Sysala (COMPLAS XII, 2013): δu minimises

    ½⟨Σ^{o,ρ}(ε(u)) ε(δv), ε(δv)⟩ + ⟨Σ(ε(u)), ε(δv)⟩ − ζL(δv)   over u + δv ∈ K_h,

then u ← u + β δu with β = argmin over (0, 1] of J_ζ(u + β δu). Beyond the paper, β may grow to 1.5
if J_ζ still falls much at 1 and u + β δu stays in K_h.
"""

from collections.abc import Sequence

from petsc4py import PETSc

from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactStep
from perfplast_fenicsx.solvers.active_set.friction_qp import FrictionModel
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton_options import (
    NewtonOptions,
    forcing,
    most_sets,
    regularisation,
)
from perfplast_fenicsx.solvers.progress import Step
from perfplast_fenicsx.solvers.verdicts import BEYOND, above_limit


class Newton(LevelSolver):
    """ALG1, which prescribes ζ."""

    method = "newton"
    prescribes = Prescribed.LOAD_FACTOR

    def __init__(
        self,
        problem: Problem,
        options: NewtonOptions | None = None,
        lender: LevelSolver | None = None,
    ) -> None:
        """Compile the forms and create the solvers, or share those of another algorithm.

        Collective.
        """
        self.options = options or NewtonOptions()
        criterion = criterion_met(self.options)
        end = (self.options.tolerance, self.options.max_iterations)
        super().__init__(problem, end, criterion, lender, self.options.subdivision)
        self._first_work = 0.0

    def begin(self, value: float, start: State | None) -> tuple[float, PairFlags]:
        """Start at the state, in K_h. Collective."""
        return value, self.iterate.begin(start)

    def step(
        self,
        value: float,
        zeta: float,
        active: PairFlags,
        history: Sequence[Iteration],
    ) -> Step:
        """Minimise the quadratic model, and advance along δu as far as the energy falls.

        Collective.
        """
        options, iterate = self.options, self.iterate
        rho = regularisation(options, history, iterate.lifted)
        found = newton_direction(self, options, zeta, active, history, rho)
        iterate.aim(found.delta)
        halted = bool(history) and history[-1].beta <= 0
        beta = iterate.line_search(zeta, stretch=True, halted=halted) if options.damping else 1.0
        increment = iterate.take_step(beta, options.stopping, zeta)
        finished = increment < options.tolerance and found.settled and beta == 1
        if not history:
            self._first_work = iterate.first_work(zeta)
        return Step(zeta, increment, found.active, found.iterations, finished, beta, rho)

    def ended(self, zeta: float, history: Sequence[Iteration]) -> str | None:
        """Return whether J_ζ is unbounded below. Collective."""
        if len(history) < 3:
            return None
        far = BEYOND * self._first_work
        descends = self.iterate.descends_until(far, zeta)
        # Interval in steps at which the whole displacement is tested as a collapse mechanism, in
        # addition to the last step, which may involve only a few pairs.
        look_around = 5
        if not descends and len(history) % look_around == 0:
            self.iterate.aim(self.iterate.y)
            descends = self.iterate.descends_until(far, zeta)
        if not descends:
            return None
        return above_limit(zeta, history, self.problem.loads.grows())


def newton_direction(
    solver: LevelSolver,
    options: NewtonOptions,
    zeta: float,
    active: PairFlags,
    history: Sequence[Iteration],
    rho: float,
    work: float | None = None,
) -> ContactStep:
    """Minimise the quadratic model of J_ζ at the iterate. Collective.

    Args:
        solver: Solver with the iterate.
        options: Options of the Newton method.
        zeta: Load factor.
        active: Initial active set.
        history: The steps so far, which determine the accuracy of this one.
        rho: Regularisation of the tangent.
        work: L₁(δu), if it is prescribed.

    Raises:
        LinearFailure: If a linear system cannot be solved.
    """
    iterate = solver.iterate
    operator, gradient, room = iterate.operator(rho), iterate.gradient(zeta), iterate.room()
    rtol = forcing(history, options.tolerance)
    sets = most_sets(options, history)
    if not history:
        iterate.first_force = float(gradient.norm(PETSc.NormType.NORM_INFINITY))
        if solver.friction is not None:
            solver.friction.begin()
    first = iterate.first_force
    if solver.friction is None:
        solver.program.set_operator(operator)
        return solver.program.solve(gradient, room, active, rtol, sets, work, first=first)
    solver.friction.set_operator(operator)
    jumps, slip = iterate.jumps(), iterate.slip
    sets = sets if sets == 1 else None  # linearisations are searched to the end, or not at all
    model = FrictionModel(gradient, room, jumps, rtol, work, first)
    found = solver.friction.solve(model, active, slip, sets)
    iterate.slip = found.slip
    return found.step


def criterion_met(options: NewtonOptions) -> str:
    """Return the message of a level that has met its stopping criterion."""
    return f"{options.stopping} criterion met"
