"""Can any body still move as a rigid one?"""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.contact.node_pairs import ContactPairs, pair_functionals
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.parallel import bounding_box

MOTIONS = {
    2: ("translation in x", "translation in y", "rotation"),
    3: (
        *("translation in x", "translation in y", "translation in z"),
        *("rotation about x", "rotation about y", "rotation about z"),
    ),
}

NEGLIGIBLE = 1e-10
"""Eigenvalues below this times the largest one count as zero."""


def check_rigidity(
    V: fem.FunctionSpace,
    bodies: Bodies,
    fixed: npt.NDArray[np.bool_],
    pairs: ContactPairs,
) -> None:
    """Refuse bodies that supports and closed contact leave free to move rigidly. Collective.

    Raises:
        InputError: Naming the motion and where the body is.
    """
    gram = _support_gram(V, bodies, fixed) + contact_gram(V, bodies, pairs)
    free = null_space(gram)
    if not free.shape[1]:
        return
    strongest = int(np.argmax(np.abs(free).max(axis=1)))
    body, motion = divmod(strongest, bodies.num_modes)
    gdim = V.mesh.geometry.dim
    x = V.tabulate_dof_coordinates()[bodies.of_node == body, :gdim]
    low, high = bounding_box(V.mesh.comm, x)
    where = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True))
    raise InputError(
        f"the body in the box [{where}] can move as a rigid body"
        f" ({MOTIONS[gdim][motion]}): neither supports nor contact hold it; add a"
        " support, or a contact that stops this motion."
    )


def first_closed(
    V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_], pairs: ContactPairs
) -> npt.NDArray[np.bool_]:
    """Pairs to begin with as closed, so that no body is free to move. Collective.

    These are the ones without a gap. Where they leave a motion free that all pairs together stop,
    those with the smallest gaps are added.

    Returns:
        Flags of the pairs hosted here, shape (num_pairs,).
    """
    held = _support_gram(V, bodies, fixed)
    largest = V.mesh.comm.allreduce(float(pairs.gap.max(initial=0)), MPI.MAX)
    widths = [0.0, *(largest * 2.0**k for k in range(-20, 1))]
    for width in widths:
        closed = pairs.gap <= width
        if not null_space(held + contact_gram(V, bodies, pairs, closed)).shape[1]:
            break
    return closed


def contact_gram(
    V: fem.FunctionSpace,
    bodies: Bodies,
    pairs: ContactPairs,
    chosen: npt.NDArray[np.bool_] | slice = slice(None),
) -> npt.NDArray[np.float64]:
    """Σ over (chosen) pairs of the squared jump, as a quadratic form in the rigid motions."""
    rows = pair_functionals(V, bodies, pairs)[chosen]
    return V.mesh.comm.allreduce(rows.T @ rows)


def null_space(gram: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Orthonormal basis of the motions that cost nothing, as columns."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values <= NEGLIGIBLE * max(values.max(initial=0), 1e-300)]


def _support_gram(
    V: fem.FunctionSpace, bodies: Bodies, fixed: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """Σ over supported components of their square, as a quadratic form in the rigid motions."""
    nodes, axes = np.nonzero(fixed[: V.dofmap.index_map.size_local])
    x = V.tabulate_dof_coordinates()[nodes]
    rows = bodies.functionals(bodies.of_node[nodes], x, np.eye(fixed.shape[1])[axes])
    return V.mesh.comm.allreduce(rows.T @ rows)
