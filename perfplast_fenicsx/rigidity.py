"""Can any body still move as a rigid one?"""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.bodies import Bodies
from perfplast_fenicsx.contact import ContactPairs, pair_functionals
from perfplast_fenicsx.errors import InputError

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
    owned = V.dofmap.index_map.size_local
    nodes, axes = np.nonzero(fixed[:owned])
    x = V.tabulate_dof_coordinates()[nodes]
    rows = bodies.functionals(bodies.of_node[nodes], x, np.eye(fixed.shape[1])[axes])
    gram = V.mesh.comm.allreduce(rows.T @ rows) + contact_gram(V, bodies, pairs)
    free = null_space(gram)
    if not free.shape[1]:
        return
    strongest = int(np.argmax(np.abs(free).max(axis=1)))
    body, motion = divmod(strongest, bodies.num_modes)
    low, high = _box(V, bodies, body)
    where = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True))
    raise InputError(
        f"the body in the box [{where}] can move as a rigid body"
        f" ({MOTIONS[V.mesh.geometry.dim][motion]}): neither supports nor contact hold it; add a"
        " support, or a contact that stops this motion."
    )


def contact_gram(
    V: fem.FunctionSpace, bodies: Bodies, pairs: ContactPairs
) -> npt.NDArray[np.float64]:
    """Σ over pairs of the squared jump, as a quadratic form in the bodies' rigid motions."""
    rows = pair_functionals(V, bodies, pairs)
    return V.mesh.comm.allreduce(rows.T @ rows)


def null_space(gram: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Orthonormal basis of the motions that cost nothing, as columns."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values <= NEGLIGIBLE * max(values.max(initial=0), 1e-300)]


def _box(
    V: fem.FunctionSpace, bodies: Bodies, body: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    gdim = V.mesh.geometry.dim
    x = V.tabulate_dof_coordinates()[bodies.of_node == body, :gdim]
    low, high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
    V.mesh.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    V.mesh.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return low, high
