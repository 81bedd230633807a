"""Create coarse spaces of multigrid: linear elements, then smoothed aggregation, body by body.

In the jump basis, the operator couples the bodies. Aggregates that mix bodies would need more than
the rigid motions of one body (for example the in-plane slip of frictionless contact). Therefore the
aggregates are formed from the stiffness K in nodal unknowns, in which bodies are uncoupled and 6
motions (3 in 2D) suffice. One Jacobi step smooths the tentative interpolation Q from these motions:
P = Q - w D^-1 K Q. In the jump basis y = M u, the finest interpolation is M P without the rows of
held unknowns. At a closed pair, the host follows the normal displacement of its guest, and can
slide along the guest. Coarser levels use their own operators in the same way. A set-up forms the
coarse operators PᵀAP.

For quadratic elements, the first coarse space consists of linear elements
(:class:`LinearElements`), which M maps in the same way, and the vertices are aggregated.

Plastic flow hardly changes the volume of a body. If each aggregate moves as a rigid body, the
volume changes, and the energy is much larger. Therefore the last Newton increment can be added as a
motion of every aggregate.

:class:`Aggregates` stores the aggregates of nodes on a multigrid level and their motions. Each
column of a tentative interpolation Q is a motion of one aggregate, and zero elsewhere; the columns
are orthonormal. PETSc's GAMG creates the aggregates with their rigid motions from the stiffness in
nodal unknowns, where bodies are uncoupled. One more motion can be added to all aggregates.

The graph of quadratic elements is so dense that aggregates of its nodes would be too large for one
smoothing step. This is why linear elements come first: linear functions are quadratic functions
too, and they represent every smooth motion of a body.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from petsc4py import PETSc

import basix.ufl
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import interpolation_matrix
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.blocked_interpolation import BlockedInterpolation
from perfplast_fenicsx.solvers.linear.blocked_products import BlockedProducts
from perfplast_fenicsx.solvers.linear.contact_operator import every_column
from perfplast_fenicsx.solvers.linear.petsc_options import COARSE, SPECTRUM, default, own_prefix

AGGREGATION = {
    "ksp_type": "preonly",
    "pc_type": "gamg",
    "pc_gamg_agg_nsmooths": 0,
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 10,
    "pc_gamg_coarse_eq_limit": 1000,
    # No system is solved with this hierarchy, and K is singular if only contact holds a body.
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "none",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "none",
}


@dataclass(frozen=True)
class Aggregates:
    """Aggregates of the nodes on one level; these aggregates are the nodes of the next level.

    Attributes:
        members: Global number of each owned node's aggregate, −1 if the node is in no aggregate.
        count: Number of owned aggregates.
        motions: Motions of the aggregate in the unknowns of each node, shape (nodes, unknowns per
            node, motions per aggregate).
    """

    members: Longs
    count: int
    motions: Floats

    @classmethod
    def of(cls, tentative: PETSc.Mat) -> Self:
        """Return the aggregates of a tentative interpolation from GAMG. Collective."""
        rows, columns = tentative.getBlockSizes()
        pointer, column, value = tentative.getValuesCSR()
        begin = pointer[:-1:rows]
        belongs = pointer[1 : len(pointer) : rows] > begin
        members = np.full(len(begin), -1)
        members[belongs] = column[begin[belongs]] // columns
        motions = np.zeros((len(begin), rows, columns))
        motions[belongs] = value.reshape(-1, rows, columns)
        return cls(members, tentative.getLocalSize()[1] // columns, motions)

    def interpolation(self, comm: PETSc.Comm) -> PETSc.Mat:
        """Return Q as a matrix. Collective."""
        nodes, rows, columns = self.motions.shape
        belongs = self.members >= 0
        pointer = np.zeros(nodes * rows + 1, dtype=PETSc.IntType)
        np.cumsum(np.repeat(belongs * columns, rows), out=pointer[1:])
        column = self.members[belongs, None, None] * columns + np.arange(columns)
        column = np.broadcast_to(column, (belongs.sum(), rows, columns))
        return PETSc.Mat().createAIJ(
            ((nodes * rows, None), (self.count * columns, None)),
            bsize=(rows, columns),
            csr=(pointer, column.astype(PETSc.IntType).ravel(), self.motions[belongs].ravel()),
            comm=comm,
        )

    def with_motion(self, motion: Floats, comm: PETSc.Comm) -> tuple["Aggregates", Floats]:
        """Return the aggregates with one more motion, and the motion on the next level. Collective.

        Args:
            motion: Motion of the whole body, shape (nodes, unknowns per node). A node may have one
                unknown more than ``motions`` has: the unknown of the motion that was added on the
                finer level.
            comm: Communicator of the problem.

        Returns:
            Aggregates with one more motion each; and the motion in the unknowns of the next level,
            shape (aggregates, motions per aggregate).
        """
        more = motion.shape[1] - self.motions.shape[1]
        motions = np.pad(self.motions, ((0, 0), (0, more), (0, 0)))
        Q = Aggregates(self.members, self.count, motions).interpolation(comm)
        known = _restrict(Q, motion)
        left = motion - _prolong(Q, known).reshape(motion.shape)
        Q.destroy()
        ones = Aggregates(self.members, self.count, np.ones((len(motion), 1, 1)))
        sums = ones.interpolation(comm)
        whole, size = (np.sqrt(_restrict(sums, (m**2).sum(axis=1))) for m in (motion, left))
        # Smallest relative difference from rigid motions at which an aggregate gets the motion.
        rigid = 1e-8
        size[size <= rigid * whole] = 0.0
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        added = left * _prolong(sums, inverse)[:, None]
        sums.destroy()
        richer = np.concatenate([motions, added[..., None]], axis=2)
        projected = np.column_stack([known.reshape(self.count, motions.shape[2]), size])
        return Aggregates(self.members, self.count, richer), projected


def _restrict(Q: PETSc.Mat, fine: Floats) -> Floats:
    """Return Qᵀ times the owned part of a vector. Collective."""
    coarse, image = Q.createVecs()
    image.array[:] = fine.ravel()
    Q.multTranspose(image, coarse)
    product: Floats = coarse.array.copy()
    for thing in (coarse, image):
        thing.destroy()
    return product


def _prolong(Q: PETSc.Mat, coarse: Floats) -> Floats:
    """Return Q times the owned part of a vector. Collective."""
    unknowns, image = Q.createVecs()
    unknowns.array[:] = coarse
    Q.mult(unknowns, image)
    product: Floats = image.array.copy()
    for thing in (unknowns, image):
        thing.destroy()
    return product


def aggregate(nodes: Floats, stiffness: PETSc.Mat) -> list[Aggregates]:
    """Return aggregates of nodes, with their rigid motions. Collective.

    Args:
        nodes: Coordinates of the owned nodes, shape (num_nodes, gdim).
        stiffness: K in nodal unknowns, in blocks; only the pattern and the strength of its entries
            matter.

    Returns:
        The aggregates on each level, finest first; an empty list for a small problem.
    """
    modes = _rigid_motions(nodes, stiffness)
    stiffness.setNearNullSpace(modes)
    modes.destroy()
    ksp = PETSc.KSP().create(stiffness.comm)
    prefix = own_prefix(ksp, COARSE, AGGREGATION)
    PETSc.Options()[prefix + "pc_gamg_agg_nsmooths"] = (
        0  # no smoothing, whatever options the user gives
    )
    ksp.setOptionsPrefix(prefix)
    pc = ksp.getPC()
    try:
        ksp.setFromOptions()
        ksp.setOperators(stiffness)
        ksp.setUp()
        return [
            Aggregates.of(pc.getMGInterpolation(level))
            for level in reversed(range(1, pc.getMGLevels()))
        ]
    finally:
        stiffness.setNearNullSpace(PETSc.NullSpace())
        for thing in (
            pc,
            ksp,
        ):  # immediately: Python's garbage collection would delay this until a collective clean-up
            thing.destroy()


def _rigid_motions(nodes: Floats, stiffness: PETSc.Mat) -> PETSc.NullSpace:
    """Return the rigid motions of all bodies together, at the given nodes."""
    x = stiffness.createVecRight()
    x.array[:] = nodes.ravel()
    modes = PETSc.NullSpace().createRigidBody(x)
    x.destroy()
    return modes


class LinearElements:
    """The linear elements for a problem with quadratic displacements.

    Attributes:
        interpolation: Interpolation from vertices to the nodes of quadratic elements, in nodal
            unknowns and in blocks, without held components.
        nodes: Coordinates of the owned vertices, shape (num_vertices, gdim).
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
        """Return the stiffness of the linear elements, from K in nodal unknowns.

        The caller must destroy the matrix.
        """
        return K.PtAP(self.interpolation)

    def at_vertices(self, motion: PETSc.Vec) -> Floats:
        """Return a nodal motion at the owned vertices, shape (num_vertices, gdim)."""
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
    """Return the rows of an interpolation that belong to vertices. Collective."""
    pointer, column, value = interpolation.getValuesCSR()
    # A linear shape function exceeds 1/2 only at its own vertex; at midside nodes it is at most
    # 1/2.
    at_vertex = 0.9
    kept = value > at_vertex
    row = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))[kept]
    begin = np.searchsorted(row, np.arange(len(pointer))).astype(PETSc.IntType)
    csr = (begin, column[kept], np.ones(len(row)))
    return PETSc.Mat().createAIJ(interpolation.getSizes(), csr=csr, comm=interpolation.comm)


