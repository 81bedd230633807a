"""Find rigid motions that neither supports nor contact resist, name them, and fix them.

One-sided motions are rigid motions by which bodies separate; contact stops them in one direction
only. All motions v with v = 0 where supports, ties and friction hold, and with B v ≤ 0 at all
pairs, form a cone. The energy of bodies that move in this way changes only by the work of the
loads. If this work is positive for one v, no equilibrium exists, whatever the material.

Free motions are rigid motions that neither supports nor contact resist, in both directions. A round
frictionless pin may rotate in its hole, and a block may slide on another block. If no load does
work on such a motion, bodies are in equilibrium in any position along it, and the stiffness K is
singular. The module therefore adds a spring for each motion: K + Σ k e eᵀ. The springs exert no
forces. Consider motions F with KF = 0 and eᵀF invertible, and a right-hand side with Fᵀb = 0. The
equation (K + Σ k e eᵀ)δ = b then implies Fᵀe k eᵀδ = 0 and thus eᵀδ = 0. Therefore δ solves Kδ = b,
and the springs carry no part of the loads.
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

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.contact.rows.constraints import Constraints, entries_of, matrix_of_entries
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.connected_bodies import Bodies

log = logging.getLogger(__name__)


class RigidMotions:
    """Conditions of supports and contact on the rigid motions R of all bodies."""

    def __init__(
        self,
        V: fem.FunctionSpace,
        bodies: Bodies,
        fixed: npt.NDArray[np.bool_],
        constraints: Constraints,
        ties: Constraints | None = None,
    ) -> None:
        """Compute the jumps B R of the rows, and the conditions of supports and ties. Collective.

        Args:
            V: Displacement space.
            bodies: The bodies.
            fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
            constraints: The rows of B.
            ties: Equality rows; None if there are none.
        """
        self._comm, self._gap = V.mesh.comm, constraints.gap
        self._jumps = rigid_jumps(V, bodies, constraints.B)
        self._held = _supported(V, bodies, fixed)
        if ties is not None:
            self._held = np.concatenate([self._held, rigid_jumps(V, bodies, ties.B)])
        self._supports = self._comm.allreduce(self._held.T @ self._held)

    def free(self) -> Floats:
        """Return motions that supports, ties and contact leave free in both directions.

        Collective.

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
        # Jumps below this fraction of the largest jumps are rounding errors; a motion with only
        # such jumps is free.
        rounding = 1e-9
        return np.asarray(nearly @ vectors[:, values <= rounding**2 * max(largest, 1e-300)])

    def one_sided(self, free: Floats) -> tuple[Floats, Floats]:
        """Return motions that supports and ties leave free, except the motions of :meth:`free`.

        Collective.

        Args:
            free: The result of :meth:`free`.

        Returns:
            Orthonormal columns; and the closing of the pairs hosted by this rank in these motions,
            shape (num_pairs, number of motions).
        """
        basis = null_space(self._supports + free @ free.T * np.trace(self._supports + 1.0))
        return basis, self._jumps @ basis

    def first_active(self) -> PairFlags:
        """Return an initial active set of pairs that stops as many motions as all pairs together.

        Collective.

        The set contains the pairs without a gap. If it leaves a motion free that all pairs together
        stop, the function adds pairs with the smallest gaps.
        """
        largest = self._comm.allreduce(float(self._gap.max(initial=0)), MPI.MAX)
        at_least = self._left_free(np.ones(len(self._gap), dtype=bool))
        for width in (0.0, *(largest * 2.0**k for k in range(-20, 1))):
            held: PairFlags = self._gap <= width
            if self._left_free(held) <= at_least:
                break
        return held

    def _left_free(self, held: PairFlags) -> int:
        """Return the number of motions that supports and the given pairs leave nearly free.

        Collective.
        """
        rows = self._jumps[held]
        gram = self._supports + self._comm.allreduce(rows.T @ rows)
        return int(null_space(gram).shape[1])


