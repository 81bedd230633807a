"""Contact as rows B u ≤ g: what every formulation makes of surfaces, and all else is made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.sparse_rows import Entries, entries_of, matrix_of_entries, unknowns
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class Constraints:
    """The inequalities B u ≤ g, a row each; row i is kept by the rank that owns ``host[i]``.

    A row is the jump (u_a − u_b)·n of two surfaces at a node: positive where they come closer. It
    is a contact pair of one *host* node and any number of *guests*, on any ranks: none at a rigid
    obstacle, one where nodes match, several with weights where they do not. One component of the
    host that no support holds will be replaced by the jump (:mod:`jump_basis`). B itself knows
    nothing of supports: they take part in the jump as long as they move.

    With forces λ ≥ 0 (force) of the rows, −Bᵀλ are the contact forces on the nodes.

    Attributes:
        B: Shape (m, num_dofs), sparse: rows as hosts are distributed, columns as V's unknowns.
        host: Local block dof of each host, owned by this rank, shape (m_local,).
        gap: Initial gap g (length), negative for interference, shape (m_local,).
        normal: Unit normal out of a's body, shape (m_local, gdim).
        surface: Number of the contact or obstacle from 0, shape (m_local,); obstacles count on
            behind the contacts.
    """

    B: PETSc.Mat
    host: Ints
    gap: Floats
    normal: Floats
    surface: Ints

    def __repr__(self) -> str:
        return f"Constraints({len(self.host)} hosted by this rank)"

    def jumps(self, u: PETSc.Vec) -> Floats:
        """B u (length) of a displacement, shape (m_local,). Collective."""
        on_rows = self.B.createVecLeft()
        self.B.mult(u, on_rows)
        jumps: Floats = on_rows.array.copy()
        on_rows.destroy()
        return jumps

    def nodal_magnitudes(self, V: fem.FunctionSpace) -> PETSc.Mat:
        """‖B_ik‖ of row i at node k: the magnitude of the force there, for λ_i = 1. Collective.

        1 at the host and its guest where nodes match, and the guest's weight where they do not;
        on each side they add up to 1 if no weight of that side is negative.

        Returns:
            Shape (m, num_nodes), sparse, distributed as B and V's nodes.
        """
        row, column, value = entries_of(self.B)
        index_map, gdim = V.dofmap.index_map, V.dofmap.index_map_bs
        nodes = (index_map.size_local, index_map.size_global)
        squares = [(row, column // gdim, value**2)]
        magnitudes = matrix_of_entries(self.B.comm, self.B.getSizes()[0], nodes, squares)
        pointer, node, square = magnitudes.getValuesCSR()
        magnitudes.setValuesCSR(pointer, node, np.sqrt(square))
        magnitudes.assemble()
        return magnitudes


class Formulation(Protocol):
    """How contact of named surfaces becomes rows."""

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """The rows of these surfaces. Collective.

        Each host has a component that no support holds and that has its share in the row
        (:func:`surface_nodes.can_host`).

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
    terms: Sequence[Entries],
) -> Constraints:
    """Rows as sums of terms c·u at nodes. Collective.

    Args:
        V: Displacement space.
        host: See :class:`Constraints`, as the next three.
        gap: Initial gaps (length).
        normal: Unit normals.
        surface: Numbers of the contacts.
        terms: Lists of terms: local rows, shape (n,), global block dofs of the nodes, shape (n,),
            and coefficients c, shape (n, gdim).
    """
    comm, gdim = V.mesh.comm, V.dofmap.index_map_bs
    rows = (len(host), comm.allreduce(len(host)))
    entries: list[Entries] = []
    for row, node, coefficient in terms:
        columns = np.asarray(node, dtype=np.int64)[:, None] * gdim + np.arange(gdim)
        entries.append((np.repeat(row, gdim), columns.ravel(), coefficient.ravel()))
    B = matrix_of_entries(comm, rows, unknowns(V), entries)
    return Constraints(B, host, gap, normal, surface)


def joined(V: fem.FunctionSpace, parts: Sequence[Constraints]) -> Constraints:
    """The rows of all parts, whose matrices are destroyed. Collective."""
    entries: list[Entries] = []
    count = 0
    for part in parts:
        row, column, value = entries_of(part.B)
        entries.append((row + count, column, value))
        count += len(part.host)
        part.B.destroy()
    rows = (count, V.mesh.comm.allreduce(count))
    B = matrix_of_entries(V.mesh.comm, rows, unknowns(V), entries)
    none = np.zeros(0, dtype=np.int32)
    return Constraints(
        B,
        np.concatenate([none, *(part.host for part in parts)]),
        np.concatenate([np.zeros(0), *(part.gap for part in parts)]),
        np.concatenate([np.zeros((0, V.dofmap.index_map_bs)), *(part.normal for part in parts)]),
        np.concatenate([none, *(part.surface for part in parts)]),
    )
