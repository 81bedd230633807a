"""Quadratic minimisation with some jumps held at given values, with or without a prescribed work.

    minimise ½ δᵀAδ + rᵀδ  where δ_s = given at held pairs and, where asked,  ℓᵀδ = work

The work equality borders the system: with A v = b and A w = ℓ on the same free unknowns, the
solution is v + ζ w, where ζ, the multiplier, makes the work right (ALG4 of the paper; on a fixed
active set it solves the quadratic program of ALG3 too). Both solves share one set-up.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.contact_operator import ContactOperator
from perfplast_fenicsx.linear import LinearFailure, LinearSolver
from perfplast_fenicsx.problem import Problem

Flags = npt.NDArray[np.bool_]


class HeldSystem:
    """The linear systems of one operator, whatever pairs are held.

    Attributes:
        held: Pairs hosted here that were held in the last solve, shape (num_pairs,).
        sets: Systems solved since it was last set to zero.
        size: Largest entry of the last right-hand side.
    """

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Keep what all systems share. Collective."""
        self._linear = linear
        self._index = problem.basis.index
        self._A: ContactOperator | None = None
        self._border, self._rhs, self._image, self._response = (
            problem.load.duplicate() for _ in range(4)
        )
        problem.basis.T.multTranspose(problem.load, self._border)
        self._response_is_new = False
        self.held: Flags = np.zeros(len(self._index), dtype=bool)
        self.sets, self.size = 0, 0.0

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the contact basis, or the same one with new values."""
        self._A = A
        self._linear.set_operator(A)
        self._response_is_new = False

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
    ) -> float:
        """Solve for δ. Collective.

        Args:
            held: Pairs hosted here that are held, shape (num_pairs,).
            values: Their jumps; entries of other pairs do not matter.
            r: Gradient at δ = 0.
            work: ℓᵀδ if it is prescribed.
            rtol: Relative tolerance of the linear solves.
            delta: Takes the solution.

        Returns:
            Multiplier of the work equality; 0 without it.

        Raises:
            LinearFailure: If the system cannot be solved.
        """
        closed = self._index[held]
        self._rhs.set(0)
        self._rhs.array[closed] = values[held]
        self.operator.mult_add(self._rhs, r, self._image)
        self._image.scale(-1)
        self._image.array[closed] = 0
        self.solve(held, self._image, rtol, delta)
        delta.array[closed] = values[held]
        return 0.0 if work is None else self.shift(delta, work, rtol)

    def solve(self, held: Flags, rhs: PETSc.Vec, rtol: float, x: PETSc.Vec) -> None:
        """Solve A x = rhs on the unknowns that are not held; rhs is zero at the others."""
        if self._linear.hold(self._index[held]):
            self._response_is_new = False
        self.held = held.copy()
        self.size = rhs.norm(PETSc.NormType.NORM_INFINITY)
        self.sets += 1
        if self.size > 0:
            self._linear.solve(rhs, x, rtol)
        else:
            x.set(0)

    def shift(self, delta: PETSc.Vec, work: float, rtol: float) -> float:
        """Add the multiple of A⁻¹ℓ that makes the work right, and return it. Collective."""
        missing = work - self._border.dot(delta)
        if not self._response_is_new:
            self._border.copy(self._rhs)
            self._rhs.array[self._index[self.held]] = 0
            self._linear.solve(self._rhs, self._response, rtol)
            self._response_is_new = True
        compliance = self._border.dot(self._response)
        if not compliance > 0:
            raise LinearFailure("the loads do no work on this active set, so it carries none")
        delta.axpy(missing / compliance, self._response)
        return float(missing / compliance)

    def gradient(self, delta: PETSc.Vec, r: PETSc.Vec, multiplier: float, f: PETSc.Vec) -> None:
        """Set f to Aδ + r − multiplier ℓ."""
        self.operator.mult_add(delta, r, f)
        f.axpy(-multiplier, self._border)
