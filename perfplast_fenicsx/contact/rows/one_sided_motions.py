"""Find rigid motions by which bodies separate: contact stops them only one way.

All motions v with v = 0 where supports, ties and friction hold, and B v ≤ 0 at all pairs, form a
cone. The energy of bodies that move in this way changes only by the work of the loads. If this work
is positive for one v, no equilibrium exists, whatever the material.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh.connected_bodies import Bodies

AWAY = 1e-6
"""Work on a motion relative to its largest possible value, or mean opening, above the level of
rounding."""


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class OneSidedMotions:
    """Motions that contact stops only one way.

    Attributes:
        V: Displacement space.
        bodies: The bodies that move.
        names: Names of the bodies, which messages use.
        basis: Motions that supports, ties and friction leave free, except those that contact stops
            in neither direction, as columns of coefficients of all bodies' rigid motions.
        jumps: Closing of the pairs hosted by this rank by these motions, shape (num_pairs, number
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
        gain = self._gain(force)
        v = self._most(gain, [])
        if v is None or not gain @ v > AWAY:
            return None
        return (
            f"no equilibrium exists: the loads push {self._moving(v)} away from the "
            "surface in contact, and nothing holds it there"
        )

    def warn(self, forces: Sequence[PETSc.Vec]) -> None:
        """Log bodies that may separate while these forces do no work. Collective."""
        comm = self.V.mesh.comm
        pairs = max(comm.allreduce(len(self.jumps)), 1)
        opening = -comm.allreduce(self.jumps.sum(axis=0)) / pairs
        gains = [self._gain(force) for force in forces]
        v = self._most(opening, [sign * gain for gain in gains for sign in (1, -1)])
        if v is None or not opening @ v > AWAY or comm.rank:
            return
        log.warning(
            "%s may move away from the surface in contact: contact stops it only one way, "
            "and no load presses it there, so that its position is not determined",
            self._moving(v),
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
        """Return the motion in the cone with the largest gain and no coefficient beyond ±1.

        Collective.

        The function solves a linear program and adds rows of pairs that a motion would close.

        Args:
            gain: Gain of each coefficient.
            least: Gain of each coefficient for a load; no motion may have a negative total.

        Returns:
            The coefficients of the motion; None if the linear program has no solution.
        """
        comm = self.V.mesh.comm
        if not len(gain):
            return None
        rows: Floats = -np.reshape([*least], (-1, len(gain))).astype(np.float64)
        still = 1e-9  # relative work on a motion that counts as zero
        room: Floats = np.full(len(rows), still)
        # Number of pairs of a rank that join a linear program at once if a motion would close them.
        at_once = 20
        # Largest number of linear programs; if they do not suffice, the function returns None.
        most_programs = 60
        closed = 1e-8  # jumps below this value, for motions of unit size, are rounding
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

    def _moving(self, v: Floats) -> str:
        """Return the names of the bodies that move in a motion."""
        each = np.abs(self.basis @ v).reshape(self.bodies.count, -1).max(axis=1)
        moving = sorted(self.names[body] for body in np.flatnonzero(each > AWAY))
        return f"the {'body' if len(moving) == 1 else 'bodies'} {', '.join(moving)}"


def _best(rows: Floats, room: Floats, gain: Floats) -> Floats | None:
    """Return the v that maximises gain·v subject to rows·v ≤ room."""
    exact = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    limits = (rows, room) if len(rows) else (None, None)
    from scipy.optimize import (
        linprog,
    )  # importing it takes a tenth of a second, and few bodies need it

    found = linprog(-gain, *limits, bounds=(-1, 1), method="highs", options=exact)
    return np.asarray(found.x, dtype=np.float64) if found.success else None
