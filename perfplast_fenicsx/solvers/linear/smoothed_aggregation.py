"""Create coarse spaces of multigrid: smoothed aggregation, body by body, across closed contact.

In the jump basis an operator couples the bodies. Aggregates that mix them would need more than the
rigid motions of one body (the in-plane slip of frictionless contact). So the aggregates are those
of the stiffness K in nodal unknowns, in which bodies are not coupled and 6 (in 2D 3) motions
suffice. One Jacobi step smooths their tentative interpolation Q: P = Q - w D^-1 K Q. In the jump
basis y = M u the finest interpolation is M P without the rows of held unknowns. At a closed pair
the host follows the normal displacement of its guest, and slides along it. Coarser levels use their
own operators in the same way. A set-up forms the coarse operators PᵀAP.

For quadratic elements the first coarse space is that of linear elements (:class:`LinearElements`),
mapped by M in the same way, and the nodes of the linear elements are aggregated.

Plastic flow hardly changes the volume of a body. Motions of rigid pieces do, and so have a much
larger energy. Therefore the last Newton increment can be one more motion of every aggregate.
"""

from collections.abc import Callable

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.aggregates import Aggregates, aggregate
from perfplast_fenicsx.solvers.linear.blocked_interpolation import BlockedInterpolation
from perfplast_fenicsx.solvers.linear.blocked_products import BlockedProducts
from perfplast_fenicsx.solvers.linear.contact_rows import every_column
from perfplast_fenicsx.solvers.linear.linear_elements import LinearElements
from perfplast_fenicsx.solvers.linear.petsc_options import SPECTRUM, default, own_prefix

LARGE = 500_000
"""Number of unknowns above which memory matters more than a tenth of the time."""

SPECTRAL_RADIUS = {
    "ksp_type": "cg",
    "ksp_norm_type": "none",
    "ksp_max_it": 10,  # enough for an estimate
    "pc_type": "jacobi",
}


class CoarseSpaces:
    """Coarse spaces in the jump basis.

    Attributes:
        interpolations: The present interpolations, finest first.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        """Create the aggregates. Collective.

        Args:
            problem: Problem with the jump basis.
            stiffness: K in nodal unknowns; only its pattern and the strength of its entries matter.
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
        """Return the number of multigrid levels including the finest; 1 for a small problem."""
        return self._first + len(self._rigid) + 1

    @property
    def _first(self) -> int:
        """Return the level whose nodes are aggregated, with 0 for the finest."""
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
        """Create all levels again, with one motion in addition to the rigid ones. Collective.

        Args:
            motion: Motion in the jump basis.
            stiffness: Function that creates K in nodal unknowns, which is destroyed.
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
        K = stiffness()  # only now, since it needs memory
        self._set(levels, K)
        K.destroy()

    def _set(self, levels: list[Aggregates], stiffness: PETSc.Mat) -> None:
        """Store these aggregates; a set-up creates those of coarser levels. Collective."""
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
        """Store an interpolation, replacing one with the same pattern if there is one."""
        if depth == len(self.interpolations):
            self.interpolations.append(P)
        else:
            P.copy(self.interpolations[depth], PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            P.destroy()
        self._made = depth + 1

    def project(self, A: PETSc.Mat, held: Ints, pc: PETSc.PC) -> None:
        """Form the operators PᵀAP of all levels. Collective.

        Args:
            A: Operator of the finest level, with rows and columns of the identity at ``held``.
            held: Local (owned) indices of unknowns that are zero.
            pc: Preconditioner of type "mg" with as many levels. It gets interpolations and
                operators; the solver sets its finest operator.
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
        """Remove held unknowns from the finest coarse space, and restore the others."""
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
        aggregates: Aggregates of its nodes.
        prefix: Prefix of the options for the spectral radius of D^-1 A.
    """
    Q = aggregates.interpolation(A.comm)
    P = A.matMult(Q)
    diagonal = A.getDiagonal()
    diagonal.reciprocal()
    damping = 1.4  # factor of the smoothing Jacobi step, over the spectral radius
    diagonal.scale(-damping / _spectral_radius(A, prefix))
    P.diagonalScale(diagonal)
    P.axpy(1.0, Q, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    P.setBlockSizes(*Q.getBlockSizes())
    for thing in (Q, diagonal):
        thing.destroy()
    return P


def _spectral_radius(A: PETSc.Mat, prefix: str) -> float:
    """Return the spectral radius of D^-1 A, from a few iterations of CG. Collective."""
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
    """Return PᵀAP for the first time. Collective."""
    if A.comm.size > 1:
        return A.PtAP(P)
    with default("matptap_via", "rap"):  # twice as fast, with more memory
        return A.PtAP(P)


def _regular(A: PETSc.Mat) -> PETSc.Mat:
    """Return a coarse operator, with the identity where an aggregate lacks a motion. Collective."""
    diagonal = A.getDiagonal()
    empty = diagonal.array == 0
    if A.comm.tompi4py().allreduce(bool(empty.any())):
        scale = diagonal.sum() / diagonal.getSize()
        diagonal.array[:] = np.where(empty, scale, 0.0)
        A.setDiagonal(diagonal, PETSc.InsertMode.ADD_VALUES)
    diagonal.destroy()
    return A


def _rows(A: PETSc.Mat, local: Ints) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray]:
    """Return rows with these local indices, as pointers, global columns and values. Collective."""
    first = A.getOwnershipRange()[0]
    chosen = PETSc.IS().createGeneral((local + first).astype(PETSc.IntType), comm=A.getComm())
    columns = every_column(A)
    part = A.createSubMatrix(chosen, columns)
    pointer, column, value = part.getValuesCSR()
    for thing in (chosen, columns, part):
        thing.destroy()
    return pointer, column, value
