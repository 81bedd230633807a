"""Rigid motions by which bodies leave each other: contact stops them one way only.

All v with v = 0 where supports, ties and friction hold, and B v ≤ 0 at all pairs, form a cone. The
energy of bodies that move so changes only by the work of the loads. Where that is positive for one
v, no equilibrium exists, whatever the bodies are made of.
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
"""Work on a motion, relative to what it might be, or mean opening, that is more than rounding."""


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class OneSidedMotions:
    """Motions that contact stops one way only.

    Attributes:
        V: Displacement space.
        bodies: The bodies that move.
        names: Their names, for messages.
        basis: Motions that supports, ties and friction leave, but for those that contact does not
            stop either way, as columns of coefficients of all bodies' rigid motions.
        jumps: What these close of the pairs hosted here, shape (num_pairs, number of motions).
    """

    V: fem.FunctionSpace
    bodies: Bodies
    names: Sequence[str]
    basis: Floats
    jumps: Floats

    def pushed_away(self, force: PETSc.Vec) -> str | None:
        """Why no equilibrium exists under nodal forces that push a body away. Collective."""
        gain = self._gain(force)
        v = self._most(gain, [])
        if v is None or not gain @ v > AWAY:
            return None
        return (
            f"no equilibrium exists: the loads push {self._moving(v)} away from what it touches,"
            " and nothing holds it there"
        )

    def warn(self, forces: Sequence[PETSc.Vec]) -> None:
        """Report bodies that may leave without work of any of these forces. Collective."""
        comm = self.V.mesh.comm
        pairs = max(comm.allreduce(len(self.jumps)), 1)
        opening = -comm.allreduce(self.jumps.sum(axis=0)) / pairs
        gains = [self._gain(force) for force in forces]
        v = self._most(opening, [sign * gain for gain in gains for sign in (1, -1)])
        if v is None or not opening @ v > AWAY or comm.rank:
            return
        log.warning(
            "%s may move away from what it touches: contact stops it one way only, and no load"
            " presses it there, so that its place is not determined",
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
        """Return the motion in the cone that gains most, with no coefficient beyond ±1. Collective.

        It is a linear program; rows of pairs come into it as its motions would close them.

        Args:
            gain: Of each coefficient.
            least: Of what each coefficient gains, and no motion may lose.

        Returns:
            Its coefficients; None if the program has not been solved.
        """
        comm = self.V.mesh.comm
        if not len(gain):
            return None
        rows: Floats = -np.reshape([*least], (-1, len(gain))).astype(np.float64)
        still = 1e-9  # work on a motion, relative to what it might be, that counts as zero
        room: Floats = np.full(len(rows), still)
        # So many pairs of a rank that a motion would close join a linear program at once.
        at_once = 20
        # Linear programs that are solved at most; without an answer by then nothing is said.
        most_programs = 60
        closed = 1e-8  # jumps below this one, of motions of unit size, are rounding
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
        """Who moves in a motion."""
        each = np.abs(self.basis @ v).reshape(self.bodies.count, -1).max(axis=1)
        moving = sorted(self.names[body] for body in np.flatnonzero(each > AWAY))
        return f"the {'body' if len(moving) == 1 else 'bodies'} {', '.join(moving)}"


def _best(rows: Floats, room: Floats, gain: Floats) -> Floats | None:
    """Maximise gain·v where rows·v ≤ room."""
    exact = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    limits = (rows, room) if len(rows) else (None, None)
    from scipy.optimize import linprog  # a tenth of a second, which few bodies ask for

    found = linprog(-gain, *limits, bounds=(-1, 1), method="highs", options=exact)
    return np.asarray(found.x, dtype=np.float64) if found.success else None
