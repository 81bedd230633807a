"""The contact QP as a variational inequality: PETSc's SNES-VI looks at a solution, and may go on.

SNES-VI (reduced space, ``vinewtonrsls``) pushes penetrating pairs back before it looks at forces,
so that it goes in circles more easily than the search before it, and has the last word only. Its
own reduced matrices lose block size and near-nullspace; so its linear solves are
equality-constrained QPs of the full space (:class:`ReducedSolve`).
"""

from dataclasses import replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram, Solution
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.linear.petsc_options import ACTIVE_SET, own_prefix

MOST_ACTIVE_SETS = 50
"""An active set that has not settled by then counts as one that goes in circles."""

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_vi_zero_tolerance": 0.0,  # the default, 1e-8, is a length; closed pairs are exactly so
    "snes_max_it": MOST_ACTIVE_SETS + 1,
}


class ReducedSolve:
    """What SNES-VI calls as a preconditioner: its Newton step on the unknowns that are inactive.

    SNES-VI takes y, with A y = f on these unknowns, from its iterate δ. So y = δ − δ', where δ' is
    the solution with the active pairs held; signs turn here and nowhere else.

    Attributes:
        solution: The last one; its δ is not SNES-VI's, but a copy.
        failure: Why a system could not be solved, for whoever called SNES-VI, which knows nothing
            of it; None if all could.
    """

    def __init__(
        self, program: EqualityProgram, snes: PETSc.SNES, start: Solution, image: PETSc.Vec
    ) -> None:
        """Begin with a solution; ``image`` is room for others."""
        self._program, self._snes, self._image = program, snes, image
        self.solution = start
        self.failure: LinearFailure | None = None

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, y: PETSc.Vec) -> None:
        """Solve for y (called by PETSc); b, f at the inactive unknowns, is made anew from δ."""
        delta = self._snes.getSolution()
        index_set = self._snes.getVIInactiveSet()
        inactive = index_set.getIndices() - delta.getOwnershipRange()[0]
        index_set.destroy()
        free = np.zeros(delta.getLocalSize(), dtype=bool)
        free[inactive] = True
        delta.copy(self._image)
        try:
            self.solution = self._program.correct(
                replace(self.solution, delta=self._image), ~free[self._program.index]
            )
        except LinearFailure as failure:
            self.failure = failure
            delta.copy(self._image)
        y.array[:] = delta.array_r[inactive] - self._image.array_r[inactive]


class VariationalInequality:
    """SNES-VI for the contact QPs of a problem."""

    def __init__(self, problem: Problem, program: EqualityProgram) -> None:
        """Keep what all QPs share. Collective."""
        self._program = program
        self._prefix = own_prefix(ACTIVE_SET, PRESET)
        self._gradient, self._image, self._upper, self._lower = (
            problem.create_vector() for _ in range(4)
        )
        self._lower.set(PETSc.NINFINITY)

    def solve(self, start: Solution) -> tuple[Solution, bool]:
        """Look for an active set that is the solution's. Collective.

        Args:
            start: Solution with the pairs held that seem to be active; its δ is overwritten.

        Returns:
            The last solution, with the δ of ``start``, and whether it is that of the contact QP.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        program = self._program
        upper = self._upper.array
        upper[:] = PETSc.INFINITY
        upper[program.index] = start.model.jumps
        A = program.operator.matrix  # what it holds does not matter here
        snes = PETSc.SNES().create(program.comm)
        ksp = snes.getKSP()
        reduced = ReducedSolve(program, snes, start, self._image)

        def evaluate(snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
            program.gradient(replace(reduced.solution, delta=x), f)

        def settled(snes: PETSc.SNES, its: int, norms: tuple[float, ...]) -> int | None:
            return self._settled(snes, reduced, its)

        try:
            snes.setOptionsPrefix(self._prefix)
            ksp.setType("preonly")
            ksp.getPC().setType("python")
            ksp.getPC().setPythonContext(reduced)
            snes.setFromOptions()
            snes.setConvergenceTest(settled)
            snes.setFunction(evaluate, self._gradient)
            snes.setJacobian(lambda *_: None, A, A)
            snes.setVariableBounds(self._lower, self._upper)
            snes.solve(None, start.delta)
            converged = bool(snes.getConvergedReason() > 0)
        finally:
            for thing in (ksp, snes):
                thing.destroy()
        if reduced.failure is not None:
            raise reduced.failure
        return replace(reduced.solution, delta=start.delta), converged

    def _settled(self, snes: PETSc.SNES, reduced: ReducedSolve, its: int) -> int | None:
        """Stop where the active set is the one just solved for, but for forces that are noise."""
        if reduced.failure is not None:
            return PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE
        program, solution = self._program, reduced.solution
        x, f = snes.getSolution().array_r, snes.getFunction()[0].array_r
        jumps, gradient = x[program.index], f[program.index]
        active = (jumps >= self._upper.array_r[program.index]) & (gradient < 0)
        wrong = (active != solution.held) & (np.abs(gradient) > solution.force_tolerance)
        if program.comm.allreduce(int(wrong.sum())) == 0:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if its >= MOST_ACTIVE_SETS:
            return PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return None
