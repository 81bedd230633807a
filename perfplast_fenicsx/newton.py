"""ALG1: damped semismooth Newton with the contact conditions inside every step.

Section 3.1 of Čermák, Haslinger, Sysala (COMPLAS XII, 2013): δu minimises

    ½⟨Σ^{o,ρ}(ε(u)) ε(δv), ε(δv)⟩ + ⟨Σ(ε(u)), ε(δv)⟩ − ζL(δv)   over u + δv ∈ K_h,

then u ← u + β δu with β = argmin over (0, 1] of J_ζ(u + β δu).
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from perfplast_fenicsx.certificate import certify
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.iterate import Iterate
from perfplast_fenicsx.linear import LinearFailure, LinearSolver
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.state import Iteration, Level, LevelReport, State
from perfplast_fenicsx.subproblem import ActiveSetFailure, ContactProgram

BEYOND = 1e3
"""J_ζ counts as unbounded below where it still falls at so many times the first step's work."""

Monitor = Callable[[Iteration], None]


@dataclass(frozen=True)
class NewtonOptions:
    """Choices of ALG1.

    Args:
        regularisation: ρ in [0, 1], or "adaptive": raised where steps are damped, lowered where
            they are not.
        damping: Exact line search on J_ζ; without it β = 1.
        stopping: Which of the paper's relative criteria ends the iteration (Remark 1):
            "displacement" ‖δu‖ / (‖u + δu‖ + ‖u‖), "stress" ‖δσ‖_E / (‖σ + δσ‖_E + ‖σ‖_E),
            or "energy" |δJ| / (|J + δJ| + |J|).
        tolerance: Bound of this criterion.
        active_set: "exact" solves each contact quadratic program to its end; "once" updates the
            active set once in a Newton step.
        max_iterations: Most Newton steps of a level.

    Raises:
        InputError: If a value is out of its range.
    """

    regularisation: float | Literal["adaptive"] = "adaptive"
    damping: bool = True
    stopping: Literal["displacement", "stress", "energy"] = "displacement"
    tolerance: float = 1e-8
    active_set: Literal["exact", "once"] = "exact"
    max_iterations: int = 60

    def __post_init__(self) -> None:
        rho = self.regularisation
        if rho != "adaptive" and not (isinstance(rho, int | float) and 0 <= rho <= 1):
            raise InputError(
                f'regularisation = {rho!r} is neither a number in [0, 1] nor "adaptive"; 1e-3 is'
                " a good value."
            )
        for field, choices in (
            ("stopping", ("displacement", "stress", "energy")),
            ("active_set", ("exact", "once")),
        ):
            if getattr(self, field) not in choices:
                raise InputError(
                    f"{field} = {getattr(self, field)!r} is unknown; choose one of"
                    f" {', '.join(choices)}."
                )
        if not 0 < self.tolerance < 1:
            raise InputError(f"tolerance = {self.tolerance} is not between 0 and 1; try 1e-8.")
        if self.max_iterations < 1:
            raise InputError(
                f"max_iterations = {self.max_iterations} is less than 1; give at least one."
            )


