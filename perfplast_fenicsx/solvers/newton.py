"""ALG1, ALG3 and ALG4: damped semismooth Newton methods with contact, for prescribed ζ or work.

In ALG1 (Section 3.1 of Čermák, Haslinger, Sysala, COMPLAS XII, 2013), δu minimises

    ½⟨Σ^{o,ρ}(ε(u)) ε(δv), ε(δv)⟩ + ⟨Σ(ε(u)), ε(δv)⟩ − ζL(δv)   over u + δv ∈ K_h,

then u ← u + β δu with β = argmin over (0, 1] of J_ζ(u + β δu). This module extends the paper: β may
grow to 1.5, or with friction even further, if J_ζ still falls steeply at 1 and u + β δu stays in
K_h.

ALG3 and ALG4 are Newton methods for a prescribed work of the loads, α = L(u), with contact. Both
linearise problem (S)^α: find (ζ, u) with u ∈ K_h and L(u) = α such that u minimises J_ζ over K_h
(Section 4 of the same paper).

ALG3 takes δu from the quadratic program of ALG1, without −ζL and with the equality L(δv) = α −
L(u^k); ζ is the multiplier of this equality. From the second step on, where L(δu) = 0, the line
search minimises Ψ along δu. ALG4 is Newton's method for ζ and u together,

    K v = ζ^k L − F(u^k),   K w = L,   δζ = (α − L(u^k + v))/L(w),   δu = v + δζ w,

which the paper restricts to problems without contact. For a given active set, both solves act on
the free unknowns and solve the quadratic program of ALG3. The active set is updated until it is the
active set of the solution. Therefore this module implements both as one method. ALG3 is damped from
its second step on; ALG4 is damped only after its steps have diverged.
"""

