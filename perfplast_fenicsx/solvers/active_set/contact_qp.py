"""The contact QP of one Newton step, by a primal-dual active set method.

    minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the jump basis
    and, where asked,  ℓᵀδ = work

First the equality-constrained QP is solved on the active set that the last step ended with. Held
pairs that pull are then released and open ones that penetrate are held, all at once, until there
are none. Pairs are judged by the solution as it is, before anything is pushed back. The operator is
no M-matrix; near collapse and with quadratic elements these sets may go in circles, and the pairs
that change then are condensed to a small dense program of their own (:mod:`condensed_qp`), which
has an exact solution.

PETSc's SNES-VI has the last word (:mod:`variational_inequality`): started from what was found, it
must find nothing to change, or goes on.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.condensed_qp import condense
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    NOTHING_HELD,
    ROUNDING,
    EqualityProgram,
    Held,
    QuadraticModel,
    Solution,
)
from perfplast_fenicsx.solvers.active_set.variational_inequality import (
    MOST_ACTIVE_SETS,
    VariationalInequality,
)
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver


@dataclass(frozen=True)
class ContactStep:
    """Solution of one contact QP.

    Attributes:
        delta: δ in the jump basis; valid until the next solve.
        active: Which pairs hosted here are closed with a pushing force, shape (num_pairs,).
        settled: Whether the active set is that of the solution; if not, δ is feasible, but no
            solution, and no iteration may end with it.
        iterations: Sets of held pairs solved with.
        multiplier: Of the work equality; 0 without it.
        held_forces: Of the unknowns that were given, what holds them, shape (num_held,).
    """

    delta: PETSc.Vec
    active: PairFlags
    settled: bool
    iterations: int
    multiplier: float
    held_forces: Floats


class ContactProgram:
    """Solver of the contact QPs of a problem.

    Attributes:
        equality: Solver of those with equalities alone.
    """

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Keep what all steps share. Collective."""
        self._comm = problem.comm
        self.equality = EqualityProgram(problem, linear)
        self._inequality = VariationalInequality(problem, self.equality)
        self._T, self._index = problem.basis.T, problem.basis.index
        self._contact = problem.num_pairs > 0
        self._r, self._delta, self._gradient = (problem.create_vector() for _ in range(3))

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the jump basis, or the same with new values. Collective."""
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
            room: How far each pair hosted here may still close, shape (num_pairs,).
            active: Active set to begin with.
            rtol: Relative tolerance of the linear solves.
            most_sets: Solve with no more sets of held pairs; None to go on until one is right.
            work: ℓᵀδ if it is prescribed, where ℓ are the loads.
            given: Unknowns that are held at values.
            first: Largest force where the level began.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        r.copy(self._r)
        model = QuadraticModel(self._r, room, work, rtol, given, first)
        solution = self.equality.minimise(model, active, self._delta)
        if not self._contact:
            return self._step(solution, active, True)
        if most_sets is not None:
            return self._approach(solution, most_sets)
        solution, circling = self._search(solution)
        settled = circling is None
        if circling is not None:
            solution, settled = self._condense(solution, circling)
        self._push_back(solution)
        if settled:
            solution, settled = self._inequality.solve(solution)
        return self._step(solution, solution.held, settled)

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """δ with Aδ = load where these pairs keep their jumps and all others are free. Collective.

        Args:
            load: In nodal unknowns.
            held: Shape (num_pairs,).
            rtol: Relative tolerance of the linear solve.
            given: Other unknowns that are held at values.

        Returns:
            In the jump basis; valid until the next solve.

        Raises:
            LinearFailure: If the linear system cannot be solved.
        """
        self._T.multTranspose(load, self._r)
        self._r.scale(-1)
        model = QuadraticModel(self._r, np.zeros(len(held)), None, rtol, given)
        return self.equality.minimise(model, held, self._delta).delta

    def _step(self, solution: Solution, active: PairFlags, settled: bool) -> ContactStep:
        """What a solution tells. Collective."""
        forces: Floats = np.zeros(0)
        if solution.model.given is not NOTHING_HELD:
            self.equality.gradient(solution, self._gradient)
            forces = -self._gradient.array_r[solution.model.given.index]
        return ContactStep(
            solution.delta, active, settled, solution.solves, solution.multiplier, forces
        )

    def _push_back(self, solution: Solution) -> None:
        """Open the pairs that δ closes beyond their room."""
        delta = solution.delta
        delta.array[self._index] = np.minimum(delta.array_r[self._index], solution.model.jumps)

    def _wrong(self, solution: Solution) -> PairFlags:
        """Pairs that ought not to be as they are: held ones that pull, others that penetrate."""
        self.equality.gradient(solution, self._gradient)
        pull = self._gradient.array_r[self._index]
        excess = solution.delta.array_r[self._index] - solution.model.jumps
        least = ROUNDING * solution.delta.norm(PETSc.NormType.NORM_INFINITY)
        wrong: PairFlags = np.where(solution.held, pull > solution.force_tolerance, excess > least)
        return wrong

    def _approach(self, solution: Solution, most_sets: int) -> ContactStep:
        """Solve with so many sets at most, and push back what penetrates. Collective."""
        while True:
            wrong = self._wrong(solution)
            settled = not self._comm.allreduce(int(wrong.sum()))
            if settled or solution.solves >= most_sets:
                break
            solution = self.equality.correct(solution, solution.held ^ wrong)
        step = self._step(solution, solution.held ^ wrong, settled)
        self._push_back(solution)
        return step

    def _search(self, solution: Solution) -> tuple[Solution, PairFlags | None]:
        """Go on from the held pairs until none is wrong. Collective.

        Returns:
            The last solution, and the pairs that go in circles; None if no pair is wrong.
        """
        seen: list[PairFlags] = []
        while True:
            held, wrong = solution.held, self._wrong(solution)
            if not self._comm.allreduce(int(wrong.sum())):
                return solution, None
            again = np.array([(earlier == held).all() for earlier in seen], dtype=np.int32)
            self._comm.Allreduce(MPI.IN_PLACE, again, MPI.MIN)
            seen.append(held)
            repeated = np.flatnonzero(again)
            if repeated.size or len(seen) > MOST_ACTIVE_SETS:
                circle = seen[repeated[-1] if repeated.size else -len(seen) // 2 :]
                return solution, np.any([other != held for other in circle], axis=0) | wrong
            solution = self.equality.correct(solution, held ^ wrong)

    def _condense(self, solution: Solution, circling: PairFlags) -> tuple[Solution, bool]:
        """Find the active set among the pairs that go in circles. Collective.

        Returns:
            The last solution, and whether it is that of the contact QP.
        """
        model, held = solution.model, solution.held & ~circling
        # So many pairs are condensed at most; beyond, the step is used as it is.
        most_condensed = 300
        while 0 < self._comm.allreduce(int(circling.sum())) <= most_condensed:
            condensed = condense(self.equality, model, held=held, undecided=circling)
            held = np.where(circling, condensed.closed, held)
            # not corrected: condensing has solved for other things
            fresh = self.equality.minimise(model, held, solution.delta)
            solves = solution.solves + condensed.solves + fresh.solves
            solution = replace(fresh, solves=solves)
            wrong = self._wrong(solution)
            outside = wrong & ~circling
            found = self._comm.allreduce(np.array([wrong.sum(), outside.sum()]))
            if not found[0]:
                return solution, True
            if not found[1]:
                return solution, False
            circling = circling | outside
            held = held & ~circling
        return solution, False
