"""Store K of all pieces of a rank, torn from each other, and its generalised inverse K⁺.

The pieces are not coupled. One sparse matrix on this rank contains all of them, and one
factorisation factorises each. Its kernel are the rigid motions R. With as many springs as there are
motions, and M with invertible MᵀR, the matrix K⁺ = (K + k M Mᵀ)⁻¹ is a generalised inverse of K
itself, K K⁺ K = K, for any k > 0 (T. Brzobohatý, Z. Dostál, T. Kozubek, P. Kovář and A.
Markopoulos, Int. J. Numer. Meth. Engng 88 (2011), 493).
"""

from mpi4py import MPI
from petsc4py import PETSc

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from scipy.sparse import coo_array, triu

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.tangent_form import TangentForm
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.tfeti.factors import Factors
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains


class TornStiffness:
    """K without gluing and supports, on only this rank unless stated otherwise.

    Attributes:
        size: Number of torn unknowns of this rank.
    """

    def __init__(self, fields: QuadratureFields, pieces: Subdomains) -> None:
        """Compile the form, and create the pattern. Collective."""
        problem = fields.problem
        V, gdim = problem.V, problem.bodies.gdim
        self._comm: MPI.Intracomm = problem.comm
        self._motions = pieces.motions.reshape(-1, pieces.motions.shape[2])
        self._fixing = pieces.fixing.astype(PETSc.IntType)
        self.size = len(pieces.node) * gdim
        element = basix.ufl.element(
            "P", V.mesh.basix_cell(), problem.degree, shape=(gdim,), discontinuous=True
        )
        apart = fem.functionspace(V.mesh, element)
        self._tangent = TangentForm(fields, apart)
        owned = len(pieces.torn)
        numbers = np.full(apart.dofmap.list.size, -1, dtype=PETSc.IntType)
        numbers[apart.dofmap.list[:owned]] = pieces.torn
        self.matrix = _blocks(pieces, gdim)
        to_torn = PETSc.LGMap().create(numbers, bsize=gdim, comm=PETSc.COMM_SELF)
        self.matrix.setLGMap(to_torn)
        to_torn.destroy()
        self._factors = Factors()
        self._scale = 0.0

    @phase("assembly")
    def at(self, rho: float) -> "TornStiffness":
        """Return the object after updating K to the present strains, with this ρ. Collective."""
        self._tangent.update(rho)
        self.matrix.zeroEntries()
        fem_petsc.assemble_matrix(self.matrix, self._tangent.form)
        self.matrix.assemble()
        diagonal = self.matrix.getDiagonal()
        self._scale = float(diagonal.array_r.mean()) if self.size else 0.0
        diagonal.destroy()
        return self

    @phase("linear set-up")
    def factorise(self) -> None:
        """Compute K⁺ of the present K. Collective.

        Raises:
            LinearFailure: If the rigid motions are not the kernel of K.
        """
        moved = self.multiply(self._motions.sum(axis=1))
        # Force of a unit rigid motion, relative to the stiffness, above the level of rounding.
        not_rigid = 1e-7
        stiff = float(np.abs(moved).max(initial=0)) > not_rigid * self._scale
        self._add_springs(1.0)
        failure = self._factors.make(self.matrix)
        self._add_springs(-1.0)
        if failure is None and not stiff and self.size:
            failure = self._proved()
        if stiff:
            failure = "rigid motions strain it, as on curved cells with linear displacements"
        failures = [text for text in self._comm.allgather(failure) if text is not None]
        if failures:
            raise LinearFailure(
                f"the stiffness of a subdomain could not be factorised ({failures[0]}); its tangent"
                " is singular or nearly so, as where everything flows plastically"
            )

    def _proved(self) -> str | None:
        """Return the fault of the factors, tested on balanced forces; None if they are good."""
        forces = self.multiply(np.cos(np.arange(self.size)))
        left = self.multiply(self.solve(forces)) - forces
        # Largest relative residual of a solution with good factors.
        unsolved = 1e-6
        if np.linalg.norm(left) <= unsolved * np.linalg.norm(forces):
            return None
        return "its solution has a large residual"

    def _add_springs(self, sign: float) -> None:
        for unknown in self._fixing:
            self.matrix.setValue(
                unknown, unknown, sign * self._scale, addv=PETSc.InsertMode.ADD_VALUES
            )
        self.matrix.assemble()

    @phase("linear solve")
    def solve(self, forces: Floats) -> Floats:
        """Return K⁺ f, shape (size,)."""
        return self._factors.solve(forces)

    def multiply(self, u: Floats) -> Floats:
        """Return K u, shape (size,)."""
        x = PETSc.Vec().createWithArray(np.ascontiguousarray(u), comm=PETSc.COMM_SELF)
        y = x.duplicate()
        self.matrix.mult(x, y)
        image: Floats = y.array_r.copy()
        for vector in (x, y):
            vector.destroy()
        return image


def _blocks(pieces: Subdomains, gdim: int) -> PETSc.Mat:
    """Return a symmetric blocked matrix of zeros with the pattern of K."""
    cells, nodes = pieces.torn.shape
    ones = np.ones(cells * nodes, dtype=np.int8)
    place = (np.repeat(np.arange(cells), nodes), pieces.torn.ravel())
    of_cells = coo_array((ones, place), shape=(cells, len(pieces.node))).tocsr()
    pattern = triu((of_cells.T @ of_cells).tocsr(), format="csr")
    pattern.sort_indices()
    size = len(pieces.node) * gdim
    K = PETSc.Mat().create(PETSc.COMM_SELF)
    K.setSizes((size, size))
    K.setType("seqsbaij")
    K.setBlockSize(gdim)
    K.setPreallocationCSR(
        (pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType))
    )
    K.setOption(PETSc.Mat.Option.IGNORE_LOWER_TRIANGULAR, True)
    return K
