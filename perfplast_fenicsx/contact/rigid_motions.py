"""Can any body still move as a rigid one?"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.constraints import Constraints
from perfplast_fenicsx.contact.sparse_rows import entries_of, matrix_of_entries
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box

ROUNDING = 1e-12
"""Coordinates below this share of the size of all bodies are zero."""

NEGLIGIBLE = 1e-10
"""Eigenvalues below this times the largest one count as zero."""


class RigidMotions:
    """What supports and contact say of the rigid motions R of all bodies."""

    def __init__(
        self,
        V: fem.FunctionSpace,
        bodies: Bodies,
        fixed: npt.NDArray[np.bool_],
        constraints: Constraints,
        ties: Constraints | None = None,
    ) -> None:
        """Form B R. Collective.

        Args:
            V: Displacement space.
            bodies: The bodies.
            fixed: Components held by supports at each local node, shape (num_nodes, gdim).
            constraints: The rows of B.
            ties: Rows that are held for ever.
        """
        self._V, self._bodies, self._gap = V, bodies, constraints.gap
        self._supports = _support_gram(V, bodies, fixed)
        self._jumps = rigid_jumps(V, bodies, constraints.B)
        if ties is not None:
            tied = rigid_jumps(V, bodies, ties.B)
            self._supports = self._supports + V.mesh.comm.allreduce(tied.T @ tied)

    def check(self, tagged_mesh: TaggedMesh) -> None:
        """Refuse bodies that supports and contact leave free to move rigidly. Collective.

        Args:
            tagged_mesh: Has the names of the bodies.

        Raises:
            InputError: Naming the motion and where the body is.
        """
        free = self._left_free(np.ones(len(self._gap), dtype=bool))
        if not free.shape[1]:
            return
        V, bodies = self._V, self._bodies
        strongest = int(np.argmax(np.abs(free).max(axis=1)))
        body, motion = divmod(strongest, bodies.num_modes)
        gdim = V.mesh.geometry.dim
        x = V.tabulate_dof_coordinates()[bodies.of_node == body, :gdim]
        low, high = bounding_box(V.mesh.comm, x)
        ends = np.where(abs(np.stack([low, high])) < ROUNDING * bodies.size, 0.0, [low, high])
        where = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in ends.T)
        raise InputError(
            f"'{_name(tagged_mesh, V, bodies, body)}' in the box [{where}] can move as a rigid body"
            f" ({bodies.kinematics.motions[motion]}): neither supports nor contact hold it; add a"
            " support, or a contact that stops this motion."
        )

    def first_active(self) -> PairFlags:
        """Pairs that an active set begins with, so that no body is free to move. Collective.

        These are the ones without a gap. Where they leave a motion free that all pairs together
        stop, those with the smallest gaps are added.
        """
        largest = self._V.mesh.comm.allreduce(float(self._gap.max(initial=0)), MPI.MAX)
        for width in (0.0, *(largest * 2.0**k for k in range(-20, 1))):
            held: PairFlags = self._gap <= width
            if not self._left_free(held).shape[1]:
                break
        return held

    def _left_free(self, held: PairFlags) -> Floats:
        """Motions that supports and these pairs leave free, as columns. Collective."""
        rows = self._jumps[held]
        return null_space(self._supports + self._V.mesh.comm.allreduce(rows.T @ rows))


def _name(tagged_mesh: TaggedMesh, V: fem.FunctionSpace, bodies: Bodies, body: int) -> str:
    """The names of the volumes that a body consists of. Collective."""
    inside = bodies.of_node[V.dofmap.list[tagged_mesh.cell_tags.indices, 0]] == body
    own = set(tagged_mesh.cell_tags.values[inside].tolist())
    tags = set().union(*V.mesh.comm.allgather(own))
    return "', '".join(name for name, tag in tagged_mesh.volumes.items() if tag in tags)


def rigid_jumps(V: fem.FunctionSpace, bodies: Bodies, B: PETSc.Mat) -> Floats:
    """B R: the jump of each pair hosted here in each rigid motion of each body. Collective.

    Returns:
        Shape (num_pairs, bodies.count * bodies.num_modes).
    """
    gdim, total = V.dofmap.index_map_bs, bodies.count * bodies.num_modes
    nodes = nodes_of(B, gdim)
    modes = bodies.rigid_modes(V.tabulate_dof_coordinates()[nodes])
    row = (nodes[:, None] * gdim + np.arange(gdim))[:, :, None]
    column = (bodies.of_node[nodes, None] * bodies.num_modes + np.arange(bodies.num_modes))[:, None]
    row, column = (np.broadcast_to(place, modes.shape).ravel() for place in (row, column))
    columns = (total if V.mesh.comm.rank == 0 else 0, total)
    R = matrix_of_entries(B.comm, B.getSizes()[1], columns, [(row, column, modes.ravel())])
    product = B.matMult(R)
    pair, motion, value = entries_of(product)
    jumps = np.zeros((B.getLocalSize()[0], total))
    jumps[pair, motion] = value
    for matrix in (R, product):
        matrix.destroy()
    return jumps


def nodes_of(B: PETSc.Mat, gdim: int) -> Longs:
    """Owned nodes with a part in any row. Collective."""
    counts = B.createVecRight()
    unknowns = B.getValuesCSR()[1]
    counts.setValues(unknowns, np.ones(len(unknowns)), addv=PETSc.InsertMode.ADD_VALUES)
    counts.assemble()
    nodes = np.flatnonzero(counts.array.reshape(-1, gdim).any(axis=1))
    counts.destroy()
    return nodes


def null_space(gram: Floats) -> Floats:
    """Orthonormal basis of the motions that cost nothing, as columns."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values <= NEGLIGIBLE * max(values.max(initial=0), 1e-300)]


def _support_gram(V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_]) -> Floats:
    """Σ over supported components of their square, as a quadratic form in the rigid motions.

    Collective.
    """
    nodes, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    x = V.tabulate_dof_coordinates()[nodes]
    rows = bodies.functionals(bodies.of_node[nodes], x, np.eye(fixed.shape[1])[axes])
    return V.mesh.comm.allreduce(rows.T @ rows)
