"""ALG1: damped semismooth Newton with the contact conditions inside every step.

Section 3.1 of Čermák, Haslinger, Sysala (COMPLAS XII, 2013): δu minimises

    ½⟨Σ^{o,ρ}(ε(u)) ε(δv), ε(δv)⟩ + ⟨Σ(ε(u)), ε(δv)⟩ − ζL(δv)   over u + δv ∈ K_h,

then u ← u + β δu with β = argmin over (0, 1] of J_ζ(u + β δu).
"""

from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.report import Iteration
from perfplast_fenicsx.problem.state import Level, State
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.newton_options import (
    Monitor,
    NewtonOptions,
    check_finite,
    exact_active_set,
    forcing,
    regularisation,
)
from perfplast_fenicsx.solvers.progress import Progress

BEYOND = 1e3
"""J_ζ counts as unbounded below where it still falls at so many times the first step's work."""


class Newton:
    """ALG1 for one problem; keeps its forms, matrices and solver set-ups from level to level.

    Attributes:
        problem: What is solved.
        options: How.
        linear: The linear solver and its counts.
    """

    method = "newton"
    control = "load"

    def __init__(self, problem: Problem, options: NewtonOptions | None = None) -> None:
        """Compile the forms and create the solvers. Collective."""
        self.problem = problem
        self.options = options or NewtonOptions()
        self._iterate = Iterate(problem)
        self.linear = LinearSolver(problem)
        self._program = ContactProgram(problem, self.linear)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.problem!r})"

    def solve(
        self, zeta: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        """Solve (P)_ζ. Collective.

        Args:
            zeta: Load parameter, at least 0.
            start: State to begin with (its u must be in K_h), as one of a smaller load; None for
                u = 0 with all pairs of zero gap closed.
            monitor: Called on every rank after each step.

        Returns:
            The level. Where it has not converged its report says why, and its state is the last
            iterate, which is not a solution.

        Raises:
            InputError: If ζ is not finite.
        """
        check_finite("zeta", zeta)
        options, iterate = self.options, self._iterate
        active = iterate.begin(start)
        progress = Progress(iterate, self.linear, monitor)
        history = progress.history
        increment = 1.0
        while len(history) < options.max_iterations:
            rho = regularisation(options, history)
            try:
                self._program.set_operator(iterate.operator(rho))
                step = self._program.solve(
                    iterate.gradient(zeta),
                    iterate.room(),
                    active,
                    rtol=forcing(increment, options.tolerance),
                    exact=exact_active_set(options, progress.history),
                )
            except LinearFailure as failure:
                return progress.level(zeta, active, False, str(failure))
            active = step.active
            iterate.aim(step.delta)
            beta = iterate.line_search(zeta) if options.damping else 1.0
            increment = iterate.take_step(beta, options.stopping, zeta)
            progress.add(zeta, increment, active, step.iterations, beta, rho)
            if increment < options.tolerance and step.settled and beta == 1:
                level = progress.level(zeta, active, True, f"{options.stopping} criterion met")
                if level.report.converged or len(progress.history) == options.max_iterations:
                    return level
            if len(history) >= 3 and iterate.descends_until(BEYOND * history[0].alpha, zeta):
                return progress.level(zeta, active, False, above_limit(zeta, history))
        reason = f"no convergence in {options.max_iterations} Newton steps"
        return progress.level(zeta, active, False, reason)


def above_limit(zeta: float, history: list[Iteration]) -> str:
    """The verdict that (P)_ζ has no solution, with its evidence."""
    first, last = history[0], history[-1]
    return (
        f"no equilibrium exists at ζ = {zeta:.9g}, it is above the limit load: J_ζ fell from"
        f" {first.energy:.4g} to {last.energy:.4g} while the work of the loads grew from"
        f" {first.alpha:.4g} to {last.alpha:.4g}, and falls on along a collapse mechanism beyond"
        f" {BEYOND:g} times the first"
    )
