"""Shapes of the cones of cells, and their strengths: cones are compared that differ in size."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.rings import normals_of


def are_weaker(lower: Floats, upper: Floats) -> Flags:
    """Whether sets of cells are not known to hold those of others.

    Args:
        lower: Shape and strength of cones (:func:`strengths_of`), shape (n, 2).
        upper: The same of those that ought to hold them.
    """
    rounding = 1e-12  # of a bound over the size of its matrix
    holds = (lower[:, 0] == upper[:, 0]) & (lower[:, 1] <= upper[:, 1] * (1 + rounding))
    return np.asarray(~holds)


def strengths_of(*bodies: Body) -> list[Floats]:
    """Number of the shape of each cell's cone, and its strength; shape (num_cells, 2) each.

    A shape is MᵀM and q, for a matrix M of size 1, or s of principal stresses. Elastic cells are as
    bodies of infinite strength that keep their volume.
    """
    m, n = bodies[0].components, normals_of(bodies[0])
    plain = np.eye(m)
    plain[:n, :n] -= 1 / n
    no_sine = -1.0  # in the place of s where no principal stresses are bounded
    none: Floats = np.array([[*np.zeros(m), no_sine]])
    shapes, bounds = [np.append(_shape(plain[None]), none, axis=1)], []
    for body in bodies:
        principal = body.cones.is_principal
        sizes = np.where(principal, 1.0, np.linalg.norm(body.cone_matrix, axis=(1, 2)))
        slopes = body.cone_slope / sizes[:, None]
        sines = np.where(principal, body.cone_sine, no_sine)
        matrices = np.where(principal[:, None, None], np.eye(m), body.cone_matrix)
        shapes.append(np.column_stack([_shape(matrices), slopes, sines]))
        bounds.append(np.append(body.cone_bound / sizes, np.inf)[body.cone])
    numbers = _alike_rows(np.concatenate(shapes))
    ends = np.cumsum([1, *(len(body.cone_bound) for body in bodies)])
    found = []
    for body, bound, first in zip(bodies, bounds, ends, strict=False):
        mine = np.append(numbers[first : first + len(body.cone_bound)], numbers[0])
        found.append(np.column_stack([mine[body.cone], bound]).astype(np.float64))
    return found


def _shape(matrices: Floats) -> Floats:
    """MᵀM of matrices of size 1, in rows."""
    unit = matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True)
    return np.asarray((unit.transpose(0, 2, 1) @ unit).reshape(len(unit), -1))


def _alike_rows(rows: Floats) -> Longs:
    """A number for each row, the same for those that are rounded to the same."""
    digits = 11  # behind the point, that entries of cones of size 1 are compared with
    _, numbers = np.unique(np.round(rows, digits), axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)
