"""Compute an upper bound on a mechanism's dissipation in cells, and check its strain rates.

Rates are multiplied by the volume of their cell, which avoids a division by the volume. In dilating
cells a rate is admissible if z ≥ ‖y‖ (:mod:`cones`). The admissible rates form a convex cone.
Therefore the condition holds everywhere in a cell if it holds at the vertices, or in axisymmetry
for the Bernstein coefficients. The checker requires a margin above rounding. In cells that preserve
their volume, the module computes the dissipation from the rate without its trace, because another
velocity undoes the trace (:mod:`volume_change`).

ε(v) is linear in a cell. The integral of a convex D is at most the integral of its linear
interpolation on any subdivision of the cell. If D is linear, its mean is the mean over the
vertices. A strength that is linear in the cell multiplies this interpolation, and the product is
integrated exactly. For bodies of revolution the velocity is v = ru (:mod:`rings`), and works are
divided by 2π.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, in_blocks, norms_of, stacked, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.mechanism import Mechanism
from perfplast_fenicsx.proof.parts import halved, mean_shares, parts_of
from perfplast_fenicsx.proof.places import numbers_in_cell
from perfplast_fenicsx.proof.rings import (
    ENDS,
    PAIRS,
    coefficients_of_radius,
    over_radius,
    radii_of,
    times_radius,
)

SUBDIVISIONS = 3
"""Number of times that a cell's edges are halved for the upper bound on the dissipation."""


@dataclass(frozen=True)
class Rates:
    """Strain rates times the cell's volume, at vertices or as coefficients, with errors.

    Attributes:
        values: Vectors, shape (num_cells, d + 1 or 6, m); in axisymmetry coefficients of r²ε.
        errors: Error of each cell, shape (num_cells,).
        change: div v times the volume at vertices, shape (num_cells, d + 1).
        reach: Integral of a unit rate over its cell, divided by the volume: 1, or in axisymmetry
            the mean of 1/r, bounded from above.
        of_gradient: Largest rate for ‖∇w‖ = 1 in a cell, without ``reach``.
    """

    values: Floats
    errors: Floats
    change: Balls
    reach: Floats
    of_gradient: Floats


def rates_of(body: Body, mechanism: Mechanism) -> Rates:
    """Return the rates of a mechanism."""
    d = body.dim
    own = mechanism.at.each(lambda part: part[mechanism.places.of_cells])
    number = numbers_in_cell(d)
    slopes = body.shapes.areas * Balls.part(d) * Balls.exact(-2.0)
    own = own.where(~mechanism.rigid[:, None, None])  # rates of rigid cells are exactly zero

    def gradient(own: Balls, slopes: Balls) -> Balls:
        columns = []
        for a in range(d + 1):
            parts = [own[:, number[a, b]][:, :, None] * slopes[:, b][:, None] for b in range(d + 1)]
            columns.append(sum(parts[1:], start=parts[0]))
        return stacked(columns, 1)

    gradients = in_blocks(gradient, own, slopes)
    mid, low, rad = gradients.mid, gradients.low, gradients.rad
    traces = [gradients[:, :, i, i] for i in range(d)]
    change = sum(traces[1:], start=traces[0])
    values = mid + low
    count = len(mid)
    errors, sizes = (norms_of(of.reshape(count, d + 1, -1)).max(axis=1) for of in (rad, values))
    errors = upwards(errors + 8 * U * sizes)
    one = np.ones(len(body.cells))
    if not body.is_revolved:
        return Rates(vectors(values), errors, change, one, one)
    return _of_rings(body, own, values, errors, change)


def _of_rings(body: Body, own: Balls, gradients: Floats, errors: Floats, change: Balls) -> Rates:
    """Return coefficients of r²ε, and their largest change for ‖∇w‖ = 1.

    For a velocity w in place of v, the norm of r²ε is at most r‖∇w‖ + √2 |w|, and w = 0 at
    vertices. In a cell of size h at a distance of at least r₀ from the axis, |w| ≤ h‖∇w‖ ≤ (h/r₀)
    r‖∇w‖. In a cell that touches the axis, |w| ≤ κr‖∇w‖. Here κ bounds the distances of the other
    vertices from the vertices on the axis, divided by the radii of the other vertices. From each
    point of the cell, a line of length at most κr leads to a vertex or edge on the axis.
    """
    radii, volumes = radii_of(body), body.volumes
    sizes = own.mid + own.low
    at = sizes * volumes[:, None, None]
    g = times_radius(radii, gradients.reshape(len(at), 3, 4)).reshape(-1, 6, 2, 2)
    shear = np.sqrt(0.5) * (g[..., 0, 1] + g[..., 1, 0] - at[..., 1])
    values = np.stack([g[..., 0, 0] - at[..., 0], g[..., 1, 1], at[..., 0], shear], axis=2)
    most = norms_of(gradients.reshape(len(at), 3, 4)).max(axis=1) * radii.max(axis=1)
    most += 2 * norms_of(at).max(axis=1)
    off = errors * radii.max(axis=1) + 2 * norms_of(own.rad).max(axis=1) * volumes
    shape = 64 * U * _worst(body)  # relative error of volumes
    reach = over_radius(radii, np.ones(len(radii))).sum(axis=1)
    x = body.vertices[body.cells]
    far = np.linalg.norm(x[:, :, None] - x[:, None], axis=3)
    touches = radii == 0
    near = np.where(touches, np.inf, radii).min(axis=1)
    away = np.where(touches[:, :, None] & ~touches[:, None], far, 0.0)
    longest = np.where(touches.any(axis=1), away.max(axis=(1, 2)), far.max(axis=(1, 2)))
    ratio = longest / near
    of_gradient = upwards(1 + np.sqrt(2.0) * ratio)
    return Rates(values, upwards(off + shape * most), change, upwards(reach), of_gradient)


