"""Map displacements and forces between the bodies and their pieces."""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.tfeti.gluing import Gluing
from perfplast_fenicsx.solvers.tfeti.torn_stiffness import TornStiffness


class TornBodies:
    """Maps between nodal vectors and torn ones. All methods are collective."""

    def __init__(self, problem: Problem, gluing: Gluing) -> None:
        self._basis, self._copies, self._count = problem.basis, gluing.copies, gluing.count
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self._comm = problem.comm
        self._nodal, self._image = problem.create_vector(), problem.create_vector()
        self._torn = gluing.copies.createVecLeft()

    def forces(self, r: PETSc.Vec) -> Floats:
        """Return −r for a gradient r in the jump basis, in equal shares on copies of free nodes."""
        self._basis.M.multTranspose(r, self._nodal)
        self._nodal.scale(-1)
        return self.shares(self._nodal)

    def shares(self, nodal: PETSc.Vec) -> Floats:
        """Return nodal forces in equal shares on the copies of free nodes."""
        self._image.array[:] = np.where(self._fixed, 0.0, nodal.array_r / self._count)
        self._copies.mult(self._image, self._torn)
        shares: Floats = self._torn.array_r.copy()
        return shares

    def glue(self, u: Floats, delta: PETSc.Vec) -> None:
        """Set δ, in the jump basis, to the mean over copies."""
        self._torn.array[:] = u
        self._copies.multTranspose(self._torn, self._nodal)
        self._nodal.array[:] = np.where(self._fixed, 0.0, self._nodal.array_r / self._count)
        self._basis.M.mult(self._nodal, delta)

    def gradient(self, K: TornStiffness, delta: PETSc.Vec, r: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to Kδ + r in the jump basis, zero where supports or ties hold."""
        self._basis.T.mult(delta, self._nodal)
        self._copies.mult(self._nodal, self._torn)
        self._torn.array[:] = K.multiply(self._torn.array_r)
        self._copies.multTranspose(self._torn, self._nodal)
        self._basis.T.multTranspose(self._nodal, f)
        f.axpy(1.0, r)
        f.array[self._fixed] = 0
        f.array[self._basis.tied] = 0
