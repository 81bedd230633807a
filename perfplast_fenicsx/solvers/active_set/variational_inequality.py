"""Solve the contact QP as a variational inequality with PETSc's SNES-VI.

    find δ ≤ room  with  F_i(δ) = 0 where δ_i < room_i,  F_i(δ) ≤ 0 where δ_i = room_i,
    F(δ) = Aδ + r − ζℓ

``vinewtonrsls`` repeats these steps: it evaluates F, reads the active set from F (at the bound with
F_i < 0), and solves the Newton equation for the other unknowns. It then takes the full step and
projects onto the bounds. This module supplies two components.

*F at pairs.* Pairs that penetrated and were projected have no force yet. F at the projected point
would count them as open, and SNES-VI would cycle. Therefore this module evaluates F at the solution
before the projection. The sign of F at pairs follows the primal–dual active set method (M.
Hintermüller, K. Ito, K. Kunisch, SIAM J. Optim. 13 (2003) 865): negative where a closed pair is in
compression or an open pair penetrates. This method is a semismooth Newton method for the same
program.

*The linear solves.* The reduced matrices of SNES-VI lose the block size and the near-nullspace. The
preconditioner of this module is therefore an equality-constrained QP in the full space
(:class:`ReducedSolve`).
"""

import weakref
from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    ROUNDING,
    EqualityProgram,
    QuadraticModel,
    Solution,
)
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.linear.petsc_options import ACTIVE_SET, check_snes_vi, own_prefix

MOST_ACTIVE_SETS = 50
"""Number of active sets after which an iteration that has not converged counts as cycling."""

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_vi_zero_tolerance": 0.0,  # the default 1e-8 would be a length
    "snes_max_it": MOST_ACTIVE_SETS,
    "snes_atol": 0.0,  # the active set ends the iteration, unless the user gives tolerances
    "snes_rtol": 0.0,
    "snes_stol": 0.0,
}

LEAST = np.finfo(np.float64).tiny
"""The smallest force that has a sign."""

Reason = PETSc.SNES.ConvergedReason


@dataclass(frozen=True)
class Found:
    """The result of one solve by SNES-VI.

    Attributes:
        solution: The last equality-constrained solution, before its projection.
        delta: δ of SNES-VI, which is feasible; valid until the next solve.
        wrong: Pairs whose state differs in the next active set, shape (num_pairs,).
        settled: Whether no pair is wrong, on all ranks.
        circling: Pairs whose states alternate in the last active sets, shape (num_pairs,); None if
            the sets do not cycle, or if the iteration ended earlier.
        given_forces: −F at the unknowns of ``model.given``, shape (num_held,).
    """

    solution: Solution
    delta: PETSc.Vec
    wrong: PairFlags
    settled: bool
    circling: PairFlags | None
    given_forces: Floats


class ReducedSolve:
    """The preconditioner of SNES-VI, which computes its Newton step for the inactive unknowns."""

    def __init__(self, inequality: "VariationalInequality") -> None:
        """Store a weak reference to the solver, so that PETSc does not keep it alive."""
        self._inequality = weakref.proxy(inequality)

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, y: PETSc.Vec) -> None:
        """Solve for y (called by PETSc); see :meth:`VariationalInequality.newton_step`."""
        self._inequality.newton_step(y)


