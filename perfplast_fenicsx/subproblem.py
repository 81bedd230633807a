"""The contact quadratic program of one Newton step.

    minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the contact basis

First the system is solved on the active set that the last step ended with; PETSc's SNES-VI (reduced
space, ``vinewtonrsls``) then looks whether this set is the right one and goes on from there until
it is. SNES-VI's own reduced matrices lose block size and near-nullspace; its linear solves are
therefore handed to :class:`linear.LinearSolver`, which holds the active unknowns in the full space.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from perfplast_fenicsx.linear import LinearSolver
from perfplast_fenicsx.options import ACTIVE_SET, own_prefix
from perfplast_fenicsx.problem import Problem

MOST_ACTIVE_SET_ITERATIONS = 50

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_max_it": MOST_ACTIVE_SET_ITERATIONS,
}


class ActiveSetFailure(RuntimeError):
    """The active set did not settle; the message is the reason, alike on every rank."""


@dataclass(frozen=True)
class ContactStep:
    """Solution of one quadratic program.

    Attributes:
        delta: δ in the contact basis; valid until the next solve.
        active: Which pairs hosted here are closed with a pushing force, shape (num_pairs,).
        settled: Whether the active set is that of the solution.
        iterations: Linear solves on an active set.
    """

    delta: PETSc.Vec
    active: npt.NDArray[np.bool_]
    settled: bool
    iterations: int


class ContactProgram:
    """Solver of the contact quadratic programs of a problem."""

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Keep what all steps share. Collective."""
        self._comm = problem.comm
        self._linear = linear
        self._index = problem.basis.index
        self._contact = problem.num_pairs > 0
        self._rtol = 0.0
        self._force_tolerance = 0.0
        self._solves = 0
        self._held = np.zeros(len(self._index), dtype=bool)
        self._A: PETSc.Mat | None = None
        self._r = problem.load.duplicate()
        self._delta, self._gradient, self._rhs, self._lift, self._upper, self._lower = (
            self._r.duplicate() for _ in range(6)
        )
        self._lower.set(PETSc.NINFINITY)
        self._snes: PETSc.SNES | None = None

    def solve(
        self,
        A: PETSc.Mat,
        r: PETSc.Vec,
        room: npt.NDArray[np.float64],
        guess: npt.NDArray[np.bool_],
        rtol: float,
        exact: bool,
    ) -> ContactStep:
        """Solve the quadratic program. Collective.

        Args:
            A: Operator in the contact basis.
            r: Gradient at δ = 0.
            room: How far each pair hosted here may still close, shape (num_pairs,).
            guess: Active set to begin with.
            rtol: Relative tolerance of the linear solves.
            exact: Go on until the active set is right; otherwise solve once.

        Raises:
            LinearFailure: If a linear system cannot be solved.
            ActiveSetFailure: If the active set does not settle.
        """
        self._A, self._rtol, self._solves = A, rtol, 0
        r.copy(self._r)
        self._force_tolerance = max(rtol, 1e-12) * r.norm(PETSc.NormType.NORM_INFINITY)
        self._linear.set_operator(A)
        self._solve_on(guess, room)
        if not self._contact:
            return ContactStep(self._delta, guess, True, self._solves)
        upper = self._upper.array
        upper[:] = PETSc.INFINITY
        upper[self._index] = room
        free_of_bounds = self._delta.array[self._index] <= room
        self._delta.array[self._index] = np.minimum(self._delta.array[self._index], room)
        if not exact:
            A.multAdd(self._delta, self._r, self._gradient)
            pushing = self._gradient.array[self._index] < 0
            active = np.where(guess, pushing, ~free_of_bounds)
            settled = not self._comm.allreduce(int((active != guess).sum()))
            return ContactStep(self._delta, active, settled, self._solves)
        self._variational_inequality(A)
        return ContactStep(self._delta, self._held.copy(), True, self._solves)

    def _solve_on(self, active: npt.NDArray[np.bool_], room: npt.NDArray[np.float64]) -> None:
        """δ with the active pairs closed: A δ = −r on the rest."""
        A = self._A
        assert A is not None
        self._held = active.copy()
        self._rhs.set(0)
        self._rhs.array[self._index[active]] = room[active]
        A.multAdd(self._rhs, self._r, self._lift)
        self._lift.scale(-1)
        self._lift.array[self._index[active]] = 0
        self._linear.hold(self._index[active])
        self._linear.solve(self._lift, self._delta, self._rtol)
        self._delta.array[self._index[active]] = room[active]
        self._solves += 1

    def _variational_inequality(self, A: PETSc.Mat) -> None:
        if self._snes is None:
            self._snes = self._make_snes(A)
        snes = self._snes
        snes.setFunction(self._evaluate, self._gradient)
        snes.setJacobian(lambda *_: None, A, A)
        snes.setVariableBounds(self._lower, self._upper)
        snes.solve(None, self._delta)
        reason = snes.getConvergedReason()
        if reason <= 0:
            raise ActiveSetFailure(
                f"the contact active set did not settle in {self._solves} linear solves"
                f" (SNES-VI reason {reason})"
            )

    def _make_snes(self, A: PETSc.Mat) -> PETSc.SNES:
        snes = PETSc.SNES().create(A.getComm())
        snes.setOptionsPrefix(own_prefix(ACTIVE_SET, PRESET))
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self)
        snes.setFromOptions()
        snes.setConvergenceTest(self._settled)
        return snes

    def _evaluate(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._A.multAdd(x, self._r, f)  # type: ignore[union-attr]

    def _settled(self, snes: PETSc.SNES, its: int, norms: tuple[float, ...]) -> int | None:
        """Stop where the active set is the one just solved for, but for forces that are noise."""
        x, f = snes.getSolution().array_r, snes.getFunction()[0].array_r
        s, force = x[self._index], f[self._index]
        active = (s >= self._upper.array_r[self._index]) & (force < 0)
        wrong = (active != self._held) & (np.abs(force) > self._force_tolerance)
        if self._comm.allreduce(int(wrong.sum())) == 0:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if its >= MOST_ACTIVE_SET_ITERATIONS:
            return PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return None

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve SNES-VI's reduced system in the full space (called by PETSc)."""
        assert self._snes is not None
        inactive = self._snes.getVIInactiveSet().getIndices() - self._r.getOwnershipRange()[0]
        free = np.zeros(self._r.getLocalSize(), dtype=bool)
        free[inactive] = True
        self._held = ~free[self._index]
        self._rhs.set(0)
        self._rhs.array[inactive] = b.array_r
        self._linear.hold(self._index[self._held])
        self._linear.solve(self._rhs, self._lift, self._rtol)
        x.array[:] = self._lift.array_r[inactive]
        self._solves += 1
