"""Use linear elements inside quadratic ones as the first coarse space of multigrid.

The graph of quadratic elements is so dense that aggregates of its nodes become too large for one
smoothing step. Linear functions are quadratic ones, and represent every smooth motion of a body.
"""

from petsc4py import PETSc

import basix.ufl
import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_matrix
from perfplast_fenicsx.problem.problem import Problem


class LinearElements:
    """The linear elements of a problem with quadratic displacements.

    Attributes:
        interpolation: From vertices to nodes of the quadratic elements, in nodal unknowns and in
            blocks, without held components.
        nodes: Coordinates of owned vertices, shape (num_vertices, gdim).
    """

    def __init__(self, problem: Problem) -> None:
        """Create the interpolation. Collective."""
        mesh, gdim = problem.V.mesh, problem.bodies.gdim
        V = fem.functionspace(mesh, basix.ufl.element("P", mesh.basix_cell(), 1, shape=(gdim,)))
        owned = V.dofmap.index_map.size_local
        self.nodes: Floats = V.tabulate_dof_coordinates()[:owned, :gdim]
        self.interpolation = interpolation_matrix(V, problem.V)
        self._at_vertices = _vertex_rows(self.interpolation)
        coarse, fine = self.interpolation.createVecs()
        fine.array[:] = ~problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self._at_vertices.multTranspose(fine, coarse)
        self.interpolation.diagonalScale(fine, coarse)
        self.interpolation.setBlockSizes(gdim, gdim)
        for thing in (coarse, fine):
            thing.destroy()

    def stiffness(self, K: PETSc.Mat) -> PETSc.Mat:
        """Return the stiffness of the linear elements from K in nodal unknowns.

        The caller destroys it.
        """
        return K.PtAP(self.interpolation)

    def at_vertices(self, motion: PETSc.Vec) -> Floats:
        """Return a motion in nodal unknowns at the owned vertices, shape (num_vertices, gdim)."""
        coarse = self._at_vertices.createVecRight()
        self._at_vertices.multTranspose(motion, coarse)
        values: Floats = coarse.array.reshape(self.nodes.shape).copy()
        coarse.destroy()
        return values

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        for matrix in (self.interpolation, self._at_vertices):
            matrix.destroy()


def _vertex_rows(interpolation: PETSc.Mat) -> PETSc.Mat:
    """Return the rows of an interpolation at vertices. Collective."""
    pointer, column, value = interpolation.getValuesCSR()
    # A linear shape function exceeds a half only at its own vertex; at midsides it is at most a
    # half.
    at_vertex = 0.9
    kept = value > at_vertex
    row = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))[kept]
    begin = np.searchsorted(row, np.arange(len(pointer))).astype(PETSc.IntType)
    csr = (begin, column[kept], np.ones(len(row)))
    return PETSc.Mat().createAIJ(interpolation.getSizes(), csr=csr, comm=interpolation.comm)
