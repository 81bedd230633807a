"""Shapes of the cones of cells, and their strengths: cones are compared that differ in size."""

from typing import NamedTuple

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.rings import normals_of


class Strengths(NamedTuple):
    """Strength of the cone of each cell; shapes (num_cells,).

    Attributes:
        family: A number of MᵀM and the direction of q, for a matrix M of size 1, or of all cones of
            principal stresses with the same ratio of c to a tensile strength.
        slope: |q|, or the sine.
        bound: Bound of cones whose M has size 1.
        axial: Whether M q = 0, or the cone is one of principal stresses: less of a slope and no
            higher apex make it smaller.
    """

    family: Longs
    slope: Floats
    bound: Floats
    axial: Flags

    def of(self, cells: Longs) -> "Strengths":
        """Return the strengths of some cells."""
        return Strengths(
            self.family[cells], self.slope[cells], self.bound[cells], self.axial[cells]
        )


def are_weaker(lower: Strengths, upper: Strengths) -> Flags:
    """Return whether sets of cells are not known to hold those of others.

    With slopes α < α' on one axis the set of α is in that of α' if its apex is no higher,
    c/α ≤ c'/α': both are so at the apex, and below it the other one opens by more.

    Args:
        lower: Lower bound of cells, n of them.
        upper: Of those that ought to hold them, as many.
    """
    rounding = 1e-12  # of a bound over the size of its matrix
    digits = 1e-11  # that slopes of cones of size 1 are compared with
    same = np.abs(lower.slope - upper.slope) <= digits
    more = lower.bound <= upper.bound * (1 + rounding)
    flatter = lower.axial & (0 < lower.slope) & (lower.slope < upper.slope)
    with np.errstate(invalid="ignore"):  # ∞·0 of elastic cells, which have no cone
        no_higher = lower.bound * upper.slope <= upper.bound * lower.slope * (1 + rounding)
    holds = (lower.family == upper.family) & ((same & more) | (~same & flatter & no_higher))
    return np.asarray(~holds)


def strengths_of(*bodies: Body) -> list[Strengths]:
    """Return strengths of the cells of each body.

    Elastic cells are as bodies of infinite strength that keep their volume.
    """
    m, n = bodies[0].components, normals_of(bodies[0])
    plain = np.eye(m)
    plain[:n, :n] -= 1 / n
    none: Floats = np.zeros((1, m + 2))
    shapes, cones = [np.append(_shape(plain[None]), none, axis=1)], []
    for body in bodies:
        principal = body.cones.is_principal
        sizes = np.where(principal, 1.0, np.linalg.norm(body.cone_matrix, axis=(1, 2)))
        slopes = body.cone_slope / sizes[:, None]
        steep = np.linalg.norm(slopes, axis=1)
        along = np.divide(slopes, steep[:, None], out=0 * slopes, where=steep[:, None] > 0)
        matrices = np.where(principal[:, None, None], np.eye(m), body.cone_matrix)
        lost = np.linalg.norm(np.einsum("cij,cj->ci", matrices, along), axis=1)
        axial = principal | (lost <= 1e-11 * sizes)
        along[principal] = 0.0
        cuts = np.nan_to_num(body.cone_bound / body.cone_tension)
        shapes.append(np.column_stack([_shape(matrices), along, principal, cuts]))
        steep = np.where(principal, body.cone_sine, steep)
        cones.append((steep, body.cone_bound / sizes, axial))
    numbers = _alike_rows(np.concatenate(shapes))
    found, first = [], 1
    for body, (steep, bound, axial) in zip(bodies, cones, strict=True):
        family = np.append(numbers[first : first + len(bound)], numbers[0])
        first += len(bound)
        every = family, np.append(steep, 0.0), np.append(bound, np.inf), np.append(axial, False)
        found.append(Strengths(*every).of(body.cone))
    return found


def _shape(matrices: Floats) -> Floats:
    """MᵀM of matrices of size 1, in rows."""
    unit = matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True)
    return np.asarray((unit.transpose(0, 2, 1) @ unit).reshape(len(unit), unit.shape[2] ** 2))


def _alike_rows(rows: Floats) -> Longs:
    """Return a number for each row, the same for those that are rounded to the same."""
    digits = 11  # after the point, that entries of cones of size 1 are compared with
    _, numbers = np.unique(np.round(rows, digits), axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)