from collections.abc import Sequence
from itertools import pairwise

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactStep
from perfplast_fenicsx.solvers.active_set.equality_qp import NOTHING_HELD, Held
from perfplast_fenicsx.solvers.active_set.friction_qp import FrictionModel
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton_options import (
    Monitor,
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
        """Compile the forms and create the solvers, or share the solvers of another algorithm.

        Collective.
        """
        self.options = options or NewtonOptions()
        criterion = criterion_met(self.options)
        end = (self.options.tolerance, self.options.max_iterations)
        super().__init__(problem, end, criterion, lender, self.options.subdivision)
        self._first_work = 0.0

    def begin(self, value: float, start: State | None) -> tuple[float, PairFlags]:
        """Start from ``start``, with u in K_h. Collective."""
        return value, self.iterate.begin(start)

    def step(
        self,
        value: float,
        zeta: float,
        active: PairFlags,
        history: Sequence[Iteration],
    ) -> Step:
        """Minimise the quadratic model, and advance along δu as long as the energy falls.

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
        """Return a message if a direction shows that J_ζ is unbounded below, else None. Collective.

        The direction is the last step or, at every fifth step, the whole displacement.
        """
        if len(history) < 3:
            return None
        far = BEYOND * self._first_work
        descends = self.iterate.descends_until(far, zeta)
        # Interval, in steps, at which the whole displacement is also tested as a collapse
        # mechanism, because the last step may involve only a few pairs.
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
    """Return the step that minimises the quadratic model of J_ζ at the iterate. Collective.

    Args:
        solver: Solver with the iterate.
        options: Options of the Newton method.
        zeta: Load factor.
        active: Initial active set.
        history: The steps so far, which determine the accuracy of this step.
        rho: Regularisation of the tangent.
        work: Required L₁(δu); None if it is not prescribed.

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
    sets = sets if sets == 1 else None  # linearisations are iterated to the end or not at all
    model = FrictionModel(gradient, room, jumps, rtol, work, first)
    found = solver.friction.solve(model, active, slip, sets)
    iterate.slip = found.slip
    return found.step


def criterion_met(options: NewtonOptions) -> str:
    """Return the message for a level that satisfies its stopping criterion."""
    return f"{options.stopping} criterion satisfied"


class WorkNewton(LevelSolver):
    """ALG3, which prescribes α; all its steps except the first are damped."""

    method = "work-newton"
    prescribes = Prescribed.WORK
    damped = True

    def __init__(self, problem: Problem, options: NewtonOptions | None = None) -> None:
        """Compile the forms and create the solvers. Collective.

        Raises:
            InputError: If all loads are constant, or if ζ drives a support, an obstacle or an
                overlap.
        """
        if not problem.loads.grows():
            raise InputError(
                "all loads are constant, so the work of growing loads cannot be prescribed, and "
                "no limit load exists; let a load grow, or prescribe load factors."
            )
        if problem.motion.driven:
            raise InputError(
                "ζ multiplies motions or overlaps, so the work of the loads does not determine ζ; "
                "set constant = true for these motions, or prescribe load factors."
            )
        self.options = options or NewtonOptions()
        super().__init__(
            problem,
            (self.options.tolerance, self.options.max_iterations),
            criterion_met(self.options),
            subdivision=self.options.subdivision,
        )

    def solve(
        self, value: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        """Return the level with L₁(u) = α, and with ζ, the multiplier of this equality.

        Collective.

        Raises:
            InputError: If α is not finite, or if α is negative although only ζ loads the bodies and
                they have no history.
        """
        if value < 0 and not self.problem.loaded_at_zero() and not self.problem.history:
            raise InputError(f"the work alpha = {value} is negative; give a value >= 0.")
        return super().solve(value, start, monitor)

    def begin(self, value: float, start: State | None) -> tuple[float, PairFlags]:
        """Start from ``start``, with u in K_h. Collective."""
        return start.zeta if start else 0.0, self.iterate.begin(start)

    def step(
        self,
        value: float,
        zeta: float,
        active: PairFlags,
        history: Sequence[Iteration],
    ) -> Step:
        """Minimise the quadratic model under the work equality, whose multiplier changes ζ.

        Collective.
        """
        options, iterate = self.options, self.iterate
        rho, missing = regularisation(options, history, iterate.lifted), value - iterate.work()
        found = newton_direction(self, options, zeta, active, history, rho, missing)
        zeta += found.multiplier
        iterate.aim(found.delta)
        damp = options.damping and history and (self.damped or diverges(history))
        halted = bool(history) and history[-1].beta <= 0
        beta = iterate.line_search(zeta, halted=halted) if damp else 1.0
        increment = iterate.take_step(beta, options.stopping)
        change = _change(found.multiplier, zeta)
        if increment < options.tolerance <= change:
            change = iterate.load_change(found.multiplier, zeta)
        increment = max(increment, change)
        finished = increment < options.tolerance and found.settled and beta == 1
        return Step(zeta, increment, found.active, found.iterations, finished, beta, rho)

    def ended(self, zeta: float, history: Sequence[Iteration]) -> str | None:
        """Return None: a solution exists for every work of a displacement in K_h."""
        return None

    def at_rest(self, monitor: Monitor | None = None) -> Level:
        """Return the level at ζ = 0, where the work is α₀. Collective."""
        return Newton(self.problem, self.options, lender=self).solve(0.0, None, monitor)

    def first_step(self, rest: State) -> float:
        """Return the first work increment beyond α₀, at which the live loads alone cause yield.

        Collective.

        The value is an estimate for elastic bodies whose closed pairs are tied.

        Args:
            rest: The state at ζ = 0.

        Raises:
            LinearFailure: If the elastic problem cannot be solved.
        """
        iterate, loads = self.iterate, self.problem.loads
        active = iterate.begin(rest)
        self.program.set_operator(iterate.operator(1.0))
        sliding = self.problem.basis.sliding
        stuck = Held(sliding, np.zeros(len(sliding))) if self.friction else NOTHING_HELD
        iterate.aim(self.program.response(loads.live, active, rtol=1e-8, given=stuck))
        unit = iterate.direction.du
        iterate.fields.e.x.array[:] = iterate.direction.de.x.array
        overstress = iterate.fields.largest_overstress()
        return loads.alpha(unit.x.petsc_vec) / (overstress if overstress > 0 else 1.0)

    def first_yield(self) -> State:
        """Return the state of first yield with all gaps closed. Collective.

        Elastic bodies in contact without gaps respond in proportion to the load, so one elastic
        contact problem suffices. If no body can yield, the function returns the state at ζ = 1.

        Raises:
            InputError: If the bodies are loaded by anything other than ζ.
            LinearFailure: If the elastic problem cannot be solved.
        """
        if not self.problem.is_elastic_at_first():
            raise InputError(
                "with friction, moving supports, constant loads or initial strains, the state at "
                "first yield is not a multiple of an elastic state; remove them from the problem."
            )
        return self._yielding(rtol=1e-8, rounds=None)

    def near_yield(self) -> State:
        """Return a state near :meth:`first_yield`, computed cheaply. Collective.

        The work of the state is rounded to two significant digits, so that the state does not
        depend on solver errors.

        Raises:
            LinearFailure: If the elastic problem cannot be solved.
        """
        # Tolerance of the linear solves near first yield, and largest number of changes of the
        # active set.
        near, few = 1e-4, 3
        state = self._yielding(rtol=near, rounds=few)
        alpha = float(f"{state.alpha:.1e}")
        scale = alpha / state.alpha if state.alpha > 0 else 1.0
        state.u.x.array[:] *= scale
        return State(state.u, scale * state.zeta, scale * state.alpha, state.active)

    def _yielding(self, rtol: float, rounds: int | None) -> State:
        """Return the multiple of an elastic state at which the first point yields. Collective.

        Args:
            rtol: Relative tolerance of the linear solves.
            rounds: Largest number of changes of the active set; None to find the correct set.
        """
        iterate = self.iterate
        closed = np.zeros_like(self.problem.basis.gap)
        iterate.begin(None)
        self.program.set_operator(iterate.operator(1.0))
        gradient, active = iterate.gradient(1.0), closed <= 0
        unit = self.program.solve(gradient, closed, active, rtol, None if rounds is None else 1)
        for _ in range(rounds or 0):
            if unit.settled:
                break
            unit = self.program.solve(gradient, closed, unit.active, rtol, most_sets=1)
        iterate.aim(unit.delta)
        iterate.advance(1.0)
        overstress = iterate.fields.largest_overstress()
        state = iterate.state(1.0, unit.active)
        zeta = 1 / overstress if overstress > 0 else 1.0
        state.u.x.array[:] *= zeta
        return State(state.u, zeta, zeta * state.alpha, state.active)


class BorderedNewton(WorkNewton):
    """ALG4, which prescribes α: undamped Newton's method for ζ and u together, with contact.

    Undamped steps may diverge from a distant start, with or without constant loads. If the
    increments grow, the level continues with the damping of ALG3.
    """

    method = "bordered-newton"
    damped = False


def diverges(history: Sequence[Iteration]) -> bool:
    """Return whether any increment after the second step was larger than the previous increment."""
    sizes = [record.increment for record in history[1:]]
    return any(a < b for a, b in pairwise(sizes))


def _change(multiplier: float, zeta: float) -> float:
    return abs(multiplier) / max(abs(zeta), 1e-300) if multiplier else 0.0
