"""The basis in which contact is a bound: u = T y.

For every pair one displacement component of the host node is replaced by the jump
s = (u_a − u_b)·n; all other unknowns stay as they are. Then the condition of K_h is s ≤ g, the
operator is TᵀKT, and the block size is kept (mathematics of the paper's K_h; the prototype of this
choice keeps multigrid as good as without contact).
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.contact.node_pairs import ContactPairs
from perfplast_fenicsx.errors import InputError, raise_together

LONGEST_CHAIN = 8
"""Replaced unknowns may refer to replaced unknowns of other nodes, at most this many in a row."""


@dataclass(frozen=True)
class JumpBasis:
    """u = T y and y = M u, and where y is bounded.

    Attributes:
        T: Sparse matrix from jump unknowns to displacement.
        M: Its inverse.
        index: Local (owned) indices of the bounded entries of y, shape (num_pairs,), one for each
            row of the pairs it was made of.
        gap: Upper bounds g there (length).
    """

    T: PETSc.Mat
    M: PETSc.Mat
    index: npt.NDArray[np.int32]
    gap: npt.NDArray[np.float64]


def make_basis(V: fem.FunctionSpace, pairs: ContactPairs) -> JumpBasis:
    """Build T and M. Collective.

    Raises:
        InputError: If a node carries more contact conditions than it has freedom for, or the
            conditions are tied to each other in a ring.
    """
    comm, gdim = V.mesh.comm, V.dofmap.index_map_bs
    component, inverse, mate = _choose(comm, pairs)
    # Row of pair i: s_i = sign n·u_host − sign n·u_guest
    offset = V.dofmap.index_map.local_range[0]
    host = (pairs.host + offset)[:, None] * gdim + np.arange(gdim)
    guest = pairs.guest[:, None] * gdim + np.arange(gdim)
    coefficient = pairs.sign[:, None] * pairs.normal
    row = host[np.arange(len(component)), component]
    identity = np.arange(*np.multiply(V.dofmap.index_map.local_range, gdim))

    M = _matrix(V, 3 * gdim)
    plain = np.setdiff1d(identity, row)
    _add(M, plain, plain, np.ones(len(plain)))
    _add(M, row[:, None], host, coefficient * pairs.host_free)
    _add(M, row[:, None], guest, -coefficient * pairs.guest_free)
    M.assemble()

    # u_row = Σ_j inverse_j (s_j − the terms of pair j outside the replaced components of the host)
    replaced = np.isin(host, row)
    Q, P = _matrix(V, 2 * gdim), _matrix(V, 3 * gdim * gdim)
    _add(Q, plain, plain, np.ones(len(plain)))
    for k in range(mate.shape[1]):
        has = mate[:, k] >= 0
        j, r, weight = mate[has, k], row[has], inverse[has, k]
        _add(Q, r, row[j], weight)
        others = weight[:, None] * coefficient[j] * pairs.host_free[j] * ~replaced[j]
        _add(P, r[:, None], host[j], -others)
        _add(P, r[:, None], guest[j], weight[:, None] * coefficient[j] * pairs.guest_free[j])
    Q.assemble()
    P.assemble()
    T = _resolve(Q, P)
    Q.destroy()
    P.destroy()
    return JumpBasis(T, M, (row - offset * gdim).astype(np.int32), pairs.gap)


def _choose(
    comm: MPI.Intracomm, pairs: ContactPairs
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Which component each pair replaces, and the inverse of the replaced part at each host.

    Gaussian elimination with column pivoting, for all hosts at once: k conditions at a host replace
    k of its components.

    Returns:
        The component of each pair; the row of the inverse that gives this component, shape
        (num_pairs, most conditions at a host); the pairs its entries belong to, −1 for none.
    """
    num, gdim = pairs.normal.shape
    nodes, group, sizes = np.unique(pairs.host, return_inverse=True, return_counts=True)
    most = int(sizes.max(initial=1))
    order = np.argsort(group, kind="stable")
    slot = np.empty(num, dtype=np.int64)
    slot[order] = np.arange(num) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    member = np.full((len(nodes), most), -1)
    member[group, slot] = np.arange(num)

    rows = np.zeros((len(nodes), most, gdim))
    rows[group, slot] = pairs.sign[:, None] * pairs.normal * pairs.host_free
    reduced, chosen = rows.copy(), np.zeros((len(nodes), most), dtype=np.int64)
    every = np.arange(len(nodes))
    entangled = 0
    for k in range(min(most, gdim)):
        real = member[:, k] >= 0
        chosen[:, k] = np.argmax(np.abs(reduced[:, k]), axis=1)
        pivot = reduced[every, k, chosen[:, k]]
        entangled += int((real & (np.abs(pivot) < 1e-3)).sum())
        safe = np.where(np.abs(pivot) < 1e-3, 1.0, pivot)
        factor = reduced[every[:, None], np.arange(most), chosen[:, k][:, None]] / safe[:, None]
        factor[:, : k + 1] = 0
        reduced -= factor[:, :, None] * reduced[:, k][:, None, :]
    entangled += int((sizes > gdim).sum())
    total = comm.allreduce(entangled)
    raise_together(
        comm,
        f"{total} contact nodes carry more independent conditions than they have freedom for; name"
        " each pair of faces once and leave nodes that supports hold out of the contact surfaces."
        if total
        else None,
    )
    block = np.broadcast_to(np.eye(most), (len(nodes), most, most)).copy()
    both = (member[:, :, None] >= 0) & (member[:, None, :] >= 0)
    picked = np.take_along_axis(rows, np.repeat(chosen[:, None, :], most, axis=1), axis=2)
    block[both] = picked[both]
    inverse = np.asarray(np.linalg.inv(block), dtype=np.float64)
    return chosen[group, slot], inverse[group, slot], member[group]


def _matrix(V: fem.FunctionSpace, row_length: int) -> PETSc.Mat:
    """An empty matrix laid out like the displacement vector."""
    bs, index_map = V.dofmap.index_map_bs, V.dofmap.index_map
    size = (index_map.size_local * bs, index_map.size_global * bs)
    A = PETSc.Mat().createAIJ((size, size), bsize=bs, nnz=row_length, comm=V.mesh.comm)
    A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    return A


def _add(A: PETSc.Mat, rows: npt.NDArray, columns: npt.NDArray, values: npt.NDArray) -> None:
    """Add entries given as arrays that broadcast together, leaving out zeros."""
    entries = [a.ravel() for a in np.broadcast_arrays(rows, columns, values)]
    kept = np.flatnonzero(entries[2])
    kept = kept[np.argsort(entries[0][kept], kind="stable")]
    i, j, v = (entry[kept] for entry in entries)
    first, count = A.getOwnershipRange()[0], np.diff(A.getOwnershipRange())[0]
    pointer = np.concatenate([[0], np.cumsum(np.bincount(i - first, minlength=count))])
    A.setValuesIJV(
        pointer.astype(PETSc.IntType), j.astype(PETSc.IntType), v, addv=PETSc.InsertMode.ADD_VALUES
    )


def _resolve(Q: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """T with T = Q + P T: the sum of P^k Q, which ends because chains of contact end."""
    T, term = Q.copy(), Q
    for _ in range(LONGEST_CHAIN):
        term = P.matMult(term)
        if term.norm() == 0:
            return T
        T.axpy(1.0, term)
    raise InputError(
        "the contact conditions are tied to each other in a ring of bodies; leave one of the"
        " contacts of the ring out."
    )
