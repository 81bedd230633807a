"""Divide the cells of each rank into subdomains, with their stiffness and its generalised inverse.

A piece is connected through facets, so its only strain-free motions are rigid motions of the whole
piece. Its nodes are copies of the mesh nodes, torn from the nodes of other pieces.

:class:`TornStiffness` stores K of all pieces on a rank, torn from each other, and its generalised
inverse K⁺. The pieces are uncoupled. One sparse matrix on this rank contains the stiffness of all
pieces, and one factorisation factorises them all. The kernel of K consists of the rigid motions R.
Let M have one column (a spring) for each motion, and let MᵀR be invertible. Then K⁺ = (K + k M
Mᵀ)⁻¹ is a generalised inverse of K itself, K K⁺ K = K, for any k > 0 (T. Brzobohatý, Z. Dostál, T.
Kozubek, P. Kovář and A. Markopoulos, Int. J. Numer. Meth. Engng 88 (2011), 493).
"""

from dataclasses import dataclass
from itertools import pairwise

from mpi4py import MPI
from petsc4py import PETSc

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from scipy.linalg import qr
from scipy.sparse import coo_array, triu
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import TangentForm
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import SUBDOMAINS, own_prefix


@dataclass(frozen=True)
class Subdomains:
    """The pieces on this rank; torn nodes are numbered piece by piece.

    Attributes:
        first: Global number of the first piece on this rank.
        count: Number of pieces on this rank.
        total: Number of pieces on all ranks.
        torn: Torn node for each node of each owned cell, shape (num_cells, nodes of a cell).
        node: Local block dof of each torn node, shape (num_torn,).
        ends: First torn node of each piece, followed by the number of torn nodes, shape (count +
            1,).
        motions: Orthonormal rigid motions R of each piece, shape (num_torn, gdim, num_modes).
        fixing: Torn unknowns that fix the pieces; for each piece as many as it has rigid motions.
    """

    first: int
    count: int
    total: int
    torn: Ints
    node: Ints
    ends: Longs
    motions: Floats
    fixing: Ints

    @property
    def of_node(self) -> Longs:
        """Return the global number of each torn node's piece."""
        return self.first + np.repeat(np.arange(self.count), np.diff(self.ends))


