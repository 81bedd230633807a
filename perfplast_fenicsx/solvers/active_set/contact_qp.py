"""Solve the contact QP of one Newton step.

    minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the jump basis
    and, where asked,  ℓᵀδ = work

PETSc's SNES-VI solves it (:mod:`variational_inequality`), starting from the active set of the last
step. Each of its iterations solves the equality-constrained QP of one active set. Then all held
pairs that pull are released and all open pairs that penetrate are held. Without contact the first
QP is the solution.

The operator is not an M-matrix. Near collapse and with quadratic elements the active sets may
cycle. Then the changing pairs are condensed to a small dense program (:mod:`condensed_qp`), which
has an exact solution, and SNES-VI starts from its active set.
"""

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.condensed_qp import condense
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    NOTHING_HELD,
    EqualityProgram,
    Held,
    QuadraticModel,
    Solution,
)
from perfplast_fenicsx.solvers.active_set.variational_inequality import (
    Found,
    VariationalInequality,
)
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver


@dataclass(frozen=True)
class ContactStep:
    """Solution of one contact QP.

    Attributes:
        delta: δ in the jump basis; valid until the next solve.
        active: Which pairs hosted by this rank are closed with a compressive force, shape
            (num_pairs,).
        settled: Whether the active set is that of the solution. Otherwise δ is feasible but not the
            solution, and the Newton iteration must not end with it.
        iterations: Number of solved active sets.
        multiplier: Multiplier of the work equality; 0 without it.
        held_forces: Support forces of the given unknowns, shape (num_held,).
    """

    delta: PETSc.Vec
    active: PairFlags
    settled: bool
    iterations: int
    multiplier: float
    held_forces: Floats


class ContactProgram:
    """A solver of the contact QPs of a problem.

    Attributes:
        equality: Solver of the equality-constrained programs.
    """

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Store the data that all steps share. Collective."""
        self._comm = problem.comm
        self.equality = EqualityProgram(problem, linear)
        self._inequality = VariationalInequality(problem, self.equality)
        self._T, self._index = problem.basis.T, problem.basis.index
        self._contact = problem.num_pairs > 0
        self._r, self._delta, self._gradient = (problem.create_vector() for _ in range(3))
        self._programs = self._condensed = 0

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the jump basis, or the same one with new values. Collective."""
        self.equality.set_operator(A)

    def solve(
        self,
        r: PETSc.Vec,
        room: Floats,
        active: PairFlags,
        rtol: float,
        most_sets: int | None = None,
        work: float | None = None,
        given: Held = NOTHING_HELD,
        first: float = 0.0,
    ) -> ContactStep:
        """Solve the contact QP. Collective.

        Args:
            r: Gradient at δ = 0.
            room: How far each pair hosted by this rank may still close, shape (num_pairs,).
            active: Initial active set.
            rtol: Relative tolerance of the linear solves.
            most_sets: Largest number of active sets to solve; None to continue to the right one.
            work: ℓᵀδ with the loads ℓ, if it is prescribed.
            given: Unknowns that are held at given values.
            first: Largest force at the beginning of the level.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        r.copy(self._r)
        model = QuadraticModel(self._r, room, work, rtol, given, first)
        if not self._contact:
            solution = self.equality.minimise(model, active, self._delta)
            forces = self._given_forces(solution)
            return ContactStep(
                solution.delta, active, True, solution.solves, solution.multiplier, forces
            )
        self._programs += 1
        found = self._inequality.solve(model, active, most_sets)
        iterations, active = found.solution.solves, found.solution.held ^ found.wrong
        if found.circling is not None:
            self._condensed += 1
            found, iterations = self._condense(found, found.circling)
            active = found.solution.held
        return ContactStep(
            found.delta,
            active,
            found.settled,
            iterations,
            found.solution.multiplier,
            found.given_forces,
        )

    def counts(self) -> tuple[int, int, int]:
        """Return the counts of contact QPs, of those solved by SNES-VI, and of its iterations."""
        return self._programs, self._programs - self._condensed, self._inequality.iterations

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """Return δ with Aδ = load, where these pairs keep their jumps and all others are free.

        Collective.

        Args:
            load: Load in nodal unknowns.
            held: Pairs that keep their jumps, shape (num_pairs,).
            rtol: Relative tolerance of the linear solve.
            given: Further unknowns that are held at given values.

        Returns:
            δ in the jump basis; valid until the next solve.

        Raises:
            LinearFailure: If the linear system cannot be solved.
        """
        self._T.multTranspose(load, self._r)
        self._r.scale(-1)
        model = QuadraticModel(self._r, np.zeros(len(held)), None, rtol, given)
        return self.equality.minimise(model, held, self._delta).delta

    def _given_forces(self, solution: Solution) -> Floats:
        """Return the forces on the given unknowns, shape (num_held,). Collective."""
        if solution.model.given is NOTHING_HELD:
            return np.zeros(0)
        self.equality.gradient(solution, self._gradient)
        forces: Floats = -self._gradient.array_r[solution.model.given.index]
        return forces

    def _condense(self, found: Found, circling: PairFlags) -> tuple[Found, int]:
        """Find the active set among the pairs that cycle. Collective.

        Returns:
            The result of SNES-VI from this set, and the number of solved systems.
        """
        solution, iterations = found.solution, found.solution.solves
        model, held = solution.model, solution.held & ~circling
        # Largest number of condensed pairs; with more, the step is used as it is.
        most_condensed = 300
        while 0 < self._comm.allreduce(int(circling.sum())) <= most_condensed:
            condensed = condense(self.equality, model, held=held, undecided=circling)
            held = np.where(circling, condensed.closed, held)
            found = self._inequality.solve(model, held, most_sets=1)
            iterations += condensed.solves + found.solution.solves
            outside = found.wrong & ~circling
            if found.settled or not self._comm.allreduce(int(outside.sum())):
                break
            circling = circling | outside
            held = held & ~circling
        return found, iterations
