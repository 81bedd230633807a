"""Coarse spaces of multigrid: smoothed aggregation, body by body, seen through closed contact.

In the jump basis an operator couples the bodies, and aggregates that mix them need more than
the rigid motions of one body (the in-plane slip of frictionless contact). So the aggregates are
those of the stiffness K in nodal unknowns, where bodies do not see each other and 6 (3 in 2D)
motions do. Their tentative interpolation Q is smoothed by one Jacobi step, P = Q - w D^-1 K Q. In
the jump basis y = M u the finest one is M P, without its rows of held unknowns. At a closed pair
the host takes the normal displacement of its guest, and slides along it. Coarser levels do the same
with the operators that they have. A set-up forms the coarse operators PᵀAP.

For quadratic elements the first coarse space is that of linear elements (:class:`LinearElements`),
mapped by M in the same way, and the nodes of the linear elements are aggregated.

Plastic flow hardly changes the volume of a body, but motions of rigid pieces do, and so cost much
more energy. Therefore the last Newton increment can be one more motion of every aggregate.
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
"""From so many unknowns on memory counts for more than a tenth of the time."""

SPECTRAL_RADIUS = {
    "ksp_type": "cg",
    "ksp_norm_type": "none",
    "ksp_max_it": 10,  # enough for an estimate
    "pc_type": "jacobi",
}


class CoarseSpaces:
    """Coarse spaces in the jump basis.

    Attributes:
        interpolations: Those made so far, finest first.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        """Aggregate. Collective.

        Args:
            problem: Whose jump basis is meant.
            stiffness: K in nodal unknowns; only its pattern and strengths matter.
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
        """Levels of multigrid, with the finest one; 1 for a small problem."""
        return self._first + len(self._rigid) + 1

    @property
    def _first(self) -> int:
        """The level whose nodes are aggregated, the finest one being 0."""
        return 0 if self._linear is None else 1

    def _aggregate(self, stiffness: PETSc.Mat) -> list[Aggregates]:
        """Aggregate the nodes, or the vertices of quadratic elements. Collective."""
        if self._linear is None:
            return aggregate(_nodes(self._problem), stiffness)
        linear = _regular(self._linear.stiffness(stiffness))
        levels = aggregate(self._linear.nodes, linear)
        linear.destroy()
        return levels

    def destroy(self) -> None:
        """Give back memory at once. Collective."""
        self._clear()
        if self._linear is not None:
            self._linear.destroy()

    def _clear(self) -> None:
        """Forget interpolations and operators. Collective."""
        for things in (self.interpolations, self._operators, self._smoothing, self._transfers):
            for thing in things:
                thing.destroy()
            things.clear()

    def add(self, motion: PETSc.Vec, stiffness: Callable[[], PETSc.Mat]) -> None:
        """Make all levels again, with one motion besides the rigid ones. Collective.

        Args:
            motion: In the jump basis.
            stiffness: Makes K in nodal unknowns, which is destroyed.
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
        K = stiffness()  # not before, since it needs memory
        self._set(levels, K)
        K.destroy()

    def _set(self, levels: list[Aggregates], stiffness: PETSc.Mat) -> None:
        """Take these aggregates; those of coarser levels follow in a set-up. Collective."""
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
        """Take an interpolation, in the place of one with the same pattern if there is one."""
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
            pc: Preconditioner of type "mg", with as many levels. Gets interpolations and operators;
                its finest operator is set by whoever solves with it.
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
        """Take the held unknowns out of the finest coarse space, and put back the others."""
        pointer, columns, values = self._rows
        index = self._problem.basis.index
        free = ~np.isin(index, held)
        kept = np.where(np.repeat(free, np.diff(pointer)), values, 0.0)
        finest = self.interpolations[0]
        rows = (index + finest.getOwnershipRange()[0]).astype(PETSc.IntType)
        finest.setValuesIJV(pointer, columns, kept, rowmap=rows)
        finest.assemble()


def _nodes(problem: Problem) -> Floats:
    """Return where the owned nodes are, shape (num_nodes, gdim)."""
    owned = problem.V.dofmap.index_map.size_local
    nodes: Floats = problem.V.tabulate_dof_coordinates()[:owned, : problem.bodies.gdim]
    return nodes


def _smoothed(A: PETSc.Mat, aggregates: Aggregates, prefix: str) -> PETSc.Mat:
    """Q - w D^-1 A Q, for the tentative interpolation Q, with D the diagonal of A. Collective.

    Args:
        A: Of the finer level.
        aggregates: Aggregates of its nodes.
        prefix: Prefix of the options for the spectral radius of D^-1 A.
    """
    Q = aggregates.interpolation(A.comm)
    P = A.matMult(Q)
    diagonal = A.getDiagonal()
    diagonal.reciprocal()
    damping = 1.4  # factor of the Jacobi step that smooths, over the spectral radius
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
    """PᵀAP for the first time. Collective."""
    if A.comm.size > 1:
        return A.PtAP(P)
    with default("matptap_via", "rap"):  # twice as fast, with more memory
        return A.PtAP(P)


def _regular(A: PETSc.Mat) -> PETSc.Mat:
    """A coarse operator, with the identity where an aggregate has no such motion. Collective."""
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
