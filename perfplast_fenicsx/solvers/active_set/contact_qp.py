"""Solve the contact quadratic program (QP) of one Newton step.

minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the jump basis
    and, if requested, ℓᵀδ = work

PETSc's SNES-VI solves this QP (:mod:`variational_inequality`), starting from the active set of the
previous step. Each iteration solves the equality-constrained QP of one active set. It then releases
all held pairs in tension, and holds all open pairs that penetrate. Without contact, the first QP
gives the solution.

The operator is not an M-matrix. Near collapse, and with quadratic elements, the active sets may
cycle. In this case the QP is condensed to a small dense program for the pairs that change. This
program is solved exactly, and SNES-VI starts from its active set.
"""

from dataclasses import dataclass, replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.problem import Problem
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

TOLERANCE = 1e-6
"""Relative tolerance of the linear solves for the condensation."""


@dataclass(frozen=True)
class Condensed:
    """Solution of a contact QP that is condensed to a few pairs.

    Attributes:
        closed: Whether each of these pairs remains closed, False for other pairs, shape
            (num_pairs,).
        solves: Number of linear systems that were solved.
    """

    closed: PairFlags
    solves: int


def condense(
    program: EqualityProgram, model: QuadraticModel, *, held: PairFlags, undecided: PairFlags
) -> Condensed:
    """Solve the contact QP for the undecided pairs only. Collective.

    All undecided pairs are held, and each of them in turn gets a unit jump. This takes one solve
    for each pair and one more, with one set-up.

    Args:
        program: Equality-constrained QPs of the operator.
        model: The function to be minimised; ``jumps`` is the current gap of each pair.
        held: Other pairs that are held closed, shape (num_pairs,).
        undecided: The few undecided pairs, shape (num_pairs,).

    Raises:
        LinearFailure: If a linear system cannot be solved.
    """
    local = np.flatnonzero(undecided)
    last = program.comm.scan(len(local))
    count, mine = program.comm.allreduce(len(local)), slice(last - len(local), last)
    delta, gradient, nothing = (model.r.duplicate() for _ in range(3))
    given = model.given.index
    unit = QuadraticModel(
        nothing,
        np.zeros_like(model.jumps),
        None if model.work is None else 0.0,
        TOLERANCE,
        Held(given, np.zeros(len(given))),
    )
    columns = np.zeros((count, count + 1))
    try:
        for number in range(count + 1):
            if number < count:
                jumps = np.zeros_like(model.jumps)
                if mine.start <= number < mine.stop:
                    jumps[local[number - mine.start]] = 1.0
                column = replace(unit, jumps=jumps)
            else:
                column = replace(model, rtol=TOLERANCE)
            solution = program.minimise(column, held | undecided, delta)
            program.gradient(solution, gradient)
            columns[mine, number] = gradient.array_r[program.index[local]]
    finally:
        for vector in (delta, gradient, nothing):
            vector.destroy()
    columns = program.comm.allreduce(columns)
    closed: PairFlags = np.zeros_like(undecided)
    closed[local] = closed_pairs(columns[:, :count], columns[:, count])[mine]
    return Condensed(closed, solves=count + 1)


def closed_pairs(stiffness: Floats, forces: Floats) -> PairFlags:
    """Return whether the opening of each pair (:func:`openings`) is zero, shape (n,)."""
    closed: PairFlags = openings(stiffness, forces) <= 0
    return closed


def openings(stiffness: Floats, forces: Floats) -> Floats:
    """Return the scaled z ≥ 0 that minimises ½ zᵀSz − gᵀz; only the zeros of z matter.

    With S = R Rᵀ, this is the least-squares problem min ‖Rᵀz − R⁻¹g‖ over z ≥ 0. The method of
    Lawson and Hanson solves it exactly (Solving Least Squares Problems, SIAM 1995, chapter 23).

    Args:
        stiffness: S, shape (n, n): the force on each pair for a unit opening of each pair. It is
            symmetric positive definite, apart from rounding errors.
        forces: g, shape (n,): the energy gained per unit of a small opening of each pair.

    Returns:
        z times the square roots of the diagonal of S, shape (n,).
    """
    from scipy.optimize import (
        nnls,
    )  # the import takes 0.1 s, and only few programs need it

    S = (stiffness + stiffness.T) / 2
    largest = float(np.diag(S).max(initial=1e-300))
    scale = np.sqrt(np.maximum(np.diag(S), 1e-30 * largest))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    # Smallest eigenvalue of the scaled matrix; it prevents rounding errors from making S
    # indefinite.
    regularisation = 1e-13
    roots = np.sqrt(np.maximum(values, regularisation))
    found, _ = nnls(roots[:, None] * vectors.T, (vectors.T @ (forces / scale)) / roots)
    scaled: Floats = found
    return scaled


@dataclass(frozen=True)
class ContactStep:
    """Solution of one contact QP.

    Attributes:
        delta: δ in the jump basis; valid until the next solve.
        active: Whether each pair hosted by this rank is closed with a compressive force, shape
            (num_pairs,).
        settled: Whether the active set belongs to the solution. If not, δ is feasible but not the
            solution, and the Newton iteration must not end with it.
        iterations: Number of active sets whose QP was solved.
        multiplier: Multiplier of the work equality; 0 if work is not prescribed.
        held_forces: Forces that hold the given unknowns, shape (num_held,).
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
        """Set a new operator A in the jump basis, or the same operator with new values.

        Collective.
        """
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
            room: Current gap of each pair hosted by this rank, shape (num_pairs,).
            active: Initial active set.
            rtol: Relative tolerance of the linear solves.
            most_sets: Largest number of active sets to solve; None to continue to the correct
                active set.
            work: Required ℓᵀδ with the loads ℓ; None if it is not prescribed.
            given: Unknowns with given values.
            first: Largest force at the start of the level.

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
        """Return the numbers of contact QPs, of QPs that SNES-VI solved, and of its iterations."""
        return self._programs, self._programs - self._condensed, self._inequality.iterations

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """Return δ with Aδ = load, where the held pairs keep their jumps and all others are free.

        Collective.

        Args:
            load: Load in nodal unknowns.
            held: Pairs that keep their jumps, shape (num_pairs,).
            rtol: Relative tolerance of the linear solve.
            given: Further unknowns with given values.

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
        """Find the active set by a QP condensed to the pairs that change in a cycle. Collective.

        Returns:
            The result of SNES-VI from this active set, or ``found`` itself if too many pairs
            change; and the number of solved systems.
        """
        solution, iterations = found.solution, found.solution.solves
        model, held = solution.model, solution.held & ~circling
        # Largest number of condensed pairs; with more pairs, the step is used as it is.
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
