"""Determine whether any body can still move as a rigid body."""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.rows.constraints import Constraints
from perfplast_fenicsx.contact.rows.sparse_rows import entries_of, matrix_of_entries
from perfplast_fenicsx.mesh.connected_bodies import Bodies


class RigidMotions:
    """Constraints of supports and contact on the rigid motions R of all bodies."""

    def __init__(
        self,
        V: fem.FunctionSpace,
        bodies: Bodies,
        fixed: npt.NDArray[np.bool_],
        constraints: Constraints,
        ties: Constraints | None = None,
    ) -> None:
        """Compute B R. Collective.

        Args:
            V: Displacement space.
            bodies: The bodies.
            fixed: Components held by supports at each local node, shape (num_nodes, gdim).
            constraints: The rows of B.
            ties: Equality rows.
        """
        self._comm, self._gap = V.mesh.comm, constraints.gap
        self._jumps = rigid_jumps(V, bodies, constraints.B)
        self._held = _supported(V, bodies, fixed)
        if ties is not None:
            self._held = np.concatenate([self._held, rigid_jumps(V, bodies, ties.B)])
        self._supports = self._comm.allreduce(self._held.T @ self._held)

    def free(self) -> Floats:
        """Return motions that supports, ties and contact leave free in both directions. Collective.

        Returns:
            Orthonormal columns, shape (bodies.count * bodies.num_modes, number of motions).
        """
        jumps = self._comm.allreduce(self._jumps.T @ self._jumps)
        gram = self._supports + jumps
        nearly = null_space(gram)
        taken = [rows @ nearly for rows in (self._jumps, self._held)]
        left = self._comm.allreduce(sum(rows.T @ rows for rows in taken))
        values, vectors = np.linalg.eigh(left)
        largest = np.linalg.eigvalsh(gram).max(initial=0)
        # Jumps below this share of the largest jumps are rounding; a motion with no larger jump is
        # free.
        rounding = 1e-9
        return np.asarray(nearly @ vectors[:, values <= rounding**2 * max(largest, 1e-300)])

    def one_sided(self, free: Floats) -> tuple[Floats, Floats]:
        """Return motions that supports and ties leave free, except those of :meth:`free`.

        Collective.

        Args:
            free: The result of :meth:`free`.

        Returns:
            Orthonormal columns; and their closing of the pairs hosted by this rank, shape
            (num_pairs, number of motions).
        """
        basis = null_space(self._supports + free @ free.T * np.trace(self._supports + 1.0))
        return basis, self._jumps @ basis

    def first_active(self) -> PairFlags:
        """Return an initial active set of pairs that stops as many motions as all pairs do.

        Collective.

        The set contains the pairs without a gap. If it leaves a motion free that all pairs together
        stop, the function adds the pairs with the smallest gaps.
        """
        largest = self._comm.allreduce(float(self._gap.max(initial=0)), MPI.MAX)
        at_least = self._left_free(np.ones(len(self._gap), dtype=bool))
        for width in (0.0, *(largest * 2.0**k for k in range(-20, 1))):
            held: PairFlags = self._gap <= width
            if self._left_free(held) <= at_least:
                break
        return held

    def _left_free(self, held: PairFlags) -> int:
        """Return the number of motions that supports and these pairs leave nearly free.

        Collective.
        """
        rows = self._jumps[held]
        gram = self._supports + self._comm.allreduce(rows.T @ rows)
        return int(null_space(gram).shape[1])


def rigid_jumps(V: fem.FunctionSpace, bodies: Bodies, B: PETSc.Mat) -> Floats:
    """Return B R: the jump of each pair on this rank in each rigid motion of each body. Collective.

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
    """Return the owned nodes that appear in any row. Collective."""
    counts = B.createVecRight()
    unknowns = B.getValuesCSR()[1]
    counts.setValues(unknowns, np.ones(len(unknowns)), addv=PETSc.InsertMode.ADD_VALUES)
    counts.assemble()
    nodes = np.flatnonzero(counts.array.reshape(-1, gdim).any(axis=1))
    counts.destroy()
    return nodes


def null_space(gram: Floats) -> Floats:
    """Return an orthonormal basis of the null space, as columns."""
    values, vectors = np.linalg.eigh(gram)
    negligible = 1e-10  # eigenvalues below this times the largest one count as zero
    return vectors[:, values <= negligible * max(values.max(initial=0), 1e-300)]


def _supported(V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_]) -> Floats:
    """Return the components that supports hold, as functionals of the rigid motions.

    Returns:
        Shape (number on this rank, bodies.count * bodies.num_modes).
    """
    nodes, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    x = V.tabulate_dof_coordinates()[nodes]
    return bodies.functionals(bodies.of_node[nodes], x, np.eye(fixed.shape[1])[axes])
