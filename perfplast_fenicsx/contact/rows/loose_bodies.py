"""Find rigid motions of bodies that only the facets of curved surfaces resist.

A round frictionless bolt can rotate about its axis, because only the slightly oblique normals of
its facets resist this rotation. Such a motion needs almost no energy, and its size has no physical
meaning.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.linalg import eigh

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.constraints import Constraints
from perfplast_fenicsx.contact.rows.rigid_motions import motion_name, rigid_jumps
from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.parallel import bounding_box

STILL = 1e-3
"""Displacement, relative to the motion of the body, up to which a point counts as at rest."""


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LooseMotion:
    """A motion of a body that rows resist only slightly while the other bodies are at rest.

    Attributes:
        body: Number of the body.
        motion: Name of the motion.
    """

    body: int
    motion: str


def in_words(loose: Sequence[LooseMotion], names: Sequence[str]) -> str:
    """Return sentences on loosely held bodies, and on the loads for which their motions matter.

    Args:
        loose: At least one motion.
        names: Names of all bodies.
    """
    by_motion: dict[str, list[str]] = {}
    for one in loose:
        by_motion.setdefault(one.motion, []).append(names[one.body])
    motions = "; ".join(
        f"{_listed(sorted(bodies))} ({motion})" for motion, bodies in by_motion.items()
    )
    acting = [
        words
        for kind, words in (
            ("rotation", "cause such a rotation"),
            ("translation", "push bodies in such a direction"),
        )
        if any(motion.startswith(kind) for motion in by_motion)
    ]
    return (
        f"loosely held: {motions}. Only the facets of curved surfaces resist these "
        "motions, so the size of the motions has no meaning. This matters only if loads "
        f"{' or '.join(acting)}; if they do, hold the bodies by a [[support]], or tie "
        "touching surfaces by a [[tie]]"
    )


def _listed(names: Sequence[str]) -> str:
    """Return names as an enumeration in words."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def warn_of_loose_motions(
    V: fem.FunctionSpace,
    bodies: Bodies,
    names: Sequence[str],
    fixed: npt.NDArray[np.bool_],
    constraints: Constraints,
    free: Floats,
    flat: int = 0,
) -> None:
    """Log one warning about all loosely held bodies; see :func:`loose_motions`. Collective."""
    loose = loose_motions(V, bodies, fixed, constraints, free, flat)
    if loose and V.mesh.comm.rank == 0:
        log.warning("%s", in_words(loose, names))


def loose_motions(
    V: fem.FunctionSpace,
    bodies: Bodies,
    fixed: npt.NDArray[np.bool_],
    constraints: Constraints,
    free: Floats | None = None,
    flat: int = 0,
) -> list[LooseMotion]:
    """Return the rigid motions that are loosely held. Collective.

    A motion is loosely held if supports along axes and flat supports leave it free, and the normals
    of other surfaces hardly resist it. The result does not depend on how a support is declared.

    Args:
        V: Displacement space.
        bodies: The bodies.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
        constraints: The rows of B.
        free: Motions that nothing resists, which the function excludes: orthonormal columns of
            coefficients for the rigid motions of all bodies; None if there are none.
        flat: Number of rows at the end of this rank's rows that belong to flat supports. Like
            supports along axes, these rows resist a motion however small its component along the
            rows is. The planes of a narrow sector and the ends of a thin ring are examples.
    """
    nodes = V.tabulate_dof_coordinates()
    supported, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    unit = np.eye(fixed.shape[1])[axes]
    held = bodies.functionals(bodies.of_node[supported], nodes[supported], unit)
    jumps = rigid_jumps(V, bodies, constraints.B)
    rows = np.concatenate([jumps, held])
    exact = np.arange(len(rows)) >= len(jumps) - flat
    places = np.concatenate([nodes[constraints.host], nodes[supported]])
    motions = bodies.rigid_modes(places)
    found = []
    for body in range(bodies.count):
        here = slice(body * bodies.num_modes, (body + 1) * bodies.num_modes)
        own = rows[:, here]
        touched = own.any(axis=1)
        for v in _weak(V.mesh.comm, own[touched], motions[touched], exact[touched]):
            if free is not None and _is_free(v, free, here):
                continue
            x = nodes[bodies.of_node == body, : fixed.shape[1]]
            low, high = bounding_box(V.mesh.comm, x)
            found.append(LooseMotion(body, motion_name(bodies, v, (low + high) / 2)))
    return found


def _is_free(v: Floats, free: Floats, here: slice) -> bool:
    """Return whether a body's motion, with coefficients ``here``, is one of the free motions."""
    whole = np.zeros(len(free))
    whole[here] = v
    return bool(np.linalg.norm(whole - free @ (free.T @ whole)) < STILL * np.linalg.norm(v))


def _weak(
    comm: MPI.Intracomm, rows: Floats, motions: Floats, exact: npt.NDArray[np.bool_]
) -> list[Floats]:
    """Return motions of a body that no exact row resists and that other rows hardly resist.

    Collective.

    Args:
        comm: Communicator of the ranks.
        rows: Functionals of the rigid motions of the body, shape (n, num_modes).
        motions: Rigid motions at the nodes of the rows, shape (n, gdim, num_modes).
        exact: Whether the normal of a row is the normal of the true surface instead of a facet,
            shape (n,).
    """
    solid, facets = (comm.allreduce(some.T @ some) for some in (rows[exact], rows[~exact]))
    moved = comm.allreduce(np.einsum("nij,nik->jk", motions, motions))
    count = comm.allreduce(len(rows))
    if not count or np.linalg.matrix_rank(moved) < len(moved):
        return []
    # Mean squared component of a motion along rows that counts as a rounding error.
    nothing = 1e-10
    shares, vectors = eigh(solid, moved)
    left = vectors[:, shares <= nothing]
    shares, inner = np.linalg.eigh(left.T @ facets @ left)
    weak = []
    # Mean squared component along rows below which a motion is examined.
    weakest = 0.02
    # A motion is loose if no row resists at least this fraction (a sine) of the motion of its node,
    # or of the mean motion of all nodes.
    aslant = 0.35
    for v in (left @ inner[:, shares <= weakest]).T:
        size = np.sqrt(v @ moved @ v / count)
        speed = np.linalg.norm(motions @ v, axis=1)
        enough = aslant * np.where(speed > STILL * size, np.minimum(speed, size), size)
        resisted = (np.abs(rows @ v) > enough) & ~exact
        if not comm.allreduce(bool(resisted.any()), MPI.LOR):
            weak.append(v)
    return weak
