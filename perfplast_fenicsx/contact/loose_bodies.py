"""Bodies that may nearly slide or spin: nothing but the facets of round surfaces resists a motion.

A round bolt without friction turns about its axis but for the normals of its facets, which are a
little aslant. Such a motion costs next to nothing, and what it comes to says nothing of the body.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.linalg import eigh

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.constraints import Constraints
from perfplast_fenicsx.contact.rigid_motions import rigid_jumps
from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.parallel import bounding_box

WEAK = 0.02
"""Mean square of the share of a motion that normals and supports take up, below which it is
looked at."""

ASLANT = 0.35
"""Where not one of them takes up more than this share (its sine) of the motion of its place, or of
all places on average, the motion is loose."""

STILL = 1e-3
"""Places that move less than so, relative to all of them, are on the axis of a rotation."""


@dataclass(frozen=True)
class LooseMotion:
    """A motion of a body, the others at rest, that hardly anything resists.

    Attributes:
        body: Its number.
        low: Corner of the box around it, shape (gdim,).
        high: The opposite corner.
        motion: In words.
    """

    body: int
    low: Floats
    high: Floats
    motion: str

    def __str__(self) -> str:
        box = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(self.low, self.high, strict=True))
        return (
            f"the body in the box [{box}] is loosely held ({self.motion}): only the facets of round"
            " surfaces resist this motion; hold it by a support if it matters"
        )


def loose_motions(
    V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_], constraints: Constraints
) -> list[LooseMotion]:
    """Find what is loosely held. Collective.

    Args:
        V: Displacement space.
        bodies: The bodies.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        constraints: The rows of B.
    """
    nodes = V.tabulate_dof_coordinates()
    supported, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    unit = np.eye(fixed.shape[1])[axes]
    held = bodies.functionals(bodies.of_node[supported], nodes[supported], unit)
    rows = np.concatenate([rigid_jumps(V, bodies, constraints.B), held])
    places = np.concatenate([nodes[constraints.host], nodes[supported]])
    motions = bodies.rigid_modes(places)
    found = []
    for body in range(bodies.count):
        own = rows[:, body * bodies.num_modes : (body + 1) * bodies.num_modes]
        touched = own.any(axis=1)
        for v in _weak(V.mesh.comm, own[touched], motions[touched]):
            x = nodes[bodies.of_node == body, : fixed.shape[1]]
            low, high = bounding_box(V.mesh.comm, x)
            found.append(LooseMotion(body, low, high, _name(bodies, v, (low + high) / 2)))
    return found


def _weak(comm: MPI.Intracomm, rows: Floats, motions: Floats) -> list[Floats]:
    """Motions of a body that no row takes up."""
    taken = comm.allreduce(rows.T @ rows)
    moved = comm.allreduce(np.einsum("nij,nik->jk", motions, motions))
    count = comm.allreduce(len(rows))
    if not count or np.linalg.matrix_rank(moved) < len(moved):
        return []
    shares, vectors = eigh(taken, moved)
    weak = []
    for v in vectors.T[shares <= WEAK]:
        size = np.sqrt(v @ moved @ v / count)
        speed = np.linalg.norm(motions @ v, axis=1)
        taken_up = np.abs(rows @ v)
        resisted = taken_up > ASLANT * np.where(speed > STILL * size, np.minimum(speed, size), size)
        if not comm.allreduce(bool(resisted.any()), MPI.LOR):
            weak.append(v)
    return weak


def _name(bodies: Bodies, v: Floats, middle: Floats) -> str:
    """Rotation or translation, and its axis."""
    gdim = bodies.gdim
    along = bodies.rigid_modes(np.pad(middle, (0, 3 - gdim))[None])[0] @ v
    spin = v[gdim:]
    if np.linalg.norm(along) > np.linalg.norm(spin):
        return f"translation along {_direction(along)}"
    return f"rotation about {_direction(spin)}" if gdim == 3 else "rotation"


def _direction(d: Floats) -> str:
    """Of unit length, the first large component positive."""
    d = d / np.linalg.norm(d)
    d *= np.sign(d[np.argmax(np.abs(d))])
    return "(" + ", ".join(f"{a + 0.0:.2f}" for a in np.round(d, 2)) + ")"