def rigid_jumps(V: fem.FunctionSpace, bodies: Bodies, B: PETSc.Mat) -> Floats:
    """Return B R: the jump of each pair on this rank in each body's rigid motions. Collective.

    Returns:
        Jumps, shape (num_pairs, bodies.count * bodies.num_modes).
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
    """Return the owned nodes that occur in any row. Collective."""
    counts = B.createVecRight()
    unknowns = B.getValuesCSR()[1]
    counts.setValues(unknowns, np.ones(len(unknowns)), addv=PETSc.InsertMode.ADD_VALUES)
    counts.assemble()
    nodes = np.flatnonzero(counts.array.reshape(-1, gdim).any(axis=1))
    counts.destroy()
    return nodes


def null_space(gram: Floats) -> Floats:
    """Return an orthonormal basis of the null space of ``gram``, as columns."""
    values, vectors = np.linalg.eigh(gram)
    negligible = 1e-10  # limit of eigenvalues that count as zero, relative to the largest
    return vectors[:, values <= negligible * max(values.max(initial=0), 1e-300)]


def _supported(V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_]) -> Floats:
    """Return the components that supports hold, as functionals of the rigid motions.

    Returns:
        Functionals, shape (number on this rank, bodies.count * bodies.num_modes).
    """
    nodes, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    x = V.tabulate_dof_coordinates()[nodes]
    return bodies.functionals(bodies.of_node[nodes], x, np.eye(fixed.shape[1])[axes])


def motion_name(bodies: Bodies, v: Floats, middle: Floats | None = None) -> str:
    """Return the name of a rigid motion of a body.

    Args:
        bodies: Bodies with their rigid motions.
        v: Coefficients of the motion, shape (num_modes,).
        middle: Position of the body, shape (gdim,); a motion that hardly rotates there counts as a
            translation. Without ``middle``, only an exact translation counts as one.
    """
    gdim = bodies.gdim
    if bodies.num_modes == 1:
        return bodies.kinematics.motions[0]
    spin = v[gdim:]
    if middle is None:
        along = v[:gdim]
        # Fraction of rotation above which a rigid motion counts as a rotation if the position of
        # the body is unknown.
        least_spin = 1e-6
        turns = np.linalg.norm(spin) > least_spin * np.linalg.norm(v)
    else:
        along = bodies.rigid_modes(np.pad(middle, (0, 3 - gdim))[None])[0] @ v
        turns = np.linalg.norm(along) <= np.linalg.norm(spin)
    if not turns:
        return f"translation {_direction(along, 'in')}"
    return f"rotation {_direction(spin, 'about')}" if gdim == 3 else "rotation"


def _direction(d: Floats, axis: str) -> str:
    """Return a direction in words, with a positive largest component; an axis by its letter.

    Args:
        d: Vector in the direction, of any length.
        axis: Preposition before the letter of an axis, "in" or "about".
    """
    d = d / np.linalg.norm(d)
    d *= np.sign(d[np.argmax(np.abs(d))])
    rounded = np.round(d, 2) + 0.0
    if np.count_nonzero(rounded) == 1:
        return f"{axis} {'xyz'[int(np.argmax(rounded))]}"
    oblique = "along" if axis == "in" else axis
    return f"{oblique} (" + ", ".join(f"{a:.2f}" for a in rounded) + ")"


AWAY = 1e-6
"""Work in a motion (relative to its largest possible value), or mean opening, above the level of
rounding errors."""


@dataclass(frozen=True)
class OneSidedMotions:
    """Motions that contact stops in one direction only.

    Attributes:
        V: Displacement space.
        bodies: The bodies that move.
        names: Names of the bodies, for messages.
        basis: Motions that supports, ties and friction leave free, except those that contact stops
            in neither direction, as columns of coefficients for the rigid motions of all bodies.
        jumps: Closing of the pairs hosted by this rank in these motions, shape (num_pairs, number
            of motions).
    """

    V: fem.FunctionSpace
    bodies: Bodies
    names: Sequence[str]
    basis: Floats
    jumps: Floats

    def pushed_away(self, force: PETSc.Vec) -> str | None:
        """Return why no equilibrium exists if nodal forces push a body away, else None.

        Collective.
        """
        v = self.away(force)
        if v is None:
            return None
        return (
            f"no equilibrium exists: the loads push {self.moving(v)} away from the contact "
            "surface, and no support prevents this motion; add a support, or glue the surfaces"
        )

    def away(self, force: PETSc.Vec, others: Sequence[PETSc.Vec] = ()) -> Floats | None:
        """Return the motion on which a force does most work, if it does work on any. Collective.

        Args:
            force: Nodal forces.
            others: Nodal forces that must not do negative work on the motion.

        Returns:
            Factors of the columns of ``basis``; None if the force does no work on any motion.
        """
        gain = self._gain(force)
        v = self._most(gain, [self._gain(other) for other in others])
        return None if v is None or not gain @ v > AWAY else v

    def drive(self, force: PETSc.Vec, v: Floats) -> float:
        """Return the work of nodal forces on a motion, relative to Σ ‖force‖‖motion‖. Collective.

        Args:
            force: Nodal forces.
            v: Factors of the columns of ``basis``.
        """
        bodies, owned = self.bodies, self.V.dofmap.index_map.size_local
        f = force.array_r.reshape(owned, bodies.gdim)
        each = (self.basis @ v).reshape(bodies.count, bodies.num_modes)[bodies.of_node[:owned]]
        modes = bodies.rigid_modes(self.V.tabulate_dof_coordinates()[:owned])
        u = np.einsum("nim,nm->ni", modes, each)
        sizes = np.linalg.norm(f, axis=1) * np.linalg.norm(u, axis=1)
        work, most = self.V.mesh.comm.allreduce(np.array([np.sum(f * u), np.sum(sizes)]))
        return float(work / (most or 1.0))

    def warn(self, forces: Sequence[PETSc.Vec]) -> None:
        """Log a warning on bodies that may separate while these forces do no work. Collective."""
        comm = self.V.mesh.comm
        pairs = max(comm.allreduce(len(self.jumps)), 1)
        opening = -comm.allreduce(self.jumps.sum(axis=0)) / pairs
        gains = [self._gain(force) for force in forces]
        v = self._most(opening, [sign * gain for gain in gains for sign in (1, -1)])
        if v is None or not opening @ v > AWAY or comm.rank:
            return
        log.warning(
            "%s may move away from the contact surface: contact stops this motion in one direction "
            "only, and no load presses the surfaces together, so the position is undetermined; add "
            "a support or a load that presses them, or glue the surfaces",
            self.moving(v),
        )

    def _gain(self, force: PETSc.Vec) -> Floats:
        """Return the work of nodal forces on each motion, relative to Σ ‖force‖. Collective."""
        bodies, owned = self.bodies, self.V.dofmap.index_map.size_local
        f = force.array_r.reshape(owned, bodies.gdim)
        modes = bodies.rigid_modes(self.V.tabulate_dof_coordinates()[:owned])
        sums = np.zeros((bodies.count, bodies.num_modes))
        np.add.at(sums, bodies.of_node[:owned], np.einsum("nim,ni->nm", modes, f))
        total = np.append(sums.ravel(), np.linalg.norm(f, axis=1).sum())
        total = force.comm.tompi4py().allreduce(total)
        gain: Floats = self.basis.T @ total[:-1] / (total[-1] or 1.0)
        return gain

    def _most(self, gain: Floats, least: Sequence[Floats]) -> Floats | None:
        """Return the motion in the cone with the largest gain and all coefficients within ±1.

        Collective.

        The function solves linear programs, and adds rows for pairs that a motion would close.

        Args:
            gain: Gain of each coefficient.
            least: Gains of each coefficient for several loads; the motion must not have a negative
                total gain for any of them.

        Returns:
            The coefficients of the motion; None if a linear program has no solution, or if
            ``most_programs`` programs are not enough.
        """
        comm = self.V.mesh.comm
        if not len(gain):
            return None
        rows: Floats = -np.reshape([*least], (-1, len(gain))).astype(np.float64)
        still = 1e-9  # relative work on a motion that counts as zero
        room: Floats = np.full(len(rows), still)
        # Number of pairs on a rank that a linear program adds at once if a motion would close them.
        at_once = 20
        # Largest number of linear programs; if it does not suffice, the function returns None.
        most_programs = 60
        closed = 1e-8  # jumps below this value, in motions of unit size, are rounding errors
        for _ in range(most_programs):
            v = comm.bcast(_best(rows, room, gain) if comm.rank == 0 else None)
            if v is None:
                return None
            closing = self.jumps @ v
            worst = np.argsort(-closing)[:at_once]
            new = np.concatenate(comm.allgather(self.jumps[worst[closing[worst] > closed]]))
            if not len(new):
                return np.asarray(v)
            rows, room = np.concatenate([rows, new]), np.append(room, np.zeros(len(new)))
        return None

    def moving(self, v: Floats) -> str:
        """Return the names of the bodies that take part in a motion."""
        each = np.abs(self.basis @ v).reshape(self.bodies.count, -1).max(axis=1)
        moving = sorted(self.names[body] for body in np.flatnonzero(each > AWAY))
        return f"the {'body' if len(moving) == 1 else 'bodies'} {', '.join(moving)}"


def _best(rows: Floats, room: Floats, gain: Floats) -> Floats | None:
    """Return the v in [−1, 1]ⁿ that maximises gain·v with rows·v ≤ room; None on failure."""
    exact = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    limits = (rows, room) if len(rows) else (None, None)
    from scipy.optimize import (
        linprog,
    )  # the import takes 0.1 s, and only few cases need it

    found = linprog(-gain, *limits, bounds=(-1, 1), method="highs", options=exact)
    return np.asarray(found.x, dtype=np.float64) if found.success else None


APART = 1e-8
"""Entries below this value in a projector onto free motions do not couple two bodies."""


@dataclass(frozen=True)
class FreeMotions:
    """Motions F of bodies that supports, ties and contact do not resist, and their springs.

    Attributes:
        bodies: All bodies.
        names: Names of the bodies, for messages.
        basis: F as orthonormal columns of coefficients for the rigid motions of all bodies, shape
            (bodies.count * bodies.num_modes, count).
        at_nodes: F at the owned displacement unknowns, shape (num_unknowns, count).
        unknowns: The unknowns to which springs are added.
        leaving: Motions that contact stops in one direction only.
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
        """Add the springs to K; each spring has the diagonal stiffness of its unknown.

        Collective.
        """
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
            Relative work, shape (count,), between −1 and 1; 0 if no force acts on the moving nodes.
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
        """Return why no equilibrium exists if a force does work on a motion, else None.

        Collective.
        """
        if not self.count:
            return None
        least = 1e-8  # smallest relative work that is no rounding error
        some = np.flatnonzero(self.drives(forces) > least)
        if not some.size:
            return None
        return (
            f"{self.words(some)} can move as a rigid body, and a load does work on this "
            "motion, but neither supports nor contact prevent it; add a support, or a contact "
            "that stops this motion."
        )

    def drives(self, forces: Sequence[PETSc.Vec]) -> Floats:
        """Return the largest relative work of the forces on each motion, in size. Collective."""
        return np.asarray(np.abs([self.drive(force) for force in forces]).max(axis=0))

    def check(self, forces: Sequence[PETSc.Vec]) -> None:
        """Refuse motions on which these forces do work, and log the other motions. Collective.

        Raises:
            InputError: If a force does work; the message names the bodies and the motions.
        """
        refusal = self.driven(forces)
        if refusal is not None:
            raise InputError(refusal)
        self.leaving.warn(forces)
        if self.count and forces[0].comm.rank == 0:
            log.warning(
                "nothing resists a rigid motion of %s, and no load does work on it; the program "
                "prevents this motion, which needs no force",
                self.words(np.arange(self.count)),
            )

    def centre(self, u: fem.Function) -> None:
        """Subtract from a displacement its least-squares fit in F over all nodes. Collective."""
        if not self.count:
            return
        F, here = self.at_nodes, slice(self.at_nodes.shape[0])
        both = np.column_stack([(F.T @ F).toarray(), F.T @ u.x.array[here]])
        sums = u.function_space.mesh.comm.allreduce(both)
        u.x.array[here] -= F @ np.linalg.solve(sums[:, :-1], sums[:, -1])
        u.x.scatter_forward()

    def words(self, some: npt.NDArray[np.integer]) -> str:
        """Return the names of the given motions, and of the bodies that move in these motions."""
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
    """Return the free motions, with the nodes at which springs fix them. Collective.

    Args:
        V: Displacement space.
        bodies: The bodies that move.
        names: Names of the bodies, for messages.
        motions: Conditions of supports and contact on the motions.
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
    """Return an orthonormal basis of the free motions, each of which involves few bodies and axes.

    Returns:
        The basis; and for each set of bodies that move together, the bodies and the numbers of
        their motions.
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
    """Return the owned rows that best distinguish the motions, one for each motion. Collective."""
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
