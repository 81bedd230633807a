"""Assemble the tangent stiffness as a blocked matrix, with the sparsity pattern for contact."""

from typing import Any

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.contact.rows.constraints import entries_of, matrix_of_entries
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase


class TangentForm:
    """The form ⟨Σ^{o,ρ}(ε(u)) ε(·), ε(·)⟩ of given fields.

    Attributes:
        form: The compiled form.
    """

    def __init__(self, fields: QuadratureFields, space: fem.FunctionSpace) -> None:
        """Compile the form. Collective.

        Args:
            fields: Fields whose strain determines the tangent.
            space: Space of trial and test functions.
        """
        self._problem: Problem = fields.problem
        self._rho = fem.Constant(self._problem.tagged_mesh.mesh, default_scalar_type(1))
        self._stored: list[tuple[fem.Function, LawExpression]] = []
        strain = self._problem.kinematics.strain
        trial, test = (strain(f(space)) for f in (ufl.TrialFunction, ufl.TestFunction))
        terms = [
            ufl.dot(on.law.tangent(self._store(on, fields.e), trial), test) * on.dx
            for on in self._problem.laws
        ]
        self.form: Any = fem.form(sum(terms[1:], start=terms[0]))

    def update(self, rho: float) -> None:
        """Update the form to the current strains and to ``rho``."""
        self._rho.value = rho
        for function, expression in self._stored:
            expression.interpolate(function)

    def _store(self, on: LawOnCells, e: fem.Function) -> dict[str, fem.Function]:
        """Return a function for each field of a law's tangent, with the shape of this field."""
        problem, stored = self._problem, {}
        for name, value in on.law.tangent_fields(e, on.old, self._rho).items():
            space = problem.space_at_points(value.ufl_shape)
            stored[name] = fem.Function(space, name=name)
            self._stored.append((stored[name], LawExpression([on], space, {on: value}.__getitem__)))
        return stored


class Stiffness:
    """The stiffness Σ^{o,ρ}(ε(u)) of given fields.

    Attributes:
        matrix: K in nodal unknowns, stored in blocks, which assemble twice as fast as single
            entries; zero before the first assembly.
    """

    def __init__(self, fields: QuadratureFields) -> None:
        """Compile the form and create the sparsity pattern. Collective."""
        problem = fields.problem
        self._problem = problem
        self._tangent = TangentForm(fields, problem.V)
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self.matrix = create_stiffness(problem)

    @phase("assembly")
    def assemble(self, rho: float) -> PETSc.Mat:
        """Assemble the matrix for the current strains and ``rho``.

        Supported unknowns get the mean of the diagonal, and springs hold free motions. Collective.
        """
        self._tangent.update(rho)
        self.matrix.zeroEntries()
        fem_petsc.assemble_matrix(self.matrix, self._tangent.form, self._problem.bcs)  # type: ignore[arg-type]
        self.matrix.assemble()
        self._scale_supports()
        self._problem.free.hold(self.matrix)
        return self.matrix

    def _scale_supports(self) -> None:
        """Scale supported unknowns like the others, so that Krylov solvers do not neglect them."""
        diagonal = self.matrix.getDiagonal()
        values = diagonal.array
        sums = np.array([values[~self._fixed].sum(), (~self._fixed).sum()])
        total = self._problem.comm.allreduce(sums)
        values[self._fixed] = total[0] / max(total[1], 1)
        self.matrix.setDiagonal(diagonal)
        diagonal.destroy()


def create_stiffness(problem: Problem) -> PETSc.Mat:
    """Return a blocked zero matrix with the sparsity pattern of K and of A = TᵀKT. Collective."""
    V, T = problem.V, problem.basis.T
    topology = V.mesh.topology
    index_map, bs = V.dofmap.index_map, V.dofmap.index_map_bs
    known = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    numbers = index_map.local_to_global(known)
    cells = numbers[V.dofmap.list[: topology.index_map(topology.dim).size_local]]
    owned = topology.index_map(topology.dim)
    nodes = (index_map.size_local, index_map.size_global)
    of_cells = (np.repeat(np.arange(len(cells)), cells.shape[1]), cells.ravel())
    rows = (owned.size_local, owned.size_global)
    C = matrix_of_entries(T.comm, rows, nodes, [(*of_cells, np.ones(cells.size))])
    K_nodes = C.transposeMatMult(C)
    row, column, value = entries_of(T)
    of_nodes = (row // bs, column // bs, np.ones(len(value)))
    T_nodes = _closed(matrix_of_entries(T.comm, nodes, nodes, [of_nodes]))
    both = K_nodes.PtAP(T_nodes)
    both.axpy(1.0, K_nodes)
    pointer, columns, _ = both.getValuesCSR()
    for matrix in (C, K_nodes, T_nodes, both):
        matrix.destroy()

    K = PETSc.Mat().create(T.comm)
    K.setSizes(T.getSizes())
    K.setType("baij")
    K.setBlockSize(bs)
    K.setPreallocationCSR((pointer, columns))
    to_global = PETSc.LGMap().create(numbers.astype(PETSc.IntType), bsize=bs, comm=T.comm)
    K.setLGMap(to_global)
    to_global.destroy()
    return K


def _closed(T: PETSc.Mat) -> PETSc.Mat:
    """Return the transitive closure of T: which nodes follow which others in any number of steps.

    A node follows another node in one step. But other components of the node that is followed may
    follow further nodes, as on a rigid surface in contact. Collective. The function destroys ``T``.
    """
    closed = T.copy()
    while True:
        before = closed.getInfo()["nz_used"]
        further = T.matMult(closed)
        closed.axpy(1.0, further)
        further.destroy()
        if closed.getInfo()["nz_used"] <= before:
            T.destroy()
            return closed