class Newton:
    """ALG1 for one problem; keeps its forms, matrices and solver set-ups from level to level.

    Attributes:
        problem: What is solved.
        options: How.
        linear: The linear solver and its counts.
    """

    method = "newton"

    def __init__(self, problem: Problem, options: NewtonOptions | None = None) -> None:
        """Compile the forms and create the solvers. Collective."""
        self.problem = problem
        self.options = options or NewtonOptions()
        self.linear = LinearSolver(problem)
        self._iterate = Iterate(problem)
        self._program = ContactProgram(problem, self.linear)

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
        """
        began = time.perf_counter()
        options, iterate = self.options, self._iterate
        active = iterate.begin(start)
        history: list[Iteration] = []
        converged, reason = False, f"no convergence in {options.max_iterations} Newton steps"
        energy = iterate.energy(zeta)
        increment = 1.0
        while len(history) < options.max_iterations and not converged:
            krylov = self.linear.iterations
            rho = regularisation(options, history)
            try:
                step = self._program.solve(
                    iterate.operator(rho),
                    iterate.gradient(zeta),
                    iterate.room(),
                    active,
                    rtol=forcing(increment, options.tolerance),
                    exact=options.active_set == "exact",
                )
            except (LinearFailure, ActiveSetFailure) as failure:
                reason = str(failure)
                break
            active = step.active
            iterate.aim(step.delta)
            beta = iterate.line_search(zeta) if options.damping else 1.0
            increment = iterate.increment(options.stopping)
            iterate.advance(beta)
            energy, before = iterate.energy(zeta), energy
            if options.stopping == "energy":
                increment = abs(energy - before) / max(abs(energy) + abs(before), 1e-300)
            history.append(
                Iteration(
                    number=len(history) + 1,
                    zeta=zeta,
                    alpha=iterate.work(),
                    energy=energy,
                    increment=increment,
                    beta=beta,
                    rho=rho,
                    plastic_fraction=iterate.fields.plastic_fraction(),
                    active_contacts=self.problem.comm.allreduce(int(active.sum())),
                    active_set_iterations=step.iterations,
                    linear_iterations=self.linear.iterations - krylov,
                    seconds=time.perf_counter() - began,
                )
            )
            if monitor is not None:
                monitor(history[-1])
            if increment < options.tolerance and step.settled:
                converged, reason = True, f"{options.stopping} criterion met"
            elif len(history) >= 3 and iterate.descends_until(BEYOND * history[0].alpha, zeta):
                reason = above_limit(zeta, history)
                break
        return make_level(iterate, zeta, active, converged, reason, history, began)


def above_limit(zeta: float, history: list[Iteration]) -> str:
    """The verdict that (P)_ζ has no solution, with its evidence."""
    first, last = history[0], history[-1]
    return (
        f"no equilibrium exists at ζ = {zeta:.9g}, it is above the limit load: J_ζ fell from"
        f" {first.energy:.4g} to {last.energy:.4g} while the work of the loads grew from"
        f" {first.alpha:.4g} to {last.alpha:.4g}, and falls on along a collapse mechanism beyond"
        f" {BEYOND:g} times the first"
    )


def regularisation(options: NewtonOptions, history: list[Iteration]) -> float:
    """ρ of the next step: fixed, or raised after damped steps and lowered after full ones."""
    if options.regularisation != "adaptive":
        return float(options.regularisation)
    if not history:
        return 1e-3
    last = history[-1]
    if last.beta < 0.5:
        return min(last.rho * 10, 0.1)
    return max(last.rho / 10, 1e-8) if last.beta > 0.9 else last.rho


def forcing(increment: float, tolerance: float) -> float:
    """Relative tolerance of the linear solves of the next step: loose far from the solution.

    Near it the tolerance follows the last increment, so that steps stay quadratic until the wanted
    one is reached.
    """
    return min(1e-3, max(1e-2 * increment, 1e-2 * tolerance, 1e-11))


def make_level(
    iterate: Iterate,
    zeta: float,
    active: npt.NDArray[np.bool_],
    converged: bool,
    reason: str,
    history: list[Iteration],
    began: float,
) -> Level:
    """Judge the iterate and report it. Collective."""
    problem, fields = iterate.problem, iterate.fields
    certificate = certify(problem, fields, zeta)
    nodal = fields.u.x.array.reshape(-1, problem.V.dofmap.index_map_bs)
    largest = float(np.linalg.norm(nodal, axis=1).max(initial=0))
    state = iterate.state(zeta, active)
    report = LevelReport(
        zeta=zeta,
        alpha=state.alpha,
        converged=converged,
        reason=reason,
        newton_iterations=len(history),
        active_set_iterations=sum(record.active_set_iterations for record in history),
        linear_iterations=sum(record.linear_iterations for record in history),
        damping_min=min((record.beta for record in history), default=1.0),
        plastic_fraction=fields.plastic_fraction(),
        plastic_cells=round(fields.plastic_cells()),
        active_contacts=problem.comm.allreduce(int(active.sum())),
        contact_pairs=problem.num_pairs,
        max_penetration=certificate.max_penetration,
        smallest_contact_force=certificate.smallest_contact_force,
        complementarity=certificate.complementarity,
        equilibrium=certificate.equilibrium,
        duality_gap=certificate.duality_gap,
        max_displacement=problem.comm.allreduce(largest, MPI.MAX),
        seconds=time.perf_counter() - began,
    )
    return Level(state, report, history)
