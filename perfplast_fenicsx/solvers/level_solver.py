"""Run the loop of a load level, which all algorithms share, and define their common parts.

An algorithm is a :class:`LevelSolver`. It defines the start of a level, a step, and the test that
shows that no solution exists. This module handles failures, the end of the loop, and verdicts.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Protocol

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.errors import InputError, check_finite
from perfplast_fenicsx.materials.elastic import check_deforms, check_returns
from perfplast_fenicsx.materials.nonassociated_flow import check_flows
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import Level, State, check_slip_is_true, remember_slip
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram
from perfplast_fenicsx.solvers.active_set.friction_qp import FrictionProgram
from perfplast_fenicsx.solvers.contact_solver import ContactSolver, make_tfeti
from perfplast_fenicsx.solvers.coulomb import solve_coulomb
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.newton_options import Monitor, Subdivision
from perfplast_fenicsx.solvers.progress import Progress, Step
from perfplast_fenicsx.solvers.tightening import tighten
from perfplast_fenicsx.solvers.verdicts import no_convergence

MOST_DOUBTS = 60
"""Number of times that a level continues if its steps become small at a state that is not a valid
solution."""


class Stepper(Protocol):
    """The interface of an algorithm for the loop.

    Attributes:
        iterate: The displacement u, which steps advance.
        linear: The linear solver, which counts its solves.
        program: Solver of the contact quadratic programs, which counts them.
        max_iterations: Largest number of steps in a level.
        tolerance: Value of the stopping criterion at which the steps end.
        steps_called: Name of the steps in messages.
        criterion: Description of the satisfied criterion in messages.
    """

    iterate: Iterate
    linear: LinearSolver
    program: ContactSolver
    max_iterations: int
    tolerance: float
    steps_called: str
    criterion: str

    @abstractmethod
    def begin(self, value: float, start: State | None) -> tuple[float, PairFlags]:
        """Prepare the start of the level, and return ζ and the initial active set. Collective."""
        ...

    @abstractmethod
    def step(
        self,
        value: float,
        zeta: float,
        active: PairFlags,
        history: Sequence[Iteration],
    ) -> Step:
        """Take a step. Collective.

        Args:
            value: The prescribed value.
            zeta: Load factor before the step.
            active: Closed pairs before the step.
            history: The steps so far.

        Raises:
            LinearFailure: If a linear system cannot be solved; u is then unchanged.
        """
        ...

    @abstractmethod
    def ended(self, zeta: float, history: Sequence[Iteration]) -> str | None:
        """Return why no solution exists, if the steps so far show it, else None. Collective."""
        ...


def solve_level(
    stepper: Stepper, value: float, start: State | None = None, monitor: Monitor | None = None
) -> Level:
    """Take steps until the level is solved or is shown to have no solution. Collective.

    Args:
        stepper: The algorithm.
        value: Prescribed ζ or α.
        start: Initial state; None for the unloaded bodies.
        monitor: Function that is called on every rank after each step.

    Returns:
        The level. If it did not converge, its report gives the reason, and its state is the last
        iterate, which is not a solution.
    """
    zeta, active = stepper.begin(value, start)
    progress = Progress(
        stepper.iterate, stepper.linear, stepper.program, monitor, stepper.tolerance
    )
    loads = stepper.iterate.problem.loads
    driven = stepper.iterate.problem.free.driven([loads.dead, loads.live])
    if driven is not None:
        return progress.level(zeta, active, False, driven, refuted=True)
    history, doubts = progress.history, 0
    while len(history) < stepper.max_iterations:
        try:
            step = stepper.step(value, zeta, active, history)
        except LinearFailure as failure:
            pushed = _pushed_away(stepper.iterate.problem, zeta)
            told = pushed or str(failure)
            return progress.level(zeta, active, False, told, refuted=pushed is not None)
        zeta, active = step.zeta, step.active
        progress.add(step)
        if step.finished:
            level = progress.level(zeta, active, True, stepper.criterion)
            doubts += 1
            last = doubts == MOST_DOUBTS or len(history) == stepper.max_iterations
            if level.report.converged or last:
                return level
        reason = stepper.ended(zeta, history)
        if reason is not None:
            return progress.level(zeta, active, False, reason, refuted=True)
    pushed = _pushed_away(stepper.iterate.problem, zeta)
    reason = pushed or no_convergence(stepper.max_iterations, stepper.steps_called, history)
    return progress.level(zeta, active, False, reason, refuted=pushed is not None)


def _pushed_away(problem: Problem, zeta: float) -> str | None:
    """Return a message if the loads at ``zeta`` push a body away, else None. Collective."""
    force = problem.loads.total(zeta, problem.create_vector())
    told = problem.free.leaving.pushed_away(force)
    force.destroy()
    return told


class LevelSolver(Stepper, ABC):
    """An algorithm for one problem, which reuses forms, matrices and solver set-ups between levels.

    Attributes:
        method: Name of the algorithm in case files.
        prescribes: The prescribed quantity, ζ or α.
        problem: The problem that is solved.
        linear: The linear solver and its counts.
        iterate: u and its fields.
        program: Solver of the contact quadratic programs.
        friction: Solver of the contact programs with friction; None without friction.
    """

    method: ClassVar[str]
    prescribes: ClassVar[Prescribed]
    steps_called = "Newton steps"

    def __init__(
        self,
        problem: Problem,
        end: tuple[float, int],
        criterion: str,
        lender: "LevelSolver | None" = None,
        subdivision: Subdivision | None = None,
    ) -> None:
        """Compile the forms and create the solvers, or share the solvers of another algorithm.

        Collective.

        Args:
            problem: The problem that is solved.
            end: Tolerance of the steps, and the largest number of steps in a level.
            criterion: Description of the satisfied stopping criterion in messages.
            lender: Algorithm whose solvers this one shares; None to create new solvers.
            subdivision: Subdivision of Total FETI; None for SNES-VI.

        Raises:
            InputError: If Total FETI is selected but does not support the problem, or if friction
                is associated. Also raised if all bodies are rigid, or if a rigid body has no rigid
                motions (:meth:`Problem.with_rigid_motions`). Also raised if only bounds support a
                material, or if a law yields but has no return mapping.
        """
        check_deforms(problem.given.materials)
        if problem.has_rigid and problem.rigid_bodies is None:
            raise InputError(
                "a body of the problem is rigid, and levels need its rigid motions as unknowns; "
                "pass problem.with_rigid_motions() to the algorithm instead of the problem."
            )
        check_slip_is_true(problem)
        check_flows(problem.given.materials)
        check_returns(problem.given.materials)
        self.problem = problem
        self.tolerance, self.max_iterations = end
        self.criterion = criterion
        self.linear: LinearSolver = lender.linear if lender else LinearSolver(problem)
        self.iterate: Iterate
        self.program: ContactSolver
        self.friction: FrictionProgram | None = None
        if lender:
            self.iterate, self.program = lender.iterate, lender.program
            self.friction = lender.friction
        elif subdivision is not None:
            self.iterate, self.program = make_tfeti(problem, self.linear, subdivision)
        else:
            self.iterate, program = Iterate(problem), ContactProgram(problem, self.linear)
            self.program = program
            self.friction = FrictionProgram(problem, program) if problem.friction.count else None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.problem!r})"

    def solve(
        self, value: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        """Solve a level. Bolts that are not tightened yet are tightened first. Collective.

        Args:
            value: Load factor ζ or work α (energy), whichever the algorithm prescribes.
            start: Initial state, such as the state at a smaller load, or an extrapolation; the
                solver removes penetrations. None starts from u = 0 with all pairs of zero gap
                closed.
            monitor: Function that is called on every rank after each step.

        Returns:
            The level. If it did not converge, its report gives the reason, and its state is the
            last iterate, which is not a solution.

        Raises:
            InputError: If the value is not finite.
        """
        check_finite(self.prescribes.value, value)
        if self.problem.shanks.loose:
            failed = tighten(self.problem, lambda: self.at_rest(monitor))
            if failed is not None:
                return failed
        self.problem.move_to(value)
        remember_slip(self.problem, start)
        if not self.problem.friction.follows_pressure:
            return solve_level(self, value, start, monitor)
        pushes = np.zeros_like(self.problem.basis.gap) if start is None else self._pushes(start)
        return solve_coulomb(
            self.problem,
            lambda state: solve_level(self, value, state, monitor),
            self._largest_force,
            start,
            pushes,
        )

    def _largest_force(self) -> float:
        """Return the largest nodal force of the stress at the iterate. Collective."""
        return float(self.iterate.fields.assemble_all_forces().norm(PETSc.NormType.NORM_INFINITY))

    def _pushes(self, state: State) -> Floats:
        """Return the contact forces of a state, shape (num_pairs,). Collective."""
        self.iterate.begin(state)
        gradient = self.iterate.gradient(state.zeta)
        forces: Floats = -gradient.array_r[self.problem.basis.index]
        return forces

    def at_rest(self, monitor: Monitor | None = None) -> Level:
        """Return the level at ζ = 0, under constant loads and constant motions. Collective."""
        return self.solve(0.0, None, monitor)
