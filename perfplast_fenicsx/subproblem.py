"""The contact quadratic program of one Newton step, with or without a prescribed work.

    minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the contact basis
    and, where asked,  ℓᵀδ = work

First the system is solved on the active set that the last step ended with; PETSc's SNES-VI (reduced
space, ``vinewtonrsls``) then looks whether this set is the right one and goes on from there until
it is. SNES-VI's own reduced matrices lose block size and near-nullspace; its linear solves are
therefore handed to :class:`linear.LinearSolver`, which holds the active unknowns in the full space.

On coarse or nearly collapsed meshes, and with quadratic elements, sets may go in circles, as the
operator is no M-matrix. The pairs that change then are condensed to a small dense program of their
own (:mod:`condensed`), which has an exact solution; others join them as they change too.

The work equality borders the system: with A v = b and A w = ℓ on the same free unknowns, the
solution is v + ζ w, where ζ, the multiplier, makes the work right (ALG4 of the paper; on a fixed
active set it solves the quadratic program of ALG3 too). Both solves share one set-up.
"""

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.condensed import closed_pairs
from perfplast_fenicsx.linear import LinearFailure, LinearSolver
from perfplast_fenicsx.petsc_options import ACTIVE_SET, own_prefix
from perfplast_fenicsx.problem import Problem

MOST_ACTIVE_SET_ITERATIONS = 8
"""An active set that has not settled by then goes in circles."""

MOST_CONDENSED = 300
"""So many pairs are condensed at most; beyond, the step is used as it is."""

CONDENSED_TOLERANCE = 1e-6
"""Relative tolerance of the linear solves that condense."""

ROUNDING = 1e-12
"""Contact forces below this share of the largest force decide nothing."""

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_vi_zero_tolerance": 0.0,  # the default, 1e-8, is a length; closed pairs are exactly so
    "snes_max_it": MOST_ACTIVE_SET_ITERATIONS,
}


@dataclass(frozen=True)
class ContactStep:
    """Solution of one quadratic program.

    Attributes:
        delta: δ in the contact basis; valid until the next solve.
        active: Which pairs hosted here are closed with a pushing force, shape (num_pairs,).
        settled: Whether the active set is that of the solution; if not, δ is feasible, but no
            solution, and no iteration may end with it.
        iterations: Active sets solved on.
        multiplier: Of the work equality; 0 without it.
    """

    delta: PETSc.Vec
    active: npt.NDArray[np.bool_]
    settled: bool
    iterations: int
    multiplier: float


