"""Solve the equality-constrained QP, in which some jumps, and possibly the work, are given.

    minimise ½ δᵀAδ + rᵀδ with δ_s given at held pairs and, if requested, ℓᵀδ = work

The work equality borders the system. Let A v = b and A w = ℓ on the same free unknowns. The
solution is then v + ζ w, where the multiplier ζ gives the required work. This method is ALG4 of the
paper; for a fixed active set, the method also solves the quadratic program of ALG3. The solves for
v and w share one set-up.

If only the held pairs change, the previous solution is corrected. A change of a few pairs changes
the solution only slightly, so an inaccurate solve suffices.
"""

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver

ROUNDING = 1e-12
"""Contact forces below this fraction of the largest force count as zero; the same holds for
lengths."""


@dataclass(frozen=True)
class Held:
    """Unknowns with given values, in addition to the jumps of pairs.

    Attributes:
        index: Local owned unknowns, shape (num_held,).
        values: Values of δ at these unknowns, same shape.
    """

    index: Ints
    values: Floats


NOTHING_HELD = Held(np.zeros(0, dtype=np.int32), np.zeros(0))


@dataclass(frozen=True)
class QuadraticModel:
    """The quadratic function without A, and the right-hand sides of the equalities.

    Attributes:
        r: Gradient at δ = 0, in the jump basis.
        jumps: Jump of each held pair on this rank (length), shape (num_pairs,).
        work: Required ℓᵀδ (energy) with the loads ℓ; None if it is not prescribed.
        rtol: Relative tolerance of the linear solves.
        given: Further held unknowns, in addition to the pairs.
        first: Largest force at the start of the level, as the scale of rounding errors.
    """

    r: PETSc.Vec
    jumps: Floats
    work: float | None
    rtol: float
    given: Held = NOTHING_HELD
    first: float = 0.0


@dataclass(frozen=True)
class Solution:
    """Solution of an equality-constrained QP.

    Attributes:
        model: The function that the solution minimises.
        delta: δ in the jump basis; a correction overwrites it.
        held: Held pairs on this rank, shape (num_pairs,).
        multiplier: ζ of the work equality; 0 if work is not prescribed.
        accuracy: Largest allowed Euclidean norm of the residual, also for corrections.
        force_tolerance: Contact forces up to this size are solver or rounding errors, and do not
            affect the active set.
        solves: Number of active sets solved since :meth:`EqualityProgram.begin`.
    """

    model: QuadraticModel
    delta: PETSc.Vec
    held: PairFlags
    multiplier: float
    accuracy: float
    force_tolerance: float
    solves: int


