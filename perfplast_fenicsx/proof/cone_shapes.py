"""Compare the strengths of cells whose cones may have different shapes and sizes."""

from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.cones import ROUNDED
from perfplast_fenicsx.proof.reduction import Division
from perfplast_fenicsx.proof.rings import normals_of


class Strengths(NamedTuple):
    """Strengths of the cells' cones; all arrays have the shape (num_cells,).

    Attributes:
        family: Index of the shape. Cones of one shape have equal (MᵀM)^½ and direction of q after
            scaling M to size 1, up to rounding. Cones of principal stresses have one shape if the
            ratio of c to the tensile strength is equal, and parabolas if the ratio of k to f is
            equal.
        slope: |q| after this scaling, or s/√(1 − s²) = tan φ for bounds of principal stresses.
        bound: c after this scaling, or c/√(1 − s²) for bounds of principal stresses.
        axial: Whether M q = 0, or the cone bounds principal stresses. In both cases a smaller slope
            with an apex that is not higher gives a smaller cone.
    """

    family: Longs
    slope: Floats
    bound: Floats
    axial: Flags

    def of(self, cells: Longs) -> "Strengths":
        """Return the strengths of selected cells."""
        return Strengths(
            self.family[cells], self.slope[cells], self.bound[cells], self.axial[cells]
        )


def are_weaker(lower: Strengths, upper: Strengths) -> Flags:
    """Return flags of cells whose cones in ``lower`` may lie partly outside those in ``upper``.

    For slopes α < α' and the same axis, a cone with slope α lies within a cone with slope α' if the
    apex of the first cone is not higher, c/α ≤ c'/α'. The apex of the first cone lies within the
    second cone, and below the apex the second cone opens faster.

    Args:
        lower: Strengths of n cells.
        upper: Strengths of n cells whose cones should contain the cones of ``lower``.
    """
    rounding = 1e-12  # relative tolerance of scaled bounds
    digits = 1e-11  # relative tolerance of slopes
    same = np.abs(lower.slope - upper.slope) <= digits * np.minimum(lower.slope, upper.slope)
    more = lower.bound <= upper.bound * (1 + rounding)
    flatter = lower.axial & (0 < lower.slope) & (lower.slope < upper.slope)
    with np.errstate(invalid="ignore"):  # ∞·0 for elastic cells, which have no cone
        no_higher = lower.bound * upper.slope <= upper.bound * lower.slope * (1 + rounding)
    holds = (lower.family == upper.family) & ((same & more) | (~same & flatter & no_higher))
    elastic = np.isinf(upper.bound) & (upper.slope == 0)
    return np.asarray(~(holds | elastic))


def strengths_of(
    *bodies: Body, divisions: Sequence[Division] = (), match: int = 0
) -> list[Strengths]:
    """Return the strengths of the cells of each body.

    Elastic cells count as volume-preserving bodies of infinite strength. They contain each cone.

    Args:
        bodies: The bodies.
        divisions: How a factor divides the strengths of each body, for undivided strengths. Then
            cones of one shape are also of one kind.
        match: Index of the match of Drucker–Prager cones.
    """
    m, n = bodies[0].components, normals_of(bodies[0])
    plain = np.eye(m)
    plain[:n, :n] -= 1 / n
    none: Floats = np.zeros((1, m + 3))  # no slope and no bounds of principal stresses
    shapes, cones = [np.append(_shape(plain[None]), none, axis=1)], []
    for body, division in zip_longest(bodies, divisions):
        principal = body.cones.is_pointwise
        sizes = np.where(principal, 1.0, np.linalg.norm(body.cone_matrix, axis=(1, 2)))
        slopes = body.cone_slope / sizes[:, None]
        steep = np.linalg.norm(slopes, axis=1)
        along = np.divide(slopes, steep[:, None], out=0 * slopes, where=steep[:, None] > 0)
        matrices = np.where(principal[:, None, None], np.eye(m), body.cone_matrix)
        lost = np.linalg.norm(np.einsum("cij,cj->ci", matrices, along), axis=1)
        axial = principal | (lost <= ROUNDED * sizes)
        along[principal] = 0.0
        cosine = np.sqrt((1 - body.cone_sine) * (1 + body.cone_sine))
        cosine = np.where(body.cones.is_principal, cosine, 1.0)
        bound = body.cone_bound / sizes / cosine
        kinds = principal + 2 * body.cones.is_cut + 4 * body.cones.is_curved
        cuts = _logarithms(bound / body.cone_tension, body.cones.is_cut)
        bends = _logarithms(body.cone_curvature / body.cone_bound, body.cones.is_curved)
        steep = np.where(body.cones.is_principal, body.cone_sine / cosine, steep)
        if division is not None:
            kinds = kinds + 8 * division.kind
            matched = division.kind > 1
            tangents = division.tangents[min(match, len(division.tangents) - 1)]
            # F does not move the apex, where p = c/|q|
            ratio = np.divide(tangents, steep, out=np.ones_like(steep), where=matched)
            bound = bound * ratio * division.times
            steep = np.where(matched, tangents, steep) * division.times
        shapes.append(np.column_stack([_shape(matrices), along, kinds, cuts, bends]))
        cones.append((steep, bound, axial))
    numbers = _alike_rows(np.concatenate(shapes), m)
    found, first = [], 1
    for body, (steep, bound, axial) in zip(bodies, cones, strict=True):
        family = np.append(numbers[first : first + len(bound)], numbers[0])
        first += len(bound)
        every = family, np.append(steep, 0.0), np.append(bound, np.inf), np.append(axial, False)
        found.append(Strengths(*every).of(body.cone))
    return found


def _logarithms(ratios: Floats, known: Flags) -> Floats:
    """Return the logarithms of ratios, and 0 where no ratio is known."""
    return np.asarray(np.log(ratios, where=known, out=np.zeros_like(ratios)))


def _shape(matrices: Floats) -> Floats:
    """Return (MᵀM)^½ of matrices after scaling them to size 1, as rows.

    The singular values of M give the root to the precision of M. The root of MᵀM itself would have
    only half as many digits.
    """
    unit = matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True)
    _, values, along = np.linalg.svd(unit, full_matrices=False)
    return np.asarray(
        np.einsum("cki,ck,ckj->cij", along, values, along).reshape(len(unit), unit.shape[2] ** 2)
    )


def _alike_rows(rows: Floats, m: int) -> Longs:
    """Return an index for each row; rows that are equal up to rounding have the same index.

    A large pressure multiplies a difference of M or of the direction of q, and the lower half pays
    only for rounding. A difference of the other numbers is a relative difference of strengths.

    Args:
        rows: (MᵀM)^½, the direction of q and other numbers, shape (n, m² + m + 3).
        m: Number of components of a stress.
    """
    rounding, digits = 1e-15, 11
    shapes, of_row = np.unique(rows[:, : m * m + m], axis=0, return_inverse=True)
    groups, count = np.full(len(shapes), -1, dtype=np.int64), 0
    while (groups < 0).any():  # shapes are few; numbers of strengths may differ in all cells
        first = np.argmax(groups < 0)
        off = np.split(shapes - shapes[first], [m * m], axis=1)
        alike = np.logical_and(*(np.linalg.norm(part, axis=1) <= rounding for part in off))
        groups[alike & (groups < 0)] = groups[first] = count
        count += 1
    others = np.round(rows[:, m * m + m :], digits)
    every = np.column_stack([groups[of_row.ravel()], others])
    _, numbers = np.unique(every, axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)
