"""Coarse spaces of multigrid: smoothed aggregation, body by body, seen through closed contact.

In the contact basis an operator couples the bodies, and aggregates that mix them need more than
the rigid motions of one body (the in-plane slip of frictionless contact). So the aggregates and
interpolations P are PETSc's GAMG's for the stiffness K in nodal unknowns, where bodies do not see
each other and 6 (3 in 2D) modes do. In the contact basis y = M u the finest one is M P, without its
rows of held unknowns: at a closed pair the host takes the normal displacement of its guest, and
slides along it. The interpolations are made once; a set-up forms the coarse operators PᵀAP.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.petsc_options import COARSE, own_prefix
from perfplast_fenicsx.problem import Problem

AGGREGATION = {
    "ksp_type": "preonly",
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 1,
    "pc_gamg_coarse_eq_limit": 1000,
    # nothing is solved with it, and bodies that contact alone holds have a singular K
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "none",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "none",
}


class CoarseSpaces:
    """Coarse spaces in the contact basis.

    Attributes:
        interpolations: From the coarsest to the finest; none for a problem of one level.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        """Aggregate. Collective.

        Args:
            problem: Whose contact basis is meant.
            stiffness: K in nodal unknowns; only its pattern and strengths matter.
        """
        self.interpolations = _aggregate(problem, stiffness)
        self._index = problem.basis.index
        if self.interpolations:  # a small problem has but one level
            nodal = self.interpolations[-1]
            self.interpolations[-1] = problem.basis.M.matMult(nodal)
            nodal.destroy()
            self._rows = _rows(self.interpolations[-1], self._index)
        self._operators: list[tuple[PETSc.Mat | None, PETSc.Mat | None]]
        self._operators = [(None, None)] * len(self.interpolations)

    def install(self, pc: PETSc.PC) -> None:
        """Give a preconditioner of type "mg" its levels. Collective."""
        pc.setMGLevels(len(self.interpolations) + 1)
        for level, interpolation in enumerate(self.interpolations, start=1):
            pc.setMGInterpolation(level, interpolation)

    def project(self, A: PETSc.Mat, held: npt.NDArray[np.int32], pc: PETSc.PC) -> None:
        """Form the operators PᵀAP of all levels. Collective.

        Args:
            A: Operator of the finest level, with rows and columns of the identity at ``held``.
            held: Local (owned) indices of unknowns that are zero.
            pc: Gets the operators; its finest one is set by whoever solves with it.
        """
        self._hold(held)
        for level in reversed(range(len(self.interpolations))):
            operator, copy = self._operators[level]
            A = A.PtAP(self.interpolations[level], operator)
            copy = blocked(A, copy)
            pc.getMGSmoother(level).setOperators(copy, A)
            self._operators[level] = A, copy

    def _hold(self, held: npt.NDArray[np.int32]) -> None:
        """Take the held unknowns out of the finest coarse space, and put back the others."""
        pointer, columns, values = self._rows
        free = ~np.isin(self._index, held)
        kept = np.where(np.repeat(free, np.diff(pointer)), values, 0.0)
        finest = self.interpolations[-1]
        rows = (self._index + finest.getOwnershipRange()[0]).astype(PETSc.IntType)
        finest.setValuesIJV(pointer, columns, kept, rowmap=rows)
        finest.assemble()


def blocked(A: PETSc.Mat, copy: PETSc.Mat | None) -> PETSc.Mat:
    """A symmetric matrix as one that keeps the blocks of its upper triangle. Collective.

    Args:
        A: The matrix.
        copy: Of an earlier A with the same pattern, to be filled anew.
    """
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return A.convert("sbaij", copy or PETSc.Mat())


def _aggregate(problem: Problem, stiffness: PETSc.Mat) -> list[PETSc.Mat]:
    """GAMG's interpolations in nodal unknowns, from the coarsest to the finest."""
    modes = _rigid_motions(problem)
    stiffness.setNearNullSpace(modes)
    modes.destroy()
    ksp = PETSc.KSP().create(problem.comm)
    ksp.setOptionsPrefix(own_prefix(COARSE, AGGREGATION))
    ksp.setFromOptions()
    ksp.setOperators(stiffness)
    ksp.setUp()
    pc = ksp.getPC()
    interpolations = [pc.getMGInterpolation(level) for level in range(1, pc.getMGLevels())]
    stiffness.setNearNullSpace(PETSc.NullSpace())
    for thing in (pc, ksp):  # at once: what Python only lets go waits for a collective clean-up
        thing.destroy()
    return interpolations


def _rigid_motions(problem: Problem) -> PETSc.NullSpace:
    """Rigid motions of all bodies together."""
    x = problem.load.duplicate()
    owned = problem.V.dofmap.index_map.size_local
    x.array[:] = problem.V.tabulate_dof_coordinates()[:owned, : problem.bodies.gdim].ravel()
    modes = PETSc.NullSpace().createRigidBody(x)
    x.destroy()
    return modes


def _rows(
    A: PETSc.Mat, local: npt.NDArray[np.int32]
) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray]:
    """Rows with these local indices, as pointers, global columns and values. Collective."""
    first = A.getOwnershipRange()[0]
    chosen = PETSc.IS().createGeneral((local + first).astype(PETSc.IntType), comm=A.getComm())
    columns = PETSc.IS().createStride(
        A.getLocalSize()[1], first=A.getOwnershipRangeColumn()[0], step=1, comm=A.getComm()
    )
    part = A.createSubMatrix(chosen, columns)
    pointer, column, value = part.getValuesCSR()
    for thing in (chosen, columns, part):
        thing.destroy()
    return pointer, column, value