class _Jacobian:
    """The operator A for SNES-VI; :class:`ReducedSolve` replaces its submatrices."""

    def __init__(self, inequality: "VariationalInequality") -> None:
        """Store a weak reference to the solver, so that PETSc does not keep it alive."""
        self._inequality = weakref.proxy(inequality)

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to A x (called by PETSc for line searches that use slopes). Collective."""
        self._inequality.multiply(x, y)

    def createSubMatrix(
        self, matrix: PETSc.Mat, rows: PETSc.IS, columns: PETSc.IS, out: PETSc.Mat | None
    ) -> PETSc.Mat:
        """Return the identity instead of a submatrix (called by PETSc). Collective."""
        sizes = (rows.getLocalSize(), PETSc.DETERMINE)
        return PETSc.Mat().createConstantDiagonal((sizes, sizes), 1.0, comm=matrix.comm)


class VariationalInequality:
    """A SNES-VI solver for the contact QPs of a problem.

    Attributes:
        iterations: Number of SNES-VI iterations so far.
    """

    def __init__(self, problem: Problem, program: EqualityProgram) -> None:
        """Create the SNES, which later solves reuse. Collective.

        Raises:
            InputError: If options of the user select another solver.
        """
        self.iterations = 0
        self._program = program
        self._delta, self._x, self._force, self._upper, self._lower, self._off = (
            problem.create_vector() for _ in range(6)
        )
        self._solution: Solution
        self._wrong: PairFlags = np.zeros(len(program.index), dtype=bool)
        self._seen: list[PairFlags] = []
        self._first_norm = 0.0
        self._settled = self._limited = self._elsewhere = False
        self._circling: PairFlags | None = None
        self._failure: LinearFailure | None = None
        self._given: Ints = np.zeros(0, dtype=np.int32)
        self._given_forces: Floats = np.zeros(0)
        self._snes = self._create()
        self._most_iterations = self._snes.max_it

    def _create(self) -> PETSc.SNES:
        """Return a new SNES-VI solver with its callbacks and options. Collective."""
        me, comm = weakref.proxy(self), self._program.comm
        sizes = self._x.getSizes()
        jacobian = PETSc.Mat().createPython((sizes, sizes), _Jacobian(self), comm=comm)
        jacobian.setUp()
        prefix = own_prefix(self, ACTIVE_SET, PRESET)
        options = PETSc.Options(prefix)
        check_snes_vi(options.getAll())
        snes = PETSc.SNES().create(comm)
        snes.setOptionsPrefix(prefix)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(ReducedSolve(self))
        snes.setFromOptions()
        damping = options.getReal("snes_linesearch_damping", 1.0)
        self._full_steps = options.getString("snes_linesearch_type") == "basic" and damping == 1
        snes.setConvergenceTest(lambda snes, its, norms: me.test(its, norms[-1]))
        snes.setFunction(lambda snes, x, f: me.evaluate(x, f), self._force)
        snes.setJacobian(lambda *_: None, jacobian, jacobian)
        self._lower.set(PETSc.NINFINITY)
        self._upper.set(PETSc.INFINITY)
        snes.setVariableBounds(self._lower, self._upper)
        return snes

    def solve(
        self, model: QuadraticModel, active: PairFlags, most_sets: int | None = None
    ) -> Found:
        """Solve the contact QP, or take a few steps towards its solution. Collective.

        Args:
            model: The function to be minimised; ``jumps`` is the current gap of each pair.
            active: Initial active set, shape (num_pairs,).
            most_sets: Largest number of iterations; None to continue until the active set is
                correct or cycles.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        most = self._most_iterations if most_sets is None else min(most_sets, self._most_iterations)
        self._limited = most < MOST_ACTIVE_SETS
        self._settled, self._failure = False, None
        self._circling, self._seen = None, []
        self._begin(model, active)
        self._snes.setTolerances(max_it=most)
        self._snes.solve(None, self._x)
        self.iterations += self._snes.its
        if self._failure is not None:
            raise self._failure
        if self._snes.reason == Reason.DIVERGED_MAX_IT and not self._limited:
            self._circling = self._changing(self._seen[-len(self._seen) // 2 :])
        return Found(
            self._solution,
            self._x,
            self._wrong,
            self._settled,
            self._circling,
            self._given_forces,
        )

    def _begin(self, model: QuadraticModel, active: PairFlags) -> None:
        """Start with the closed pairs of an active set at their bounds, and all else at zero."""
        program, given = self._program, model.given
        upper, lower, before = self._upper.array, self._lower.array, self._given
        upper[before], lower[before] = PETSc.INFINITY, PETSc.NINFINITY
        upper[program.index] = model.jumps
        upper[given.index] = lower[given.index] = given.values
        self._given, self._given_forces = given.index, np.zeros(len(given.index))
        self._solution = program.begin(model, active, self._delta)
        self._delta.copy(self._x)

    def evaluate(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to F in the form for SNES-VI (called by PETSc). Collective."""
        program, solution = self._program, self._solution
        model, index, held = solution.model, program.index, solution.held
        self._elsewhere = False
        if solution.solves == 0:
            program.begun_gradient(f)
            forces, wanted = f.array_r[index], held
            self._wrong = np.zeros_like(held)
        elif not self._full_steps and self._is_elsewhere(x):
            program.gradient(replace(solution, delta=x), f)
            forces, self._elsewhere = f.array_r[index], True
            wanted = (x.array_r[index] >= model.jumps) & (forces < 0)
            self._wrong = held ^ wanted
        else:
            program.gradient(solution, f)
            forces = f.array_r[index]
            self._wrong = self._judge(forces)
            wanted = held ^ self._wrong
        if model.given.index.size:
            self._given_forces = -f.array_r[model.given.index]
        size = np.maximum(np.abs(forces), LEAST)
        f.array[index] = np.where(wanted, -size, size)

    def _is_elsewhere(self, x: PETSc.Vec) -> bool:
        """Return whether a line search of the user did not take the full step. Collective."""
        index, delta = self._program.index, self._delta
        off = self._off
        off.waxpy(-1.0, x, delta)
        off.array[index] = 0
        rounding = 1e-10 * delta.norm(PETSc.NormType.NORM_INFINITY)
        return bool(off.norm(PETSc.NormType.NORM_INFINITY) > rounding)

    def _judge(self, pull: Floats) -> PairFlags:
        """Return which pairs are in the wrong state: held in tension, or open and penetrating."""
        solution, index = self._solution, self._program.index
        excess = self._delta.array_r[index] - solution.model.jumps
        least = ROUNDING * self._delta.norm(PETSc.NormType.NORM_INFINITY)
        wrong: PairFlags = np.where(solution.held, pull > solution.force_tolerance, excess > least)
        return wrong

    def multiply(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to A x (called by PETSc). Collective."""
        self._off.set(0)
        self._program.operator.mult_add(x, self._off, y)

    def newton_step(self, y: PETSc.Vec) -> None:
        """Set y to δ − δ' at the inactive unknowns; δ' is the solution with active unknowns held.

        Here δ is the last iterate of SNES-VI. If a linear solve fails, the failure is stored for
        :meth:`solve` to raise, and y is zero. Called by PETSc; collective.
        """
        program, solution, x = self._program, self._solution, self._x
        index_set = self._snes.getVIInactiveSet()
        inactive = index_set.getIndices() - x.getOwnershipRange()[0]  # in ascending order
        index_set.destroy()
        held = np.searchsorted(inactive, program.index, "right") == np.searchsorted(
            inactive, program.index
        )
        try:
            if solution.solves == 0:
                self._solution = program.complete(solution)
            else:
                self._solution = program.correct(solution, held)
        except LinearFailure as failure:
            self._failure = failure
            y.set(0)
            return
        y.array[:] = (x.array_r - self._delta.array_r)[inactive]

    def test(self, iteration: int, norm: float) -> int | None:
        """Return the reason to stop, or None to continue (called by PETSc). Collective."""
        if self._failure is not None:
            return int(Reason.DIVERGED_LINEAR_SOLVE)
        if iteration == 0:
            self._first_norm = norm
            return None
        comm, held = self._program.comm, self._solution.held
        if not self._elsewhere:
            self._settled = comm.allreduce(int(self._wrong.sum())) == 0
            if self._settled:
                return int(Reason.CONVERGED_FNORM_RELATIVE)
            if not self._limited and self._repeats(held):
                return int(Reason.DIVERGED_INNER)
        if norm <= self._snes.atol:
            return int(Reason.CONVERGED_FNORM_ABS)
        if norm <= self._snes.rtol * self._first_norm:
            return int(Reason.CONVERGED_FNORM_RELATIVE)
        return None

    def _repeats(self, held: PairFlags) -> bool:
        """Store an active set, and return whether it has occurred before. Collective."""
        again = np.array([(earlier == held).all() for earlier in self._seen], dtype=np.int32)
        self._seen.append(held)
        if again.size:
            self._program.comm.Allreduce(MPI.IN_PLACE, again, MPI.MIN)
        if not again.any():
            return False
        self._circling = self._changing(self._seen[np.flatnonzero(again)[-1] :])
        return True

    def _changing(self, circle: list[PairFlags]) -> PairFlags:
        """Return which pairs differ between these sets, or are wrong in the last set."""
        held = self._solution.held
        changing: PairFlags = np.any([other != held for other in circle], axis=0) | self._wrong
        return changing