class ContactProgram:
    """Solver of the contact quadratic programs of a problem."""

    def __init__(self, problem: Problem, linear: LinearSolver) -> None:
        """Keep what all steps share. Collective."""
        self._comm = problem.comm
        self._linear = linear
        self._index = problem.basis.index
        self._contact = problem.num_pairs > 0
        self._rtol = self._force_tolerance = self._multiplier = self._rhs_size = 0.0
        self._work: float | None = None
        self._sets = 0
        self._circling: npt.NDArray[np.bool_] = np.zeros(len(self._index), dtype=bool)
        self._held: npt.NDArray[np.bool_] = np.zeros(len(self._index), dtype=bool)
        self._A: PETSc.Mat | None = None
        self._r = problem.load.duplicate()
        self._delta, self._gradient, self._rhs, self._image, self._upper, self._lower = (
            self._r.duplicate() for _ in range(6)
        )
        self._nothing = self._r.duplicate()
        self._border, self._response = self._r.duplicate(), self._r.duplicate()
        problem.basis.T.multTranspose(problem.load, self._border)
        self._response_is_new = False
        self._lower.set(PETSc.NINFINITY)
        self._snes: PETSc.SNES | None = None

    def set_operator(self, A: PETSc.Mat) -> None:
        """Take a new operator A in the contact basis, or the same one with new values."""
        self._A = A
        self._linear.set_operator(A)
        self._response_is_new = False

    def solve(
        self,
        r: PETSc.Vec,
        room: npt.NDArray[np.float64],
        guess: npt.NDArray[np.bool_],
        rtol: float,
        exact: bool = True,
        work: float | None = None,
    ) -> ContactStep:
        """Solve the quadratic program. Collective.

        Args:
            r: Gradient at δ = 0.
            room: How far each pair hosted here may still close, shape (num_pairs,).
            guess: Active set to begin with.
            rtol: Relative tolerance of the linear solves.
            exact: Go on until the active set is right; otherwise solve once.
            work: ℓᵀδ if it is prescribed, where ℓ are the loads.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        A = self._A
        assert A is not None
        self._rtol, self._sets, self._work, self._multiplier = rtol, 0, work, 0.0
        r.copy(self._r)
        self._circling[:] = False
        self._minimise(guess, room)
        if not self._contact:
            return self._step(guess, True)
        upper = self._upper.array
        upper[:] = PETSc.INFINITY
        upper[self._index] = room
        jumps = self._delta.array_r[self._index]
        beyond = jumps > room
        self._delta.array[self._index] = np.minimum(jumps, room)
        if not exact:
            self._evaluate(None, self._delta, self._gradient)
            pushing = self._gradient.array_r[self._index] < 0
            active = np.where(guess, pushing, beyond)
            return self._step(active, not self._comm.allreduce(int((active != guess).sum())))
        settled = self._variational_inequality(A) or self._condense(room)
        return self._step(self._held.copy(), settled)

    def _step(self, active: npt.NDArray[np.bool_], settled: bool) -> ContactStep:
        return ContactStep(self._delta, active, settled, self._sets, self._multiplier)

    def _minimise(self, active: npt.NDArray[np.bool_], room: npt.NDArray[np.float64]) -> None:
        """δ and the multiplier with the active pairs closed, whatever the other pairs do."""
        self._multiplier = self._solve_on(active, room, self._r, self._work, self._rtol)
        # what the linear solver leaves, and rounding of the contact forces in r
        left = self._rtol * self._rhs_size
        rounding = ROUNDING * self._r.norm(PETSc.NormType.NORM_INFINITY)
        self._force_tolerance = max(left, rounding)

    def _solve_on(
        self,
        held: npt.NDArray[np.bool_],
        values: npt.NDArray[np.float64],
        r: PETSc.Vec,
        work: float | None,
        rtol: float,
    ) -> float:
        """δ that minimises ½ δᵀAδ + rᵀδ where jumps are held at values and the work is given.

        Returns:
            Multiplier of the work equality.
        """
        A, closed = self._A, self._index[held]
        assert A is not None
        self._rhs.set(0)
        self._rhs.array[closed] = values[held]
        A.multAdd(self._rhs, r, self._image)
        self._image.scale(-1)
        self._image.array[closed] = 0
        self._image.copy(self._rhs)
        self._rhs_size = self._rhs.norm(PETSc.NormType.NORM_INFINITY)
        self._solve_held(held, self._delta, rtol)
        self._delta.array[closed] = values[held]
        if work is None:
            return 0.0
        return self._shift(self._delta, work - self._border.dot(self._delta))

    def _condense(self, room: npt.NDArray[np.float64]) -> bool:
        """Find the active set among the pairs that go in circles. Collective.

        Returns:
            Whether it is the solution's.
        """
        active = self._held & ~self._circling
        while True:
            local = np.flatnonzero(self._circling)
            count = self._comm.allreduce(len(local))
            if not 0 < count <= MOST_CONDENSED:
                return False
            first = (self._comm.scan(len(local)) or 0) - len(local)
            held = active | self._circling
            multiplier = self._solve_on(held, room, self._r, self._work, CONDENSED_TOLERANCE)
            forces = self._forces(local, count, first, self._r, multiplier)
            columns = np.empty((count, count))
            for number in range(count):
                unit = np.zeros_like(room)
                if first <= number < first + len(local):
                    unit[local[number - first]] = 1.0
                work = None if self._work is None else 0.0
                multiplier = self._solve_on(held, unit, self._nothing, work, CONDENSED_TOLERANCE)
                columns[:, number] = self._forces(local, count, first, self._nothing, multiplier)
            closed = closed_pairs(columns, forces)
            active[local] = closed[first : first + len(local)]
            self._minimise(active, room)
            jumps = self._delta.array_r[self._index]
            self._delta.array[self._index] = np.minimum(jumps, room)
            self._evaluate(None, self._delta, self._gradient)
            wrong = self._wrong(self._delta, self._gradient)
            outside = wrong & ~self._circling
            found = self._comm.allreduce(np.array([wrong.sum(), outside.sum()]))
            if not found[0]:
                return True
            if not found[1]:
                return False
            self._circling |= outside
            active &= ~self._circling

    def _forces(
        self,
        local: npt.NDArray[np.int64],
        count: int,
        first: int,
        r: PETSc.Vec,
        multiplier: float,
    ) -> npt.NDArray[np.float64]:
        """Gradient at the condensed pairs of all ranks, shape (count,). Collective."""
        assert self._A is not None
        self._A.multAdd(self._delta, r, self._gradient)
        self._gradient.axpy(-multiplier, self._border)
        forces = np.zeros(count)
        forces[first : first + len(local)] = self._gradient.array_r[self._index[local]]
        return self._comm.allreduce(forces)

    def _solve_held(self, active: npt.NDArray[np.bool_], x: PETSc.Vec, rtol: float) -> None:
        """Solve A x = rhs with the active pairs held, rhs being zero there."""
        if self._linear.hold(self._index[active]):
            self._response_is_new = False
        self._held = active.copy()
        if self._rhs.norm(PETSc.NormType.NORM_INFINITY) > 0:
            self._linear.solve(self._rhs, x, rtol)
        else:
            x.set(0)
        self._sets += 1

    def _shift(self, delta: PETSc.Vec, missing: float) -> float:
        """Add the multiple of A⁻¹ℓ that does the missing work, and return it."""
        if not self._response_is_new:
            self._border.copy(self._rhs)
            self._rhs.array[self._index[self._held]] = 0
            self._linear.solve(self._rhs, self._response, self._rtol)
            self._response_is_new = True
        compliance = self._border.dot(self._response)
        if not compliance > 0:
            raise LinearFailure("the loads do no work on this active set, so it carries none")
        delta.axpy(missing / compliance, self._response)
        return missing / compliance

    def _variational_inequality(self, A: PETSc.Mat) -> bool:
        if self._snes is None:
            self._snes = self._make_snes(A)
        snes = self._snes
        snes.setFunction(self._evaluate, self._gradient)
        snes.setJacobian(lambda *_: None, A, A)
        snes.setVariableBounds(self._lower, self._upper)
        snes.solve(None, self._delta)
        return bool(snes.getConvergedReason() > 0)

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

    def _evaluate(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Gradient of the Lagrangian of the work equality."""
        assert self._A is not None
        self._A.multAdd(x, self._r, f)
        f.axpy(-self._multiplier, self._border)

    def _settled(self, snes: PETSc.SNES, its: int, norms: tuple[float, ...]) -> int | None:
        """Stop where the active set is the one just solved for, but for forces that are noise."""
        wrong = self._wrong(snes.getSolution(), snes.getFunction()[0])
        if self._comm.allreduce(int(wrong.sum())) == 0:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if its > MOST_ACTIVE_SET_ITERATIONS // 2:
            self._circling |= wrong
        if its >= MOST_ACTIVE_SET_ITERATIONS:
            return PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return None

    def _wrong(self, x: PETSc.Vec, f: PETSc.Vec) -> npt.NDArray[np.bool_]:
        """Pairs that ought not to be as they are, by a force that is more than noise."""
        s, force = x.array_r[self._index], f.array_r[self._index]
        active = (s >= self._upper.array_r[self._index]) & (force < 0)
        wrong: npt.NDArray[np.bool_] = (active != self._held) & (
            np.abs(force) > self._force_tolerance
        )
        return wrong

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve SNES-VI's reduced system in the full space (called by PETSc).

        SNES-VI subtracts the result from its iterate, so the work still missing counts negative.
        """
        assert self._snes is not None
        index_set = self._snes.getVIInactiveSet()
        inactive = index_set.getIndices() - self._r.getOwnershipRange()[0]
        index_set.destroy()
        free = np.zeros(self._r.getLocalSize(), dtype=bool)
        free[inactive] = True
        self._rhs.set(0)
        self._rhs.array[inactive] = b.array_r
        self._solve_held(~free[self._index], self._image, self._rtol)
        if self._work is not None:
            done = self._border.dot(self._snes.getSolution()) - self._border.dot(self._image)
            self._image.scale(-1)
            self._multiplier += self._shift(self._image, self._work - done)
            self._image.scale(-1)
        x.array[:] = self._image.array_r[inactive]
