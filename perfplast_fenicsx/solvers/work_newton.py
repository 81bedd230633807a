"""ALG3 and ALG4: Newton methods for a prescribed work of the loads, α = L(u), with contact.

Both linearise (S)^α: find (ζ, u), u ∈ K_h, L(u) = α, with u minimising J_ζ over K_h (Section 4 of
Čermák, Haslinger, Sysala, COMPLAS XII, 2013).

ALG3 takes δu from the quadratic program of ALG1 without −ζL and with the equality
L(δv) = α − L(u^k); ζ is its multiplier, and from the second step on, where L(δu) = 0, Ψ is
minimised along δu. ALG4 is Newton's method for ζ and u together,

    K v = ζ^k L − F(u^k),   K w = L,   δζ = (α − L(u^k + v))/L(w),   δu = v + δζ w,

which the paper confines to problems without contact. On a given active set both solves run on the
free unknowns, and they solve ALG3's quadratic program there; the active set is updated until it is
the solution's. So both are one method here, which ALG3 damps and ALG4 does not.
"""

import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.prescribed import Prescribed
from perfplast_fenicsx.problem.problem import Problem
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


class WorkNewton:
    """ALG3 for one problem: damped Newton for prescribed work.

    Attributes:
        problem: What is solved.
        options: How.
        linear: The linear solver and its counts.
    """

    method = "work-newton"
    prescribes = Prescribed.WORK
    damped = True

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
        self, alpha: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        """Find ζ and u with L(u) = α. Collective.

        Args:
            alpha: Work of the loads (energy), at least 0.
            start: State to begin with, as one of a smaller work or an extrapolation of such;
                what penetrates is pushed back. None for u = 0 with all pairs of zero gap closed.
            monitor: Called on every rank after each step.

        Returns:
            The level, with ζ the multiplier of the work equality. Where it has not converged its
            report says why, and its state is the last iterate, which is not a solution.

        Raises:
            InputError: If α is negative or not finite.
        """
        check_finite("alpha", alpha)
        if alpha < 0:
            raise InputError(f"the work alpha = {alpha} is negative; give zero or more.")
        options, iterate = self.options, self._iterate
        active = iterate.begin(start)
        zeta = start.zeta if start else 0.0
        progress = Progress(iterate, self.linear, monitor)
        increment = 1.0
        while len(progress.history) < options.max_iterations:
            rho = regularisation(options, progress.history)
            try:
                self._program.set_operator(iterate.operator(rho))
                step = self._program.solve(
                    iterate.gradient(zeta),
                    iterate.room(),
                    active,
                    rtol=forcing(increment, options.tolerance),
                    exact=exact_active_set(options, progress.history),
                    work=alpha - iterate.work(),
                )
            except LinearFailure as failure:
                return progress.level(zeta, active, False, str(failure))
            active = step.active
            zeta += step.multiplier
            iterate.aim(step.delta)
            damp = self.damped and options.damping and progress.history
            beta = iterate.line_search(zeta) if damp else 1.0
            increment = iterate.take_step(beta, options.stopping)
            increment = max(increment, _change(step.multiplier, zeta))
            progress.add(zeta, increment, active, step.iterations, beta, rho)
            if increment < options.tolerance and step.settled and beta == 1:
                level = progress.level(zeta, active, True, f"{options.stopping} criterion met")
                if level.report.converged or len(progress.history) == options.max_iterations:
                    return level
        reason = f"no convergence in {options.max_iterations} Newton steps"
        return progress.level(zeta, active, False, reason)

    def first_yield(self) -> State:
        """The state at which the first point yields, were all gaps closed. Collective.

        Elastic bodies in contact without gaps respond in proportion to the load, so one elastic
        contact problem tells. Without any plastic body it is the one of ζ = 1.

        Raises:
            LinearFailure: If the elastic problem cannot be solved.
        """
        iterate = self._iterate
        closed = np.zeros_like(self.problem.basis.gap)
        iterate.begin(None)
        self._program.set_operator(iterate.operator(1.0))
        unit = self._program.solve(iterate.gradient(1.0), closed, closed <= 0, rtol=1e-8)
        iterate.aim(unit.delta)
        iterate.advance(1.0)
        overstress = iterate.fields.largest_overstress()
        state = iterate.state(1.0, unit.active)
        zeta = 1 / overstress if overstress > 0 else 1.0
        state.u.x.array[:] *= zeta
        return State(state.u, zeta, zeta * state.alpha, state.active)


class BorderedNewton(WorkNewton):
    """ALG4 for one problem: undamped Newton for ζ and u together, with contact."""

    method = "bordered-newton"
    damped = False


def _change(multiplier: float, zeta: float) -> float:
    return abs(multiplier) / max(abs(zeta), 1e-300) if multiplier else 0.0
