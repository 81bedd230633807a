"""Find rigid motions that neither supports nor contact resist, and fix them without force.

A round frictionless pin may rotate in its hole, and a block may slide on another. If no load does
work on such a motion, bodies are in equilibrium in any position along it, and the stiffness K is
singular. The module therefore adds a spring for each motion: K + Σ k e eᵀ. The springs carry no
force. For motions F with KF = 0 and eᵀF invertible, and a right-hand side with Fᵀb = 0, the
equation (K + Σ k e eᵀ)δ = b implies Fᵀe k eᵀδ = 0, so eᵀδ = 0. So δ solves Kδ = b, and the springs
take no part of the loads.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.one_sided_motions import OneSidedMotions
from perfplast_fenicsx.contact.rows.rigid_motion_names import motion_name
from perfplast_fenicsx.contact.rows.rigid_motions import RigidMotions
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.connected_bodies import Bodies

APART = 1e-8
"""Entries of a projector on free motions below this value do not couple two bodies."""


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FreeMotions:
    """Motions F of bodies that supports, ties and contact do not resist, and their springs.

    Attributes:
        bodies: All bodies.
        names: Names of the bodies, which messages use.
        basis: F, orthonormal, as columns of coefficients of all bodies' rigid motions, shape
            (bodies.count * bodies.num_modes, count).
        at_nodes: F at the owned displacement unknowns, shape (num_unknowns, count).
        unknowns: The unknowns with springs.
        leaving: Motions that contact stops only one way.
    """

    bodies: Bodies
    names: Sequence[str]
    basis: Floats
    at_nodes: csr_array
    unknowns: Ints
    leaving: OneSidedMotions

    @property
    def count(self) -> int:
        """Return the number of motions."""
        return int(self.basis.shape[1])

    def hold(self, stiffness: PETSc.Mat) -> None:
        """Add the springs to K, with the stiffness of K at their unknowns. Collective."""
        if not self.count:
            return
        diagonal = stiffness.getDiagonal()
        diagonal.array[self.unknowns] *= 2
        stiffness.setDiagonal(diagonal)
        diagonal.destroy()

    def drive(self, force: PETSc.Vec) -> Floats:
        """Return the work of nodal forces on each motion, relative to Σ ‖force‖‖motion‖.

        Collective.

        Returns:
            The values are between −1 and 1, and 0 if no force acts on the moving nodes. Work, shape
            (count,).
        """
        F, f = self.at_nodes, force.array_r
        unknowns = np.arange(len(f) + 1)
        of_node = csr_array((np.ones(len(f)), unknowns[:-1], unknowns[:: self.bodies.gdim]))
        speed2 = of_node @ F.multiply(F).tocsr()
        sizes = np.sqrt(speed2).T @ np.sqrt(of_node @ f**2)
        sums = np.stack([F.T @ f, sizes])
        sums = force.comm.tompi4py().allreduce(sums)
        return np.divide(sums[0], sums[1], out=np.zeros(self.count), where=sums[1] > 0)

    def driven(self, forces: Sequence[PETSc.Vec]) -> str | None:
        """Return why there is no equilibrium if one of these forces works on a motion, else None.

        Collective.
        """
        if not self.count:
            return None
        drives = np.abs([self.drive(force) for force in forces]).max(axis=0)
        # Smallest work of a load on a motion that is not rounding, relative to the work if all
        # nodal forces acted along the motion.
        driven = 1e-8
        some = np.flatnonzero(drives > driven)
        if not some.size:
            return None
        return (
            f"{self.words(some)} can move as a rigid body, and a load does work on this "
            "motion: neither supports nor contact prevent it; add a support, or a contact "
            "that stops this motion."
        )

    def check(self, forces: Sequence[PETSc.Vec]) -> None:
        """Refuse motions on which these forces do work, and log others. Collective.

        Raises:
            InputError: Naming bodies and motions.
        """
        refusal = self.driven(forces)
        if refusal is not None:
            raise InputError(refusal)
        self.leaving.warn(forces)
        if self.count and forces[0].comm.rank == 0:
            log.warning(
                "nothing resists a rigid motion of %s, and no load does work on it: it is "
                "fixed without any force",
                self.words(np.arange(self.count)),
            )

    def centre(self, u: fem.Function) -> None:
        """Subtract from a displacement its part in F, in the mean over all nodes. Collective."""
        if not self.count:
            return
        F, here = self.at_nodes, slice(self.at_nodes.shape[0])
        both = np.column_stack([(F.T @ F).toarray(), F.T @ u.x.array[here]])
        sums = u.function_space.mesh.comm.allreduce(both)
        u.x.array[here] -= F @ np.linalg.solve(sums[:, :-1], sums[:, -1])
        u.x.scatter_forward()

    def words(self, some: npt.NDArray[np.integer]) -> str:
        """Return which bodies move in the given motions, and how."""
        each = self.basis.reshape(self.bodies.count, self.bodies.num_modes, -1)
        told: dict[tuple[int, ...], list[str]] = {}
        for number in some:
            size = np.abs(each[:, :, number]).max(axis=1)
            moving = tuple(int(body) for body in np.flatnonzero(size > APART))
            strongest = int(np.argmax(size))
            told.setdefault(moving, []).append(motion_name(self.bodies, each[strongest, :, number]))
        return "; ".join(
            sorted(
                f"{_together(sorted(self.names[body] for body in moving))} ({', '.join(motions)})"
                for moving, motions in told.items()
            )
        )


def _together(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"the body {names[0]}"
    return f"the bodies {', '.join(names[:-1])} and {names[-1]} together"


def held_motions(
    V: fem.FunctionSpace, bodies: Bodies, names: Sequence[str], motions: RigidMotions
) -> FreeMotions:
    """Return the free motions with the nodes at which they are fixed. Collective.

    Args:
        V: Displacement space.
        bodies: The bodies that move.
        names: Names of the bodies, which messages use.
        motions: Constraints of supports and contact on the motions.
    """
    free = motions.free()
    leaving = OneSidedMotions(V, bodies, names, *motions.one_sided(free))
    basis, groups = _untangled(bodies, free)
    nodes, gdim = V.dofmap.index_map.size_local, bodies.gdim
    row, column, value, chosen = [], [], [], []
    for moving, numbers in groups:
        some = np.flatnonzero(np.isin(bodies.of_node[:nodes], moving))
        each = basis[:, numbers].reshape(bodies.count, bodies.num_modes, len(numbers))
        modes = bodies.rigid_modes(V.tabulate_dof_coordinates()[some])
        moved = (modes @ each[bodies.of_node[some]]).reshape(-1, len(numbers))
        unknowns = (some[:, None] * gdim + np.arange(gdim)).ravel()
        row.append(np.repeat(unknowns, len(numbers)))
        column.append(np.tile(numbers, len(unknowns)))
        value.append(moved.ravel())
        chosen.append(unknowns[_pivots(V.mesh.comm, moved)])
    shape = (nodes * gdim, free.shape[1])
    if not groups:
        return FreeMotions(
            bodies, names, basis, csr_array(shape), np.zeros(0, dtype=np.int32), leaving
        )
    entries = (np.concatenate(value), (np.concatenate(row), np.concatenate(column)))
    held = np.concatenate(chosen).astype(np.int32)
    return FreeMotions(bodies, names, basis, csr_array(entries, shape), held, leaving)


def _untangled(bodies: Bodies, free: Floats) -> tuple[Floats, list[tuple[Ints, Ints]]]:
    """Return another orthonormal basis, in which each motion has few bodies and axes.

    Returns:
        The basis; and for each set of bodies that move together, the bodies and the numbers of the
        motions.
    """
    projector = free @ free.T
    shape = (bodies.count, bodies.num_modes) * 2
    coupled = np.abs(projector).reshape(shape).max(axis=(1, 3)) > APART
    _, group = connected_components(coupled, directed=False)
    of_entry = np.repeat(group, bodies.num_modes)
    basis, of_motion = np.zeros_like(free), np.zeros(free.shape[1], dtype=group.dtype)
    for column in range(free.shape[1]):
        strongest = int(np.argmax(np.round(projector.diagonal(), 6)))
        v = projector[:, strongest] / np.sqrt(projector[strongest, strongest])
        of_motion[column] = of_entry[strongest]
        basis[:, column] = np.where(of_entry == of_motion[column], v, 0.0)
        projector -= np.outer(v, v)
    return basis, [
        (
            np.flatnonzero(group == g).astype(np.int32),
            np.flatnonzero(of_motion == g).astype(np.int32),
        )
        for g in np.unique(of_motion)
    ]


def _pivots(comm: MPI.Intracomm, motions: Floats) -> Ints:
    """Return owned rows that distinguish the motions best, one for each motion. Collective."""
    left, chosen = motions.copy(), []
    for _ in range(motions.shape[1]):
        squares = np.einsum("nk,nk->n", left, left)
        largest = float(squares.max(initial=-1.0))
        _, rank = comm.allreduce((largest, comm.rank), MPI.MAXLOC)
        row = np.zeros(motions.shape[1])
        if comm.rank == rank:
            number = int(np.argmax(squares))
            row[:] = left[number] / np.sqrt(largest)
            chosen.append(number)
        comm.Bcast(row, root=rank)
        left -= np.outer(left @ row, row)
    return np.array(chosen, dtype=np.int32)