def make_subdomains(problem: Problem, wanted: int, exactly: bool = False) -> Subdomains:
    """Divide the bodies into pieces. Collective.

    Args:
        problem: The bodies.
        wanted: Number of pieces on all ranks. Each part of a body that is connected by facets on a
            rank gets at least one piece.
        exactly: Whether to refuse a number that is smaller than the number of these parts.

    Raises:
        InputError: If ``exactly`` is set and the number is too small.
    """
    V, comm = problem.V, problem.comm
    topology = V.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    nodes = V.dofmap.list[:owned]
    x = V.tabulate_dof_coordinates()
    middles = x[nodes].mean(axis=1)[:, : problem.bodies.gdim]
    share = comm.allreduce(owned) / wanted
    label = _connected(problem, np.zeros(owned, dtype=np.int32))
    least = comm.allreduce(int(label.max(initial=-1)) + 1)
    if exactly and wanted < least:
        raise InputError(
            f"subdomains = {wanted} is less than {least}, the number of connected parts of bodies "
            f"on all ranks; give {least} or more, use fewer ranks, or remove subdomains."
        )
    pieces = np.empty(owned, dtype=np.int32)
    begun = 0
    for part in range(label.max(initial=-1) + 1):
        cells = np.flatnonzero(label == part)
        number = max(1, round(len(cells) / share))
        pieces[cells] = begun + bisected(middles[cells], min(number, len(cells)))
        begun += number
    of_cell = _connected(problem, pieces)
    count = int(of_cell.max(initial=-1)) + 1
    size = len(x)
    keys, torn = np.unique(of_cell[:, None].astype(np.int64) * size + nodes, return_inverse=True)
    node = (keys % size).astype(np.int32)
    ends = np.searchsorted(keys // size, np.arange(count + 1))
    motions, fixing = _rigid(problem, x[node], ends)
    last = comm.scan(count)
    total = comm.allreduce(count)
    torn = torn.reshape(nodes.shape).astype(np.int32)
    return Subdomains(last - count, count, total, torn, node, ends, motions, fixing)


def bisected(x: Floats, count: int) -> Ints:
    """Divide points into sets of similar size, by bisection of the longest side of their box.

    Args:
        x: Points, shape (n, gdim).
        count: Number of sets, at most n.

    Returns:
        The number of each point's set, shape (n,).
    """
    label = np.zeros(len(x), dtype=np.int32)
    if count < 2:
        return label
    axis = int(np.argmax(np.ptp(x, axis=0)))
    order = np.argsort(x[:, axis], kind="stable")
    half = count // 2
    cut = round(len(x) * half / count)
    low, high = order[:cut], order[cut:]
    label[low] = bisected(x[low], half)
    label[high] = half + bisected(x[high], count - half)
    return label


def _connected(problem: Problem, label: Ints) -> Ints:
    """Return numbers of cells, equal for cells of equal label that facets connect. Collective."""
    topology = problem.V.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    to_cell = topology.connectivity(topology.dim - 1, topology.dim)
    between = np.diff(to_cell.offsets) == 2
    first = to_cell.offsets[:-1][between]
    a, b = to_cell.array[first], to_cell.array[first + 1]
    here = (a < len(label)) & (b < len(label))
    a, b = a[here], b[here]
    same = label[a] == label[b]
    ones = np.ones(int(same.sum()), dtype=np.int8)
    graph = coo_array((ones, (a[same], b[same])), shape=(len(label), len(label)))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def _rigid(problem: Problem, x: Floats, ends: Longs) -> tuple[Floats, Ints]:
    """Return orthonormal motions of each piece, and the unknowns that best fix the pieces."""
    bodies = problem.bodies
    gdim, modes = bodies.gdim, bodies.num_modes
    motions, fixing = np.zeros((len(x), gdim, modes)), []
    for begin, end in pairwise(ends):
        here = x[begin:end]
        centred = here - here.mean(axis=0)
        spread = bodies.kinematics.rigid_modes(centred / np.abs(centred).max())
        basis, _ = np.linalg.qr(spread.reshape(-1, modes))
        motions[begin:end] = basis.reshape(-1, gdim, modes)
        _, _, pivots = qr(basis.T, mode="economic", pivoting=True)
        fixing.append(begin * gdim + pivots[:modes])
    return motions, np.concatenate([np.zeros(0, dtype=np.int32), *fixing]).astype(np.int32)


class Factors:
    """Factors of matrices with one pattern, updated for new values."""

    def __init__(self) -> None:
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        preset = {
            "ksp_type": "preonly",
            "pc_type": "cholesky",
            "pc_factor_mat_solver_type": "mumps",
        }
        self._ksp.setOptionsPrefix(own_prefix(self, SUBDOMAINS, preset))
        self._ksp.setFromOptions()
        self._b, self._x = PETSc.Vec(), PETSc.Vec()

    def make(self, A: PETSc.Mat) -> str | None:
        """Factorise a matrix, and return the reason if this fails.

        Returns:
            The reason why no factors exist; None if they exist.
        """
        if not A.getSize()[0]:
            return None
        if not self._x:
            self._x, self._b = A.createVecs()
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(False)
        self._ksp.setOperators(A)
        self._ksp.setUp()
        pc.setReusePreconditioner(True)  # keeps the factors if A changes later
        if pc.getFailedReason():
            forget_factors(self._ksp)
            return "a pivot is zero"
        return None

    def solve(self, b: Floats) -> Floats:
        """Return the solution of A x = b, same shape."""
        if not b.size:
            return np.zeros(0)
        self._b.array[:] = b
        self._ksp.solve(self._b, self._x)
        solution: Floats = self._x.array_r.copy()
        return solution


class TornStiffness:
    """K of this rank's pieces, without gluing and supports. Methods are local unless collective.

    Attributes:
        size: Number of torn unknowns on this rank.
    """

    def __init__(self, fields: QuadratureFields, pieces: Subdomains) -> None:
        """Compile the form, and create the sparsity pattern. Collective."""
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
        """Update K to the current strains and ``rho``, and return this object. Collective."""
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
        """Compute K⁺ for the current K. Collective.

        Raises:
            LinearFailure: If the rigid motions are not the kernel of K.
        """
        moved = self.multiply(self._motions.sum(axis=1))
        # Force of a unit rigid motion, relative to the stiffness, above the level of rounding
        # errors.
        not_rigid = 1e-7
        stiff = float(np.abs(moved).max(initial=0)) > not_rigid * self._scale
        self._add_springs(1.0)
        failure = self._factors.make(self.matrix)
        self._add_springs(-1.0)
        if failure is None and not stiff and self.size:
            failure = self._proved()
        if stiff:
            failure = "rigid motions strain it, as on curved cells with linear elements"
        failures = [text for text in self._comm.allgather(failure) if text is not None]
        if failures:
            raise LinearFailure(
                f"the stiffness of a subdomain could not be factorised ({failures[0]}); its"
                " tangent is singular or nearly singular, perhaps because the whole subdomain"
                " flows plastically"
            )

    def _proved(self) -> str | None:
        """Return the fault of the factors in a test with balanced forces; None if they are good."""
        forces = self.multiply(np.cos(np.arange(self.size)))
        left = self.multiply(self.solve(forces)) - forces
        # Largest relative residual of a solution for which factors count as good.
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
    """Return a symmetric blocked zero matrix with the pattern of K."""
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
