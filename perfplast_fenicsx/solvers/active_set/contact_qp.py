"""The contact quadratic program of one Newton step, with or without a prescribed work.

    minimise ½ δᵀAδ + rᵀδ  subject to  δ_s ≤ room at the bounded unknowns of the contact basis
    and, where asked,  ℓᵀδ = work

First the system is solved on the active set that the last step ended with. Held pairs that pull are
then released and open ones that penetrate are held, all at once, until there are none. Pairs are
judged by the solution as it is, before anything is pushed back. The operator is no M-matrix; near
collapse and with quadratic elements these sets may go in circles, and the pairs that change then
are condensed to a small dense program of their own (:mod:`condensed_qp`), which has an exact
solution.

PETSc's SNES-VI (reduced space, ``vinewtonrsls``) has the last word: started from what was found, it
must find nothing to change, or goes on. It pushes penetrating pairs back before it looks at forces,
so that it goes in circles more easily. Its own reduced matrices lose block size and near-nullspace;
its linear solves are therefore handed to :class:`linear_solver.LinearSolver`, which holds the
active unknowns in the full space.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.condensed_qp import condense
from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram, Flags
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.linear.petsc_options import ACTIVE_SET, own_prefix

MOST_ACTIVE_SET_ITERATIONS = 50
"""An active set that has not settled by then counts as one that goes in circles."""

MOST_CONDENSED = 300
"""So many pairs are condensed at most; beyond, the step is used as it is."""

ROUNDING = 1e-12
"""Contact forces below this share of the largest force decide nothing."""

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_vi_zero_tolerance": 0.0,  # the default, 1e-8, is a length; closed pairs are exactly so
    "snes_max_it": MOST_ACTIVE_SET_ITERATIONS + 1,
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
        self._system = EqualityProgram(problem, linear)
        self._index = problem.basis.index
        self._contact = problem.num_pairs > 0
        self._rtol = self._force_tolerance = self._multiplier = 0.0
        self._work: float | None = None
        self._circling: Flags = np.zeros(len(self._index), dtype=bool)
        self._failure: LinearFailure | None = None
        self._r, self._delta, self._gradient, self._rhs, self._image, self._upper, self._lower = (
            problem.create_vector() for _ in range(7)
        )
        self._lower.set(PETSc.NINFINITY)
        self._snes: PETSc.SNES | None = None

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the contact basis, or the same one with new values."""
        self._system.set_operator(A)

    def solve(
        self,
        r: PETSc.Vec,
        room: npt.NDArray[np.float64],
        guess: Flags,
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
        self._rtol, self._work, self._system.sets = rtol, work, 0
        r.copy(self._r)
        self._minimise(guess, room, afresh=True)
        if not self._contact:
            return self._step(guess, True)
        if not exact:
            wrong = self._wrong(room)
            self._project(room)
            return self._step(guess ^ wrong, not self._comm.allreduce(int(wrong.sum())))
        settled = self._search(room) or self._condense(room)
        self._project(room)
        settled = settled and self._variational_inequality(room)
        return self._step(self._system.held.copy(), settled)

    def _step(self, active: Flags, settled: bool) -> ContactStep:
        return ContactStep(self._delta, active, settled, self._system.sets, self._multiplier)

    def _minimise(self, active: Flags, room: npt.NDArray[np.float64], afresh: bool = False) -> None:
        """δ and the multiplier with the active pairs closed, whatever the other pairs do."""
        system, r = self._system, self._r
        self._multiplier = system.minimise(
            active,
            room,
            r,
            self._work,
            self._rtol,
            self._delta,
            multiplier=None if afresh else self._multiplier,
        )
        # what the linear solver leaves, and rounding of the contact forces in r
        left = self._rtol * system.size
        self._force_tolerance = max(left, ROUNDING * r.norm(PETSc.NormType.NORM_INFINITY))

    def _project(self, room: npt.NDArray[np.float64]) -> None:
        """Push back the pairs that δ closes beyond their room."""
        jumps = self._delta.array_r[self._index]
        self._delta.array[self._index] = np.minimum(jumps, room)

    def _wrong(self, room: npt.NDArray[np.float64]) -> Flags:
        """Pairs that ought not to be as they are: held ones that pull, others that penetrate."""
        self._evaluate(None, self._delta, self._gradient)
        force = self._gradient.array_r[self._index]
        excess = self._delta.array_r[self._index] - room
        least = ROUNDING * self._delta.norm(PETSc.NormType.NORM_INFINITY)
        wrong: Flags = np.where(self._system.held, force > self._force_tolerance, excess > least)
        return wrong

    def _search(self, room: npt.NDArray[np.float64]) -> bool:
        """Go on from the held pairs until none is wrong. Collective.

        Returns:
            Whether that is so; if not, ``_circling`` are the pairs that go in circles.
        """
        seen: list[Flags] = []
        while True:
            held, wrong = self._system.held, self._wrong(room)
            if not self._comm.allreduce(int(wrong.sum())):
                return True
            again = np.array([(earlier == held).all() for earlier in seen], dtype=np.int32)
            self._comm.Allreduce(MPI.IN_PLACE, again, MPI.MIN)
            seen.append(held)
            repeated = np.flatnonzero(again)
            if repeated.size or len(seen) > MOST_ACTIVE_SET_ITERATIONS:
                circle = seen[repeated[-1] if repeated.size else -len(seen) // 2 :]
                self._circling = np.any([other != held for other in circle], axis=0) | wrong
                return False
            self._minimise(held ^ wrong, room)

    def _condense(self, room: npt.NDArray[np.float64]) -> bool:
        """Find the active set among the pairs that go in circles. Collective.

        Returns:
            Whether it is the solution's.
        """
        active = self._system.held & ~self._circling
        while 0 < self._comm.allreduce(int(self._circling.sum())) <= MOST_CONDENSED:
            closed = condense(
                self._comm,
                self._system,
                self._index,
                active,
                self._circling,
                room,
                self._r,
                self._work,
            )
            active = np.where(self._circling, closed, active)
            self._minimise(active, room, afresh=True)  # condensing has solved for other things
            wrong = self._wrong(room)
            outside = wrong & ~self._circling
            found = self._comm.allreduce(np.array([wrong.sum(), outside.sum()]))
            if not found[0]:
                return True
            if not found[1]:
                return False
            self._circling |= outside
            active &= ~self._circling
        return False

    def _variational_inequality(self, room: npt.NDArray[np.float64]) -> bool:
        """Let SNES-VI look at δ, and go on if it is not satisfied.

        Returns:
            Whether it has ended with a solution.
        """
        A = self._system.operator.matrix  # what it holds does not matter here
        if self._snes is None:
            self._snes = self._make_snes(A)
        snes, self._failure = self._snes, None
        upper = self._upper.array
        upper[:] = PETSc.INFINITY
        upper[self._index] = room
        snes.setFunction(self._evaluate, self._gradient)
        snes.setJacobian(lambda *_: None, A, A)
        snes.setVariableBounds(self._lower, self._upper)
        snes.solve(None, self._delta)
        if self._failure is not None:
            raise self._failure
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
        self._system.gradient(x, self._r, self._multiplier, f)

    def _settled(self, snes: PETSc.SNES, its: int, norms: tuple[float, ...]) -> int | None:
        """Stop where the active set is the one just solved for, but for forces that are noise."""
        if self._failure is not None:
            return PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE
        x, f = snes.getSolution().array_r, snes.getFunction()[0].array_r
        s, force = x[self._index], f[self._index]
        active = (s >= self._upper.array_r[self._index]) & (force < 0)
        wrong = (active != self._system.held) & (np.abs(force) > self._force_tolerance)
        if self._comm.allreduce(int(wrong.sum())) == 0:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if its >= MOST_ACTIVE_SET_ITERATIONS:
            return PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return None

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve SNES-VI's reduced system in the full space (called by PETSc).

        SNES-VI subtracts the result from its iterate, so the work still missing counts negative.
        What fails is kept and raised behind SNES-VI, which knows nothing of it.
        """
        assert self._snes is not None
        index_set = self._snes.getVIInactiveSet()
        inactive = index_set.getIndices() - self._r.getOwnershipRange()[0]
        index_set.destroy()
        free = np.zeros(self._r.getLocalSize(), dtype=bool)
        free[inactive] = True
        self._rhs.set(0)
        self._rhs.array[inactive] = b.array_r
        try:
            self._system.correct(~free[self._index], self._rhs, self._image)
            if self._work is not None:
                self._image.scale(-1)
                self._image.axpy(1.0, self._snes.getSolution())
                shift = self._system.shift(self._image, self._work, self._rtol)
                self._multiplier += shift
                self._image.axpy(-1.0, self._snes.getSolution())
                self._image.scale(-1)
        except LinearFailure as failure:
            self._failure = failure
            self._image.set(0)
        x.array[:] = self._image.array_r[inactive]
