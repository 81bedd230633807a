"""Store contact as rows B u ≤ g, which each formulation creates from surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.sparse import coo_array

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.declared.contact import FrictionTerms
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import lasting

Sizes = tuple[int, int]
"""Number of rows or columns that this rank owns, and their number on all ranks."""

Entries = tuple[npt.NDArray[np.integer], npt.NDArray[np.integer], Floats]
"""Local rows, global columns and values, shape (n,) each."""

SharedEntries = tuple[npt.NDArray[np.integer], npt.NDArray[np.integer], Floats, Floats]
"""Local rows, global nodes, coefficients of terms, and the shares of the terms in the row."""


def matrix_of_entries(
    comm: MPI.Intracomm | PETSc.Comm,
    rows: Sizes,
    columns: Sizes,
    entries: Sequence[Entries],
    block_size: int = 1,
) -> PETSc.Mat:
    """Return a sparse matrix from entries in any order, without stored zeros. Collective.

    Args:
        comm: Communicator of the ranks.
        rows: Number of rows, on this rank and on all ranks.
        columns: Number of columns, on this rank and on all ranks.
        entries: Entries in any number of parts; entries at the same position are added.
        block_size: Block size of rows and columns.
    """
    none: Entries = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    row, column, value = (np.concatenate(parts) for parts in zip(none, *entries, strict=True))
    kept = value != 0
    place = (row[kept].astype(np.int64), column[kept].astype(np.int64))
    A = coo_array((value[kept], place), shape=(rows[0], columns[1])).tocsr()
    csr = (A.indptr.astype(PETSc.IntType), A.indices.astype(PETSc.IntType), A.data)
    return PETSc.Mat().createAIJ((rows, columns), bsize=block_size, csr=csr, comm=lasting(comm))


def entries_of(A: PETSc.Mat) -> tuple[Longs, Longs, Floats]:
    """Return the owned entries of a matrix, row by row."""
    pointer, column, value = A.getValuesCSR()
    row = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    return row, column.astype(np.int64), value


def unknowns(V: fem.FunctionSpace) -> Sizes:
    """Return the number of displacement unknowns on this rank and on all ranks."""
    index_map, gdim = V.dofmap.index_map, V.dofmap.index_map_bs
    return index_map.size_local * gdim, index_map.size_global * gdim


@dataclass(frozen=True)
class Source(FrictionTerms):
    """A contact, an obstacle or another origin of rows, with its data other than the rows.

    Attributes:
        name: Name in lists of resultants.
        on: Surface by which messages refer to the source: the surface that an obstacle is declared
            for, or the secondary surface of a contact.
        called: Name that stages use.
        tresca: See :class:`contact.FrictionTerms`.
        coulomb: See :class:`contact.FrictionTerms`.
        move: Prescribed motion of the opposite side at ζ = 1 (length, one number for each
            direction); empty if there is no motion.
        grows: Whether ζ multiplies the overlap of the bodies.
        inner: Whether the rows connect two bodies, so that their forces cancel in the sum over all
            bodies.
    """

    name: str
    on: str = ""
    called: str = ""
    tresca: float | None = None
    coulomb: float | None = None
    move: Sequence[float] = ()
    grows: bool = False
    inner: bool = False


@dataclass(frozen=True)
class Constraints:
    """The inequalities B u ≤ g, one in each row; the rank that owns ``host[i]`` stores row i.

    A row is the jump (u_a − u_b)·n between two surfaces at a node, which is positive if they
    approach each other. A row is a contact pair of one *host* node and any number of *guests*, on
    any ranks. It has no guest at a rigid obstacle, one guest where nodes match, and several
    weighted guests elsewhere. The jump later replaces one free component of the host
    (:mod:`jump_basis`). B does not depend on supports: displacements of supported nodes contribute
    to the jump too.

    Let λ ≥ 0 be the multipliers (force) of the rows. Then −Bᵀλ are the contact forces on the nodes.

    Attributes:
        B: Sparse matrix, shape (m, num_dofs), with rows distributed like the hosts and columns like
            the unknowns of V.
        host: Local block dof of each host, which this rank owns, shape (m_local,).
        gap: Initial gap g (length), negative for interference, shape (m_local,).
        normal: Unit normal out of the body of a, shape (m_local, gdim). For a row whose nodes have
            different normals, it is the resultant force for λ = 1, whose length is nearly 1.
        surface: Index of each row into ``sources``, shape (m_local,); any numbers if there are no
            sources (:func:`named`).
        shares: Fraction of the row's force that acts on each node along the normal; with matching
            nodes, 1 at the host and 1 at its guest. On each side the fractions sum to 1; on
            elements of second order some may be negative. Sparse, shape (m, num_nodes), distributed
            like B and the nodes of V.
        weights: Factors of displacements in the jump: ``shares`` with the sign of their side, same
            shape.
        area: Tributary length or area of each row, to which friction is proportional, shape
            (m_local,); not positive if it is unknown or zero.
        in_mean: Whether any row constrains only a weighted mean of the jump. Bodies may then
            penetrate each other slightly, at nodes and between them.
        remarks: Remarks on how the contacts were formed, one sentence each.
        sources: Sources of the rows, identical on all ranks.
    """

    B: PETSc.Mat
    host: Ints
    gap: Floats
    normal: Floats
    surface: Ints
    shares: PETSc.Mat
    weights: PETSc.Mat
    area: Floats
    in_mean: bool = False
    remarks: tuple[str, ...] = ()
    sources: tuple[Source, ...] = ()

    def __repr__(self) -> str:
        return f"Constraints({len(self.host)} hosted by this rank)"

    def friction_of(self, rows: Longs | Ints) -> tuple[Floats, Floats]:
        """Return adhesion (stress) and Coulomb's coefficient of ``rows``, 0 without friction."""
        tresca, coulomb = (
            np.array([getattr(one, key) or 0.0 for one in self.sources])[self.surface[rows]]
            for key in ("tresca", "coulomb")
        )
        return tresca, coulomb

    def jumps(self, u: PETSc.Vec) -> Floats:
        """Return B u (length) for a displacement, shape (m_local,). Collective."""
        on_rows = self.B.createVecLeft()
        self.B.mult(u, on_rows)
        jumps: Floats = on_rows.array.copy()
        on_rows.destroy()
        return jumps