LARGE = 500_000
"""Number of unknowns above which memory matters more than a tenth of the run time."""

SPECTRAL_RADIUS = {
    "ksp_type": "cg",
    "ksp_norm_type": "none",
    "ksp_max_it": 10,  # sufficient for an estimate
    "pc_type": "jacobi",
}


class CoarseSpaces:
    """Coarse spaces of multigrid in the jump basis.

    Attributes:
        interpolations: The current interpolations, finest first.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        """Create the aggregates. Collective.

        Args:
            problem: Problem with the jump basis.
            stiffness: K in nodal unknowns; only the pattern and the strength of its entries matter.
        """
        self._problem = problem
        self._spectrum = own_prefix(self, SPECTRUM, SPECTRAL_RADIUS)
        self._linear = LinearElements(problem) if problem.degree == 2 else None
        self._rigid = self._aggregate(stiffness)
        self.interpolations: list[PETSc.Mat] = []
        self._operators: list[PETSc.Mat] = []
        self._smoothing: list[BlockedProducts] = []
        self._transfers: list[BlockedInterpolation] = []
        if self.levels > 1:
            self._set(self._rigid, stiffness)

    @property
    def levels(self) -> int:
        """Return the number of multigrid levels, including the finest."""
        return self._first + len(self._rigid) + 1

    @property
    def _first(self) -> int:
        """Return the level whose nodes are aggregated; 0 is the finest."""
        return 0 if self._linear is None else 1

    def _aggregate(self, stiffness: PETSc.Mat) -> list[Aggregates]:
        """Return aggregates of the nodes, or of the vertices of quadratic elements. Collective."""
        if self._linear is None:
            return aggregate(_nodes(self._problem), stiffness)
        linear = _regular(self._linear.stiffness(stiffness))
        levels = aggregate(self._linear.nodes, linear)
        linear.destroy()
        return levels

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        self._clear()
        if self._linear is not None:
            self._linear.destroy()

    def _clear(self) -> None:
        """Destroy interpolations and operators. Collective."""
        for things in (self.interpolations, self._operators, self._smoothing, self._transfers):
            for thing in things:
                thing.destroy()
            things.clear()

    def add(self, motion: PETSc.Vec, stiffness: Callable[[], PETSc.Mat]) -> None:
        """Replace the aggregates of all levels by aggregates with one more motion. Collective.

        Args:
            motion: Motion in the jump basis.
            stiffness: Function that creates K in nodal unknowns; this method destroys K.
        """
        nodal = motion.duplicate()
        self._problem.basis.T.mult(motion, nodal)
        moved = nodal.array.reshape(-1, self._problem.bodies.gdim)
        if self._linear is not None:
            moved = self._linear.at_vertices(nodal)
        levels = []
        for rigid in self._rigid:
            richer, moved = rigid.with_motion(moved, motion.comm)
            levels.append(richer)
        nodal.destroy()
        if self._aggregates is self._rigid or motion.getSize() >= LARGE:
            self._clear()
        K = stiffness()  # only now, to save memory
        self._set(levels, K)
        K.destroy()

    def _set(self, levels: list[Aggregates], stiffness: PETSc.Mat) -> None:
        """Store the aggregates of all levels, and create the finest interpolation. Collective."""
        self._aggregates = levels
        M = self._problem.basis.M
        if self._linear is None:
            nodal = _smoothed(stiffness, levels[0], self._spectrum)
            self._put(0, M.matMult(nodal))
            nodal.destroy()
        else:
            self._put(0, M.matMult(self._linear.interpolation))
        self._rows = _rows(self.interpolations[0], self._problem.basis.index)

    def _put(self, depth: int, P: PETSc.Mat) -> None:
        """Store the interpolation of a level, in place of the level's old interpolation if any."""
        if depth == len(self.interpolations):
            self.interpolations.append(P)
        else:
            P.copy(self.interpolations[depth], PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            P.destroy()
        self._made = depth + 1

    def project(self, A: PETSc.Mat, held: Ints, pc: PETSc.PC) -> None:
        """Form the operators PᵀAP of all levels. Collective.

        Args:
            A: Operator of the finest level, with a scaled identity in the rows and columns at
                ``held``.
            held: Local owned indices of unknowns that are zero.
            pc: Preconditioner of type "mg" with the same number of levels. It receives
                interpolations and coarse operators; the solver sets its finest operator.
        """
        self._hold(held)
        for depth in range(self.levels - 1):
            level = self.levels - 1 - depth
            if depth == self._made:
                aggregates = self._aggregates[depth - self._first]
                self._put(depth, _smoothed(A, aggregates, self._spectrum))
            P = self.interpolations[depth]
            if depth == len(self._transfers):
                self._transfers.append(BlockedInterpolation(P))
            self._transfers[depth].fill(P)
            pc.setMGInterpolation(level, self._transfers[depth].matrix)
            if depth == len(self._operators):
                A = _regular(_coarse(A, P))
                self._operators.append(A)
                self._smoothing.append(BlockedProducts(A, np.float32))
            else:
                A = _regular(A.PtAP(P, self._operators[depth]))
            self._smoothing[depth].fill(A)
            multiplies = self._smoothing[depth].matrix if level > 1 else A
            pc.getMGSmoother(level - 1).setOperators(multiplies, A)

    def _hold(self, held: Ints) -> None:
        """Remove held unknowns from the finest coarse space, and restore the other unknowns."""
        pointer, columns, values = self._rows
        index = self._problem.basis.index
        free = ~np.isin(index, held)
        kept = np.where(np.repeat(free, np.diff(pointer)), values, 0.0)
        finest = self.interpolations[0]
        rows = (index + finest.getOwnershipRange()[0]).astype(PETSc.IntType)
        finest.setValuesIJV(pointer, columns, kept, rowmap=rows)
        finest.assemble()


def _nodes(problem: Problem) -> Floats:
    """Return the coordinates of the owned nodes, shape (num_nodes, gdim)."""
    owned = problem.V.dofmap.index_map.size_local
    nodes: Floats = problem.V.tabulate_dof_coordinates()[:owned, : problem.bodies.gdim]
    return nodes


def _smoothed(A: PETSc.Mat, aggregates: Aggregates, prefix: str) -> PETSc.Mat:
    """Return Q - w D^-1 A Q with the tentative interpolation Q and the diagonal D of A. Collective.

    Args:
        A: Operator of the finer level.
        aggregates: Aggregates of the nodes on this level.
        prefix: Prefix of the options for the spectral radius of D^-1 A.
    """
    Q = aggregates.interpolation(A.comm)
    P = A.matMult(Q)
    diagonal = A.getDiagonal()
    diagonal.reciprocal()
    damping = 1.4  # factor of the smoothing Jacobi step, divided by the spectral radius
    diagonal.scale(-damping / _spectral_radius(A, prefix))
    P.diagonalScale(diagonal)
    P.axpy(1.0, Q, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    P.setBlockSizes(*Q.getBlockSizes())
    for thing in (Q, diagonal):
        thing.destroy()
    return P


def _spectral_radius(A: PETSc.Mat, prefix: str) -> float:
    """Return an estimate of the spectral radius of D^-1 A, by a few iterations of CG.

    Collective.
    """
    ksp = PETSc.KSP().create(A.comm)
    x, b = A.createVecs()
    try:
        ksp.setOptionsPrefix(prefix)
        ksp.setComputeSingularValues(True)
        ksp.setFromOptions()
        ksp.setOperators(A)
        b.setRandom()
        ksp.solve(b, x)
        largest, _ = ksp.computeExtremeSingularValues()
    finally:
        for thing in (ksp, x, b):
            thing.destroy()
    return float(largest)


def _coarse(A: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """Return PᵀAP as a new matrix. Collective."""
    if A.comm.size > 1:
        return A.PtAP(P)
    with default("matptap_via", "rap"):  # twice as fast, but needs more memory
        return A.PtAP(P)


def _regular(A: PETSc.Mat) -> PETSc.Mat:
    """Return a coarse operator with diagonal entries where an aggregate lacks a motion.

    Collective.
    """
    diagonal = A.getDiagonal()
    empty = diagonal.array == 0
    if A.comm.tompi4py().allreduce(bool(empty.any())):
        scale = diagonal.sum() / diagonal.getSize()
        diagonal.array[:] = np.where(empty, scale, 0.0)
        A.setDiagonal(diagonal, PETSc.InsertMode.ADD_VALUES)
    diagonal.destroy()
    return A


def _rows(A: PETSc.Mat, local: Ints) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray]:
    """Return the rows at local indices, as pointers, global columns and values. Collective."""
    first = A.getOwnershipRange()[0]
    chosen = PETSc.IS().createGeneral((local + first).astype(PETSc.IntType), comm=A.getComm())
    columns = every_column(A)
    part = A.createSubMatrix(chosen, columns)
    pointer, column, value = part.getValuesCSR()
    for thing in (chosen, columns, part):
        thing.destroy()
    return pointer, column, value
