"""Quadratic minimisation with some jumps held at given values, with or without a prescribed work.

    minimise ½ δᵀAδ + rᵀδ  where δ_s = given at held pairs and, where asked,  ℓᵀδ = work

The work equality borders the system: with A v = b and A w = ℓ on the same free unknowns, the
solution is v + ζ w, where ζ, the multiplier, makes the work right (ALG4 of the paper; on a fixed
active set it solves the quadratic program of ALG3 too). Both solves share one set-up.

Where nothing but the held pairs change, the solution with the last ones is corrected: a few pairs
disturb it little, so that not much accuracy is left to be won.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver

Flags = npt.NDArray[np.bool_]


class EqualityProgram:
    """The linear systems of one operator, whatever pairs are held.

    Attributes:
        held: Pairs hosted here that were held in the last solve, shape (num_pairs,).
        sets: Systems solved since it was last set to zero.
        size: Largest entry of the last right-hand side that was not a correction's.
    """

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Keep what all systems share. Collective."""
        self._linear = linear
        self._index = problem.basis.index
        self._A: ContactOperator | None = None
        self._border, self._rhs, self._change, self._response = (
            problem.create_vector() for _ in range(4)
        )
        problem.basis.T.multTranspose(problem.loads.live, self._border)
        self._responded = self._response_is_new = False
        self.held: Flags = np.zeros(len(self._index), dtype=bool)
        self.sets, self.size, self._accuracy = 0, 0.0, 0.0

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the contact basis, or the same one with new values."""
        self._A = A
        self._linear.set_operator(A)
        self._responded = self._response_is_new = False

    @property
    def operator(self) -> ContactOperator:
        """The operator A."""
        assert self._A is not None
        return self._A

    def minimise(
        self,
        held: Flags,
        values: npt.NDArray[np.float64],
        r: PETSc.Vec,
        work: float | None,
        rtol: float,
        delta: PETSc.Vec,
        multiplier: float | None = None,
    ) -> float:
        """Solve for δ. Collective.

        Args:
            held: Pairs hosted here that are held, shape (num_pairs,).
            values: Their jumps; entries of other pairs do not matter.
            r: Gradient at δ = 0.
            work: ℓᵀδ if it is prescribed.
            rtol: Relative tolerance of the linear solves.
            delta: Takes the solution.
            multiplier: Of the solution with other pairs held, if ``delta`` is that. It is then
                corrected until the residual is what ``rtol`` allowed in the first place.

        Returns:
            Multiplier of the work equality; 0 without it.

        Raises:
            LinearFailure: If the system cannot be solved.
        """
        closed, afresh = self._index[held], multiplier is None
        if afresh:
            delta.set(0)
        delta.array[closed] = values[held]
        self.gradient(delta, r, multiplier or 0.0, self._rhs)
        self._rhs.scale(-1)
        self._rhs.array[closed] = 0
        if afresh:
            self.size = self._rhs.norm(PETSc.NormType.NORM_INFINITY)
            self._accuracy = rtol * self._rhs.norm()
        self._hold(held)
        self._solve(self._rhs, self._accuracy, self._change, afresh)
        delta.axpy(1.0, self._change)
        return 0.0 if work is None else (multiplier or 0.0) + self.shift(delta, work, rtol)

    def correct(self, held: Flags, rhs: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve A x = rhs on the unknowns that are not held, to the accuracy of the last solution.

        Args:
            held: Pairs hosted here that are held, shape (num_pairs,).
            rhs: What the solution with other pairs held leaves; zero at held unknowns.
            x: Takes its correction.
        """
        self._hold(held)
        self._solve(rhs, self._accuracy, x, False)

    def _hold(self, held: Flags) -> None:
        if self._linear.hold(self._index[held]):
            self._response_is_new = False
        self.held = held.copy()
        self.sets += 1

    def _solve(self, rhs: PETSc.Vec, atol: float, x: PETSc.Vec, afresh: bool) -> None:
        """Solve A x = rhs until no more than ``atol`` is left; less than that is left as it is."""
        size = rhs.norm()
        if size > atol:
            self._linear.solve(rhs, x, atol / size, correction=not afresh)
        else:
            x.set(0)

    def shift(self, delta: PETSc.Vec, work: float, rtol: float) -> float:
        """Add the multiple of A⁻¹ℓ that makes the work right, and return it. Collective."""
        missing = work - self._border.dot(delta)
        if not self._response_is_new:
            self._respond(rtol)
        compliance = self._border.dot(self._response)
        if not compliance > 0:
            raise LinearFailure("the loads do no work on this active set, so it carries none")
        delta.axpy(missing / compliance, self._response)
        return float(missing / compliance)

    def _respond(self, rtol: float) -> None:
        """Solve A w = ℓ for the response w, or correct that with other pairs held."""
        closed, afresh = self._index[self.held], not self._responded
        if afresh:
            self._response.set(0)
        self._response.array[closed] = 0
        self._border.copy(self._change)
        self._change.array[closed] = 0
        accuracy = rtol * self._change.norm()
        self._response.scale(-1)
        self.operator.mult_add(self._response, self._border, self._rhs)
        self._response.scale(-1)
        self._rhs.array[closed] = 0
        self._solve(self._rhs, accuracy, self._change, afresh)
        self._response.axpy(1.0, self._change)
        self._responded = self._response_is_new = True

    def gradient(self, delta: PETSc.Vec, r: PETSc.Vec, multiplier: float, f: PETSc.Vec) -> None:
        """Set f to Aδ + r − multiplier ℓ."""
        self.operator.mult_add(delta, r, f)
        f.axpy(-multiplier, self._border)