class EqualityProgram:
    """The equality-constrained QPs of one operator, for any held pairs.

    Attributes:
        comm: Communicator of the ranks.
        index: Local index of each pair's jump, shape (num_pairs,).
    """

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Store the data that all systems share. Collective."""
        self.comm, self.index = problem.comm, problem.basis.index
        self._linear = linear
        self._A: ContactOperator | None = None
        self._border, self._rhs, self._change, self._response = (
            problem.create_vector() for _ in range(4)
        )
        problem.basis.T.multTranspose(problem.loads.live, self._border)
        self._responded = self._response_is_new = False

    def set_operator(self, A: ContactOperator) -> None:
        """Set a new operator A in the jump basis, or the same operator with new values.

        Collective.
        """
        self._A = A
        self._linear.set_operator(A)
        self._responded = self._response_is_new = False

    @property
    def operator(self) -> ContactOperator:
        """Return the operator A."""
        assert self._A is not None
        return self._A

    def minimise(self, model: QuadraticModel, held: PairFlags, delta: PETSc.Vec) -> Solution:
        """Return the solution with the given pairs held. Collective.

        Args:
            model: The quadratic model to be minimised.
            held: Held pairs on this rank, shape (num_pairs,).
            delta: Vector for δ.

        Raises:
            LinearFailure: If the system cannot be solved.
        """
        return self.complete(self.begin(model, held, delta))

    def begin(self, model: QuadraticModel, held: PairFlags, delta: PETSc.Vec) -> Solution:
        """Return an initial solution with δ = 0 at free unknowns, for :meth:`complete`. Collective.

        Args:
            model: The quadratic model to be minimised.
            held: Held pairs on this rank, shape (num_pairs,).
            delta: Vector for δ; the method sets it to zero, except at held unknowns.
        """
        delta.set(0)
        self._set_rhs(model, held, delta, 0.0)
        largest = self._rhs.norm(PETSc.NormType.NORM_INFINITY)
        force = max(model.first, model.r.norm(PETSc.NormType.NORM_INFINITY))
        noise = max(model.rtol * largest, ROUNDING * force)
        accuracy = model.rtol * self._rhs.norm()
        return Solution(model, delta, held.copy(), 0.0, accuracy, noise, 0)

    def begun_gradient(self, f: PETSc.Vec) -> None:
        """Set f to the gradient at the last :meth:`begin`; f is zero at held unknowns."""
        self._rhs.copy(f)
        f.scale(-1)

    def complete(self, begun: Solution) -> Solution:
        """Solve the program of the last :meth:`begin`. Collective.

        Raises:
            LinearFailure: If the system cannot be solved.
        """
        return self._solve(begun, begun.held, False)

    def correct(self, previous: Solution, held: PairFlags) -> Solution:
        """Return the solution with other held pairs, by correcting a previous solution. Collective.

        The correction continues until the residual is as small as for the first solution.

        Args:
            previous: Solution with other pairs held; this method overwrites its δ.
            held: Held pairs on this rank, shape (num_pairs,).

        Raises:
            LinearFailure: If the system cannot be solved; δ is then not a solution.
        """
        self._set_rhs(previous.model, held, previous.delta, previous.multiplier)
        return self._solve(previous, held, True)

    def gradient(self, solution: Solution, f: PETSc.Vec) -> None:
        """Set f to Aδ + r − ζℓ, which is minus the contact force at held pairs. Collective."""
        self._set_gradient(solution.model, solution.delta, solution.multiplier, f)

    def _set_gradient(
        self, model: QuadraticModel, delta: PETSc.Vec, multiplier: float, f: PETSc.Vec
    ) -> None:
        self.operator.mult_add(delta, model.r, f)
        f.axpy(-multiplier, self._border)

    def _set_rhs(
        self, model: QuadraticModel, held: PairFlags, delta: PETSc.Vec, multiplier: float
    ) -> None:
        """Set the held unknowns in δ, and compute the remaining right-hand side."""
        delta.array[self.index[held]] = model.jumps[held]
        delta.array[model.given.index] = model.given.values
        self._set_gradient(model, delta, multiplier, self._rhs)
        self._rhs.scale(-1)
        self._rhs.array[self._closed(model, held)] = 0

    def _closed(self, model: QuadraticModel, held: PairFlags) -> Ints:
        """Return the local owned indices of the held pairs' jumps and of the given unknowns."""
        return np.concatenate([self.index[held], model.given.index])

    def _solve(self, start: Solution, held: PairFlags, correction: bool) -> Solution:
        """Change δ so that it satisfies the right-hand side and the work equality."""
        if self._linear.hold(self._closed(start.model, held)):
            self._response_is_new = False
        self._reduce(self._rhs, start.accuracy, self._change, correction)
        start.delta.axpy(1.0, self._change)
        multiplier = start.multiplier
        work, rtol = start.model.work, start.model.rtol
        if work is not None:
            closed = self._closed(start.model, held)
            multiplier += self._shift(start.delta, closed, work, rtol)
        return Solution(
            model=start.model,
            delta=start.delta,
            held=held.copy(),
            multiplier=multiplier,
            accuracy=start.accuracy,
            force_tolerance=start.force_tolerance,
            solves=start.solves + 1,
        )

    def _reduce(self, rhs: PETSc.Vec, atol: float, x: PETSc.Vec, correction: bool) -> None:
        """Solve A x = rhs to the residual ``atol``; x = 0 if rhs is already as small."""
        size = rhs.norm()
        if size > atol:
            self._linear.solve(rhs, x, atol / size, correction=correction)
        else:
            x.set(0)

    def _shift(self, delta: PETSc.Vec, closed: Ints, work: float, rtol: float) -> float:
        """Add the multiple of A⁻¹ℓ to δ that gives the required work, and return its factor.

        Collective.
        """
        missing = work - self._border.dot(delta)
        if not self._response_is_new:
            self._respond(closed, rtol)
        compliance = self._border.dot(self._response)
        if not compliance > 0:
            raise LinearFailure(
                "the loads do no work for this active set, so no load factor gives this work"
            )
        delta.axpy(missing / compliance, self._response)
        return float(missing / compliance)

    def _respond(self, closed: Ints, rtol: float) -> None:
        """Solve A w = ℓ for the response w, or correct w if the held pairs have changed."""
        correction = self._responded
        if not correction:
            self._response.set(0)
        self._response.array[closed] = 0
        self._border.copy(self._change)
        self._change.array[closed] = 0
        accuracy = rtol * self._change.norm()
        self._response.scale(-1)
        self.operator.mult_add(self._response, self._border, self._rhs)
        self._response.scale(-1)
        self._rhs.array[closed] = 0
        self._reduce(self._rhs, accuracy, self._change, correction)
        self._response.axpy(1.0, self._change)
        self._responded = self._response_is_new = True