def _worst(body: Body) -> Floats:
    """Return 1 + h^d/V for cells of extent h and volume V, to scale rounding errors."""
    x = body.vertices[body.cells]
    size = np.ptp(x, axis=1).max(axis=1)
    return np.asarray(1 + size**body.dim / body.volumes)


@dataclass(frozen=True)
class Dissipated:
    """The dissipation of cells.

    Attributes:
        total: Total dissipation, bounded from above.
        short: Largest lack of dilatancy in each cell, including errors, in units of the rates; −∞
            for cells that do not dilate.
    """

    total: float
    short: Floats


def dissipated(body: Body, rates: Rates) -> Dissipated:
    """Return the dissipation of plastic cells."""
    cones, plastic = body.cones, body.plastic
    at, values = body.cone[plastic], rates.values[plastic]
    sizes = norms_of(values).max(axis=1, initial=0.0)
    short = np.full(len(body.cells), -np.inf)
    grows = cones.grows[at]
    lacking = cones.short(at[grows], values[grows])
    if body.is_revolved:  # a coefficient on the axis is exactly zero, and so admissible
        rho = coefficients_of_radius(radii_of(body)[plastic][grows])
        lacking = np.where(rho > 0, lacking, -np.inf)
    lacks = lacking.max(axis=1, initial=-np.inf)
    off = (rates.errors[plastic] + cones.digits[at] * sizes) * cones.alertness[at]
    short[np.flatnonzero(plastic)[grows]] = lacks + off[grows]
    integral = _of_rings_in_all if body.is_revolved else _in_all
    total, count = integral(body, plastic, values)
    most_of = body.steepness[plastic] * rates.reach[plastic]
    off = rates.errors[plastic] + 2 * cones.digits[at] * sizes
    lost, most = float((off * most_of).sum()), float((sizes * most_of).sum())
    return Dissipated(total + lost * (1 + 1e-9) + 8 * U * (count + 16) * most, short)


def _in_all(body: Body, plastic: Flags, rates: Floats) -> tuple[float, int]:
    """Return an upper bound on ∫D from rates times volumes, and the number of terms in its sum."""
    cones, at, strength = body.cones, body.cone[plastic], body.cell_strength[plastic]
    linear, principal = cones.is_linear[at], cones.is_pointwise[at]
    total = _of_linear(cones.linear_power(at[linear], rates[linear]), strength[linear])
    some = np.flatnonzero(~linear & ~principal)
    points, shares = halved(body.dim, SUBDIVISIONS)
    at_once = 10_000  # number of cells processed together, limited by memory
    for cells in np.array_split(some, len(some) // at_once + 1):
        sizes, along = cones.convex_power(at[cells], rates[cells])
        squares = np.zeros((len(cells), len(points)))
        for component in sizes.transpose(2, 0, 1):
            squares += (component @ points.T) ** 2
        least = 1e-150 * (sizes != 0).any(axis=(1, 2))[:, None]  # squares of less may underflow
        powers = np.maximum(np.sqrt(squares), least)
        total += float(np.einsum("cp,cp->", powers, strength[cells] @ shares.T))
        total += _of_linear(along, strength[cells])
    some = np.flatnonzero(~linear & principal)
    parts = -(-len(some) * len(points) // (100 * at_once))
    for cells in np.array_split(some, parts) if parts else []:
        powers = cones.principal_power(at[cells], points @ rates[cells])
        total += float(np.einsum("cp,cp->", powers, strength[cells] @ shares.T))
    return total, len(rates) + len(points)


def _of_linear(values: Floats, strength: Floats) -> float:
    """Return the sum over cells of the means of products of two linear functions.

    Args:
        values: First function at the vertices, shape (num_cells, d + 1).
        strength: Second function, of the same shape.
    """
    return float(np.einsum("cv,cv->", mean_shares(values[..., None])[..., 0], strength))


def _of_rings_in_all(body: Body, plastic: Flags, rates: Floats) -> tuple[float, int]:
    """Return an upper bound on ∫D from coefficients of r²ε, and the number of terms in its sum."""
    cones, at, radii = body.cones, body.cone[plastic], radii_of(body)[plastic]
    linear, principal = cones.is_linear[at], cones.is_pointwise[at]
    parts, total = parts_of(2, SUBDIVISIONS), 0.0
    for part in parts:
        q = np.einsum("ua,vb,cabm->cuvm", part, part, rates[:, PAIRS], optimize=True)
        first, second = np.concatenate([np.tile(np.arange(3)[:, None], 2), ENDS]).T
        q = q[:, first, second]
        powers = np.zeros(q.shape[:2])
        powers[linear] = cones.linear_power(at[linear], q[linear])
        some = ~linear & principal
        powers[some] = cones.principal_power(at[some], q[some])
        some = ~linear & ~principal
        convex, along = cones.convex_power(at[some], q[some])
        powers[some] = norms_of(convex) + along
        shares = over_radius(radii @ part.T, np.full(len(radii), 1 / len(parts)))
        total += float(np.einsum("ci,ci->", shares, powers))
    return total, len(rates) + len(parts)