class Formulation(Protocol):
    """A formulation, which forms rows for the contact between named surfaces."""

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows for these surfaces. Collective.

        Each host has a component that no support holds and that occurs in its row
        (:func:`surface_facets.can_host`).

        Args:
            V: Displacement space.
            tagged_mesh: Mesh with named bodies and surfaces.
            fixed: Components at each local node that supports hold, shape (num_nodes, gdim).

        Raises:
            InputError: If the surfaces do not fit each other, or do not fit the formulation.
        """


def make_constraints(
    V: fem.FunctionSpace,
    host: Ints,
    gap: Floats,
    normal: Floats,
    surface: Ints,
    terms: Sequence[Entries | SharedEntries],
    area: Floats | None = None,
    sources: tuple[Source, ...] = (),
) -> Constraints:
    """Return rows that are sums of terms c·u at nodes. Collective.

    The rows hold at nodes (``in_mean`` is False) and have no remarks; to change this, use
    ``dataclasses.replace``.

    Args:
        V: Displacement space.
        host: Hosts of the rows, see :class:`Constraints`.
        gap: Initial gaps (length).
        normal: Unit normals.
        surface: Numbers of the sources.
        terms: Lists of terms; each list has nodes of one side only. Each list contains local rows,
            shape (n,), global block dofs of the nodes, shape (n,), and coefficients c, shape (n,
            gdim). If coefficients are not parallel to the row's normal, the list also contains the
            shares of :class:`Constraints`, shape (n,).
        area: See :class:`Constraints`; without areas, friction is not possible.
        sources: See :class:`Constraints`.
    """
    comm, gdim = V.mesh.comm, V.dofmap.index_map_bs
    rows = (len(host), comm.allreduce(len(host)))
    entries: list[Entries] = []
    parts: list[Entries] = []
    signed: list[Entries] = []
    for term in terms:
        row, node, coefficient = term[:3]
        columns = np.asarray(node, dtype=np.int64)[:, None] * gdim + np.arange(gdim)
        entries.append((np.repeat(row, gdim), columns.ravel(), coefficient.ravel()))
        along = np.einsum("ni,ni->n", coefficient, normal[row])
        side = np.sign(np.bincount(row, along, len(host)))[row]
        share = term[3] if len(term) == 4 else side * along
        parts.append((row, node, share))
        signed.append((row, node, side * share))
    B = matrix_of_entries(comm, rows, unknowns(V), entries)
    at_nodes = matrix_of_entries(comm, rows, _nodes(V), parts)
    weights = matrix_of_entries(comm, rows, _nodes(V), signed)
    known = np.zeros(len(host)) if area is None else area
    return Constraints(B, host, gap, normal, surface, at_nodes, weights, known, sources=sources)


def named(comm: MPI.Intracomm, constraints: Constraints) -> Constraints:
    """Return the same rows, with sources to which ``surface`` refers. Collective.

    If the rows have no sources, each of their numbers gets a source ``surface NUMBER`` without
    friction and motion. Such a source connects bodies if all its rows have guests.

    Raises:
        InputError: If there are sources, but ``surface`` contains numbers that are not their
            indices.
    """
    numbers = np.unique(np.concatenate(comm.allgather(np.unique(constraints.surface))))
    count = len(constraints.sources)
    if count:
        if len(numbers) and not (numbers[0] >= 0 and numbers[-1] < count):
            raise InputError(
                f"contact rows have the surface numbers {numbers.tolist()}, but there are "
                f"{count} sources; number surfaces from 0, or give no sources."
            )
        return constraints
    place = np.searchsorted(numbers, constraints.surface).astype(np.int32)
    lone = np.zeros(len(numbers), dtype=np.int64)
    np.add.at(lone, place[_without_guests(constraints)], 1)
    lone = comm.allreduce(lone)
    sources = [
        Source(f"surface {number}", inner=not alone)
        for number, alone in zip(numbers.tolist(), lone.tolist(), strict=True)
    ]
    return replace(constraints, surface=place, sources=tuple(sources))


def _without_guests(constraints: Constraints) -> npt.NDArray[np.bool_]:
    """Return which rows contain only their hosts."""
    row, _, share = entries_of(constraints.shares)
    alone: npt.NDArray[np.bool_] = np.bincount(row[share != 0], minlength=len(constraints.host)) < 2
    return alone


def joined(
    V: fem.FunctionSpace, parts: Sequence[Constraints], sources: Sequence[Source] = ()
) -> Constraints:
    """Return the rows of all parts, with the given sources, and destroy the parts.

    Collective.
    """
    whole = replace(stacked(V, parts), sources=tuple(sources))
    for part in parts:
        part.B.destroy()
        part.shares.destroy()
        part.weights.destroy()
    return whole


def stacked(V: fem.FunctionSpace, parts: Sequence[Constraints]) -> Constraints:
    """Return the rows of all parts, one part after the other on each rank. Collective.

    The result has the sources of the first part; the numbers in ``surface`` must differ between
    parts.
    """
    count = sum(len(part.host) for part in parts)
    rows = (count, V.mesh.comm.allreduce(count))
    none = np.zeros(0, dtype=np.int32)
    return Constraints(
        _stacked(V, rows, unknowns(V), [part.B for part in parts]),
        np.concatenate([none, *(part.host for part in parts)]),
        np.concatenate([np.zeros(0), *(part.gap for part in parts)]),
        np.concatenate([np.zeros((0, V.dofmap.index_map_bs)), *(part.normal for part in parts)]),
        np.concatenate([none, *(part.surface for part in parts)]),
        _stacked(V, rows, _nodes(V), [part.shares for part in parts]),
        _stacked(V, rows, _nodes(V), [part.weights for part in parts]),
        np.concatenate([np.zeros(0), *(part.area for part in parts)]),
        any(part.in_mean for part in parts),
        tuple(remark for part in parts for remark in part.remarks),
        parts[0].sources if parts else (),
    )


def _stacked(
    V: fem.FunctionSpace, rows: Sizes, columns: Sizes, parts: Sequence[PETSc.Mat]
) -> PETSc.Mat:
    """Return a matrix of the given matrices, stacked on each rank. Collective."""
    entries: list[Entries] = []
    count = 0
    for part in parts:
        row, column, value = entries_of(part)
        entries.append((row + count, column, value))
        count += part.getLocalSize()[0]
    return matrix_of_entries(V.mesh.comm, rows, columns, entries)


def _nodes(V: fem.FunctionSpace) -> Sizes:
    index_map = V.dofmap.index_map
    return index_map.size_local, index_map.size_global
