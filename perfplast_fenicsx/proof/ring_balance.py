"""Compute the cost of unbalanced forces in axisymmetry (:mod:`rings`, :mod:`balance`).

The stress S = rσ is quadratic in each section of a ring. Its hoop component follows from radial
equilibrium, so only axial forces and jumps of tractions remain unbalanced.

1. Supports and contact exert additional axial forces, which bring each piece into equilibrium.
2. Each cell transfers the axial forces of all cells beyond it, by tractions that are zero on the
   axis.
3. Radial forces that are linear in a cell balance the cell as a plane body; hoop
   stresses exert these forces.
4. Consider tractions that are quadratic on each side of a triangle and in equilibrium with body
   forces that are linear in the triangle. Some stress with these tractions is quadratic in
   each of the three parts into which the centre divides the triangle (D. N. Arnold, J. Douglas, C.
   P. Gupta, doi:10.1007/BF01379659). On the regular triangle, ``balance.QUADRATIC`` bounds the
   coefficients of this stress. The stress is zero at vertices on the axis, at which the tractions
   are zero, and can be made zero on a side on the axis. Then S/r is at most 2C/r' with the largest
   coefficient C and the least positive radius r' among the vertices and the centre.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balance import (
    QUADRATIC,
    TOO_LARGE,
    Cost,
    exerted_of,
    weights_of,
)
from perfplast_fenicsx.proof.balance import VOLUME as REGULAR
from perfplast_fenicsx.proof.balls import Balls, U, contracted, inverse_of, stacked, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.pieces import across_of, pieces_of, sums_by, tree_of
from perfplast_fenicsx.proof.plates import Plates, plates_of
from perfplast_fenicsx.proof.remainder import Anchors, Outer, summed
from perfplast_fenicsx.proof.rings import (
    PAIRS,
    coefficients_of_radius,
    facet_coefficients,
    radii_of,
    times_radius,
)

ALONG = 1
"""Index of the axial component."""


@dataclass(frozen=True)
class RingStress:
    """A stress in sections of rings, and the cost of balancing its residual.

    Attributes:
        vectors: Coefficients of the components (rr, zz, θθ, √2 rz) of S, shape (num_cells, 6, 4).
        errors: Errors of the hoop stress, shape (num_cells,).
        cost: Cost of balancing the unbalanced forces.
    """

    vectors: Floats
    errors: Floats
    cost: Cost


def ring_stress(body: Body, stress: Floats, kinds: Sequence[tuple[float, Loads]]) -> RingStress:
    """Return the stress with its hoop component, and the cost of balancing its residual.

    Args:
        body: The bodies of revolution.
        stress: Coefficients of S in the section plane, shape (num_cells, 6, 2, 2), zero on the
            axis.
        kinds: Loads of each kind, and their factors.
    """
    radii, areas = radii_of(body), body.shapes.areas
    total = Balls.exact(stress)
    force = summed([(factor, of.body_force) for factor, of in kinds])
    loads = [_times_radius(body, of.traction) * Balls.exact(factor) for factor, of in kinds]
    rates = []
    for a in range(3):
        pulls = [contracted(total[:, PAIRS[a, b]], areas[:, b, None]) for b in range(3)]
        weight = force * (body.shapes.volumes * Balls.exact(radii[:, a]))[:, None]
        rates.append(weight - stacked(pulls, 1).sum(axis=1))
    rate = stacked(rates, 1)  # divergence plus force, times the area, at vertices
    hoop = rate[..., 0] * inverse_of(body.shapes.volumes)[:, None]
    theta = times_radius(radii, (hoop.mid + hoop.low)[..., None])[..., 0]
    vectors = np.stack(
        [stress[..., 0, 0], stress[..., 1, 1], theta, np.sqrt(2.0) * stress[..., 0, 1]], axis=2
    )
    errors = upwards((hoop.rad + 16 * U * np.abs(hoop.mid)).max(axis=1))
    flat = areas.each(lambda part: part.reshape(-1, 2))

    def at(sides: Longs) -> Balls:
        """Return tractions times length, at vertices sorted by number and then at the edge."""
        numbers = facet_coefficients(body, sides)
        return contracted(total[(sides // 3)[:, None], numbers], flat[sides][:, None, None])

    one, other = body.sides[0].T
    own = np.column_stack([body.places, PAIRS[body.places[:, 0], body.places[:, 1]]])
    tractions = contracted(total[(body.outer // 3)[:, None], own], flat[body.outer][:, None, None])
    rho = coefficients_of_radius(body.vertices[body.facets][..., 0])
    traction = sum(loads[1:], start=loads[0])
    outer = Outer(body, tractions, traction, areas, rho)
    jumps = at(one) + at(other)
    lost = np.full(len(body.cells), np.inf)
    if not all(np.isfinite(of.size).all() for of in (rate, jumps, outer.left)):
        return RingStress(vectors, errors, Cost(lost, TOO_LARGE))
    acting = _Acting(body, rate[..., ALONG], jumps, outer.left)
    plates = plates_of(body, outer.rest, kinds, acting.pieces)
    acting.carry(body, plates.through, plates.missing[:, ALONG], plates.errors[:, ALONG])
    idle = np.ones(int(acting.pieces.max()) + 1, dtype=bool)
    outside = plates.acts_on(body, outer.acts)
    for of, acts in (
        (acting.pieces[body.outer // 3], outside[:, ALONG]),
        (acting.pieces, force.size[:, ALONG] > 0),
    ):
        np.logical_and.at(idle, of, ~acts)
    pushes, reason = _reactions(body, acting, outer.anchors(), plates, idle)
    if pushes is None:
        return RingStress(vectors, errors, Cost(lost, reason))
    size = _size(body, acting, pushes)
    return RingStress(vectors, errors, Cost(size, None))


def _times_radius(body: Body, traction: Floats) -> Balls:
    """Return the coefficients of r times tractions on facets, shape (num_facets, 3, 2)."""
    r, t = Balls.exact(body.vertices[body.facets][..., 0, None]), Balls.exact(traction)
    ends = r * t
    between = (r[:, 0] * t[:, 1] + r[:, 1] * t[:, 0]) * Balls.exact(0.5)
    return stacked([ends[:, 0], ends[:, 1], between], 1)


class _Acting:
    """Axial forces that act on each cell, divided by 2π.

    Attributes:
        on_sides: Sum over the sides of each cell of the largest coefficient of tractions times
            length.
        within: The largest axial force in each cell times its area.
        forces: Axial force on each cell.
        errors: Errors of ``forces``.
        pieces: Index of the piece of each cell.
        volumes: Areas of the cells' sections, bounded from below.
    """

    def __init__(self, body: Body, rate: Balls, jumps: Balls, outer: Balls) -> None:
        count = len(body.cells)
        self.volumes = body.shapes.least_volumes
        self.pieces = np.unique(pieces_of(body), return_inverse=True)[1].ravel()
        self.on_sides = np.zeros(count)
        self.within = rate.size.max(axis=1)
        mean = rate.sum(axis=1) * Balls.part(3)
        self.forces = mean.mid.copy()
        self.errors = mean.rad + np.abs(mean.low)
        one, other = body.sides[0].T // 3
        self._put(np.where(self.volumes[other] > self.volumes[one], other, one), jumps)
        self._put(body.outer // 3, outer)

    def _put(self, cells: Longs, tractions: Balls) -> None:
        """Add to the cells the negative of tractions times length."""
        np.add.at(self.on_sides, cells, tractions.norms().max(axis=1, initial=0.0))
        mean = tractions[..., ALONG].sum(axis=1) * Balls.part(3)
        np.add.at(self.forces, cells, -mean.mid)
        np.add.at(self.errors, cells, mean.rad + np.abs(mean.low) + 8 * U * np.abs(mean.mid))

    def carry(self, body: Body, facets: Longs, forces: Floats, errors: Floats) -> None:
        """Add axial forces to the cells of facets, by tractions that are zero on the axis."""
        cells = body.outer[facets] // 3
        np.add.at(self.on_sides, cells, 1.5 * (np.abs(forces) + errors))
        np.add.at(self.forces, cells, forces)
        np.add.at(self.errors, cells, errors + 8 * U * np.abs(forces))

    def push(self, body: Body, anchors: Anchors, forces: Floats) -> None:
        """Add to the cells the axial tractions of anchors, multiplied by ``forces``."""
        for facets, sign in ((anchors.facets, -1.0), (anchors.opposite, 1.0)):
            at = np.flatnonzero((facets >= 0) & (forces != 0))
            values = anchors.along[at] * Balls.exact(sign * forces[at])[:, None]
            first = np.arange(3) == 0
            self._put(body.outer[facets[at]] // 3, values[:, None].where(first[:, None]))

    def missing(self, idle: Flags) -> tuple[Floats, Floats]:
        """Return the axial force on each piece, and its error; both are zero for idle pieces."""
        count = len(idle)
        found, size, errors = (
            sums_by(self.pieces, values, count)
            for values in (self.forces, np.abs(self.forces), self.errors)
        )
        errors = errors + 4 * U * (len(self.pieces) + 64) * size
        return np.where(idle, 0.0, found), np.where(idle, 0.0, upwards(errors, len(self.pieces)))


def _reactions(
    body: Body, acting: _Acting, anchors: Anchors, plates: Plates, idle: Flags
) -> tuple[Floats | None, str | None]:
    """Return upper bounds on the additional forces of supports, contact and plates on facets.

    Args:
        body: The bodies.
        acting: Forces on cells.
        anchors: Anchors of supports and contact.
        plates: Rigid surfaces.
        idle: Pieces on which nothing acts along the axis.

    Returns:
        The bounds and None, or None and the reason why no such forces are known.
    """
    pieces = acting.pieces[body.outer // 3]
    first = np.append(anchors.facets, plates.first)
    second = np.append(anchors.opposite, plates.second)
    most = np.append(anchors.most, np.full(len(plates.first), np.inf))
    columns, own = np.arange(len(first)), len(anchors.facets)
    along = anchors.along[:, ALONG] * Balls.part(3)
    values = np.append(along.mid, np.ones(len(plates.first)))
    lost = np.append(along.rad + np.abs(along.low), np.zeros(len(plates.first)))
    mid, rad = np.zeros((2, len(idle), len(first)))
    for facets, sign in ((first, 1.0), (second, -1.0)):
        at = np.flatnonzero(facets >= 0)
        mid[pieces[facets[at]], columns[at]] += sign * values[at]
        rad[pieces[facets[at]], columns[at]] += lost[at] + U * np.abs(values[at])

    def push(forces: Floats) -> tuple[Floats, Floats]:
        """Return the forces that remain unbalanced with additional ``forces``, and errors."""
        acting.push(body, anchors, forces[:own])
        for facets, sign in ((plates.first, 1.0), (plates.second, -1.0)):
            there = facets >= 0
            acting.carry(body, facets[there], sign * forces[own:][there], 0 * forces[own:][there])
        return acting.missing(np.zeros_like(idle))

    limits = weights_of(body, first, most), most
    exerted, reason = exerted_of((mid, rad), limits, acting.missing(idle), push)
    if exerted is None:
        return None, reason
    exerted[own:] *= 1.5
    found = np.zeros(len(body.facets))
    for facets in (first, second):
        np.add.at(found, facets[facets >= 0], exerted[facets >= 0])
    return upwards(found, len(first)), None


def _size(body: Body, acting: _Acting, pushes: Floats) -> Floats:
    """Return an upper bound for each cell on the size of a stress that balances the forces."""
    count = len(body.cells)
    more = sums_by(body.outer // 3, pushes, count)
    sides = acting.on_sides + more + 1.5 * _passed(body, acting, more)
    x, radii = body.vertices[body.cells], radii_of(body)
    extent = np.linalg.norm(np.ptp(x, axis=1), axis=1)
    heights = x[..., ALONG] - x[..., ALONG].mean(axis=1, keepdims=True)
    spread = (heights**2).sum(axis=1) / 12  # mean squared distance from the middle
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        turn = (sides + acting.within) * extent / spread
        radial = sides + turn * np.abs(heights).max(axis=1)
        inside = QUADRATIC[0] * sides + QUADRATIC[1] * (acting.within + radial)
        largest = body.shapes.stretches
        inverse = body.shapes.to_regular.norms
        section = largest**2 * inverse / (acting.volumes / REGULAR[2]) * inside
        some = np.where(radii > 0, radii, np.inf).min(axis=1)
        touches = (radii == 0).any(axis=1)
        near = np.where(touches, np.minimum(some, radii.mean(axis=1)) / 2, some)
        size = section / near + radial / acting.volumes
    rounding = 1e-9
    return np.where(inside == 0, 0.0, np.where(np.isnan(size), np.inf, size * (1 + rounding)))


def _passed(body: Body, acting: _Acting, pushes: Floats) -> Floats:
    """Return upper bounds on the tractions times length that each cell's sides transfer, summed."""
    count, across = len(body.cells), across_of(body)
    levels, back = tree_of(body, across, acting.volumes, acting.pieces)
    forces, errors = acting.forces.copy(), acting.errors + pushes
    found, sizes = np.zeros(count), np.abs(forces) + errors
    for cells in levels[:0:-1]:
        towards = across[back[cells]] // 3
        errors[cells] += 8 * U * sizes[cells]
        passed = np.abs(forces[cells]) + errors[cells]
        np.add.at(found, cells, passed)
        np.add.at(found, towards, passed)
        np.add.at(sizes, towards, sizes[cells])
        np.add.at(forces, towards, forces[cells])
        np.add.at(errors, towards, errors[cells])
    # All terms are non-negative. Each term is rounded at most once in each cell on the way to the
    # root.
    return upwards(found * (1 + 1e-12), 2 * count + 64)
