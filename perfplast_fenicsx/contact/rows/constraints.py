"""Store contact as rows B u ≤ g, which every formulation creates from surfaces."""

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
"""Rows, nodes and coefficients of terms, and their shares in the row."""


def matrix_of_entries(
    comm: MPI.Intracomm | PETSc.Comm,
    rows: Sizes,
    columns: Sizes,
    entries: Sequence[Entries],
    block_size: int = 1,
) -> PETSc.Mat:
    """Return a sparse matrix from entries in any order, without zeros. Collective.

    Args:
        comm: The ranks.
        rows: Local and global number of rows.
        columns: Local and global number of columns.
        entries: Entries in any number of parts; repeated entries are added.
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
    """Return the owned entries, row by row."""
    pointer, column, value = A.getValuesCSR()
    row = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    return row, column.astype(np.int64), value


def unknowns(V: fem.FunctionSpace) -> Sizes:
    """Return the local and the global number of displacement unknowns."""
    index_map, gdim = V.dofmap.index_map, V.dofmap.index_map_bs
    return index_map.size_local * gdim, index_map.size_global * gdim


@dataclass(frozen=True)
class Source(FrictionTerms):
    """A contact, an obstacle or another origin of rows, with data besides the rows.

    Attributes:
        name: Name in resultants.
        on: Surface of its hosts, which messages and pressures name.
        called: Name in stages.
        tresca: See :class:`contact.FrictionTerms`.
        coulomb: See :class:`contact.FrictionTerms`.
        move: Given motion of the opposite side for ζ = 1 (length, one number for each direction);
            empty without motion.
        grows: Whether ζ multiplies the overlap of its bodies.
        inner: Whether its rows connect two bodies, so that their forces cancel in the sum over all
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
    """The inequalities B u ≤ g, one per row; the rank that owns ``host[i]`` stores row i.

    A row is the jump (u_a − u_b)·n of two surfaces at a node. It is positive if they approach each
    other. A row is a contact pair of one *host* node and any number of *guests*, on any ranks. It
    has no guest at a rigid obstacle, one guest where nodes match, and several weighted guests
    elsewhere. The jump will replace one free component of the host (:mod:`jump_basis`). B does not
    depend on supports: supported nodes contribute to the jump with their displacement.

    With forces λ ≥ 0 (force) of the rows, −Bᵀλ are the contact forces on the nodes.

    Attributes:
        B: Sparse matrix, shape (m, num_dofs), with rows distributed as the hosts and columns as V's
            unknowns.
        host: Local block dof of each host, owned by this rank, shape (m_local,).
        gap: Initial gap g (length), negative for interference, shape (m_local,).
        normal: Unit normal out of a's body, shape (m_local, gdim). For a row of several nodes with
            different normals it is the resultant force for λ = 1, whose length is nearly 1.
        surface: Index into ``sources`` of each row, shape (m_local,); without sources any numbers
            (:func:`named`).
        shares: Share of a row's force that each node receives along the normal: 1 at the host and
            at its guest for matching nodes. On either side the shares sum to 1; on elements of
            second order some may be negative. Shape (m, num_nodes), sparse, distributed as B and
            V's nodes.
        weights: Factors of displacements in the jump: the shares with the sign of their side, shape
            of ``shares``.
        area: Tributary length or area of each row, to which friction is proportional; not positive
            if it is unknown or zero, shape (m_local,).
        in_mean: Whether any row constrains only a mean of the jump. Bodies may then penetrate each
            other slightly at nodes and between them.
        remarks: Remarks on how the contacts were formed, one sentence each.
        sources: Sources of the rows, the same on every rank.
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
        """Return adhesion (stress) and Coulomb's coefficient of some rows, 0 without friction."""
        tresca, coulomb = (
            np.array([getattr(one, key) or 0.0 for one in self.sources])[self.surface[rows]]
            for key in ("tresca", "coulomb")
        )
        return tresca, coulomb

    def jumps(self, u: PETSc.Vec) -> Floats:
        """Return B u (length) of a displacement, shape (m_local,). Collective."""
        on_rows = self.B.createVecLeft()
        self.B.mult(u, on_rows)
        jumps: Floats = on_rows.array.copy()
        on_rows.destroy()
        return jumps


class Formulation(Protocol):
    """A formulation, which turns contact of named surfaces into rows."""

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows of these surfaces. Collective.

        Each host has a component that no support holds and that appears in the row
        (:func:`surface_facets.can_host`).

        Args:
            V: Displacement space.
            tagged_mesh: Mesh with names.
            fixed: Components held by supports at each local node, shape (num_nodes, gdim).

        Raises:
            InputError: If the surfaces do not fit each other or the formulation.
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
    """Return rows as sums of terms c·u at nodes. Collective.

    They hold at nodes, and have no remarks; ``dataclasses.replace`` gives others.

    Args:
        V: Displacement space.
        host: Hosts of the rows, see :class:`Constraints`.
        gap: Initial gaps (length).
        normal: Unit normals.
        surface: Numbers of sources.
        terms: Lists of terms, each of nodes on one side: local rows, shape (n,), global block dofs
            of the nodes, shape (n,), and coefficients c, shape (n, gdim). Where coefficients are
            not along the row's normal, the shares of :class:`Constraints` too, shape (n,).
        area: See :class:`Constraints`; without it there can be no friction.
        sources: As ``area``.
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
    """Return the same rows with sources that ``surface`` indexes. Collective.

    Rows without sources get a source ``surface NUMBER`` for each of their numbers, without friction
    and motion. It connects bodies if all its rows have guests.

    Raises:
        InputError: If there are sources, but ``surface`` contains other numbers.
    """
    numbers = np.unique(np.concatenate(comm.allgather(np.unique(constraints.surface))))
    count = len(constraints.sources)
    if count:
        if len(numbers) and not (numbers[0] >= 0 and numbers[-1] < count):
            raise InputError(
                f"rows of contact have the surface numbers {numbers.tolist()}, but there are "
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
    """Return the rows that contain only their hosts."""
    row, _, share = entries_of(constraints.shares)
    alone: npt.NDArray[np.bool_] = np.bincount(row[share != 0], minlength=len(constraints.host)) < 2
    return alone


def joined(
    V: fem.FunctionSpace, parts: Sequence[Constraints], sources: Sequence[Source] = ()
) -> Constraints:
    """Return the rows of all parts, which index these sources; the parts are destroyed.

    Collective.
    """
    whole = replace(stacked(V, parts), sources=tuple(sources))
    for part in parts:
        part.B.destroy()
        part.shares.destroy()
        part.weights.destroy()
    return whole


def stacked(V: fem.FunctionSpace, parts: Sequence[Constraints]) -> Constraints:
    """Return the rows of all parts, one part after another on each rank. Collective.

    The sources are those of the first part; other parts have other numbers in ``surface``.
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
    """Return matrices stacked on each rank. Collective."""
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
