"""Compute the cost of unbalanced forces: the size of a stress that balances them.

A stress σ leaves some forces unbalanced. If a stress τ balances these forces, σ + τ is in
equilibrium. The sum satisfies f(σ + τ) ≤ c if f(σ) + f(τ) ≤ c, because f is convex and homogeneous
of degree 1. Therefore only the size of τ in each cell is needed, and the module computes an upper
bound on this size.

1. Additional forces of supports and contact bring each connected piece of cells into equilibrium as
   a whole (``_reactions``). The contact pressure must exceed the additional contact forces.
2. The cells of a piece form a tree. Each cell transfers the resultant force F and moment M of all
   cells beyond it through one facet, by the traction F/A + θ × (x − x₀) with Iθ = M, where the
   facet has the area A, the centre x₀ and the second moments of area I. With these tractions, each
   cell is in equilibrium on its own. For c = 0, tractions and τ can be made zero at vertices of
   free surfaces. A facet with two such vertices transfers no traction, and a facet with one such
   vertex transfers a quadratic traction.
3. If tractions are linear on each facet of a simplex and in equilibrium with a uniform body force,
   some stress with these tractions is linear in each of the d + 1 parts into which the centre
   divides the simplex (C. Johnson, B. Mercier, doi:10.1007/BF01403910; in 3D M. Křížek,
   doi:10.1090/S0025-5718-1983-0717689-3). On the regular simplex with edges of length 1,
   :data:`SIZE` bounds this stress. The map x = By from the regular simplex to the cell turns the
   stress τ' into Bτ'Bᵀ. Products T of tractions and areas of the cell become B⁻¹T/det B on the
   regular simplex. In a needle-shaped cell of length L and height h, B⁻¹ divides tractions along
   the cell by L, and tractions across the cell by h.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, crossed, norms_of, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.pieces import across_of, bare_ends, pieces_of, sums_by, tree_of
from perfplast_fenicsx.proof.plates import Plates, plates_of
from perfplast_fenicsx.proof.remainder import Anchors, Remainder
from perfplast_fenicsx.proof.rigid import moments

SIZE = {2: (2.78, 0.96), 3: (12.2, 3.26)}
"""Bounds on the stress in a regular simplex, by dimension. The first factor multiplies the largest
traction times area, summed over the facets; the second factor multiplies the body force. A test
computes both factors.
"""

QUADRATIC = (3.7, 1.56)
"""Bounds for quadratic tractions in 2D (:mod:`ring_balance`). The first factor multiplies the
largest coefficient of traction times length, summed over the sides; the second factor multiplies
the largest body force. Together they bound the coefficients of the stress, in triangles with and
without a side on which the stress is zero. A test computes both factors.
"""

VOLUME = {2: 3**0.5 / 4, 3: 2**0.5 / 12}
"""Volume of the regular simplex with edges of length 1, by dimension."""

MOST_NUMBERS = 40_000_000
"""Largest number of entries in the matrix of forces on pieces, limited by memory."""


@dataclass(frozen=True)
class Cost:
    """The cost of balancing unbalanced forces.

    Attributes:
        size: Upper bound on the size of τ in each cell, shape (num_cells,); ∞ if no τ is known.
        reason: Reason why no τ is known, or None.
    """

    size: Floats
    reason: str | None


def cost_of(
    body: Body,
    left: Remainder,
    kinds: Sequence[tuple[float, Loads]],
    bare: Flags | None = None,
) -> Cost:
    """Return the cost of balancing ``left``, the unbalanced forces of a stress.

    Args:
        body: The bodies, in 2D or 3D.
        left: The unbalanced forces.
        kinds: Loads of each kind, and their factors.
        bare: In 2D, flags of vertices of cells at which τ must be zero, shape (num_cells, 3).
    """
    lost = np.full(len(body.cells), np.inf)
    if not all(np.isfinite(of.size).all() for of in (left.cells, left.inner, left.outer)):
        return Cost(lost, TOO_LARGE)
    acting = _Acting(body, left)
    plates = plates_of(body, left.plates, kinds, acting.pieces)
    every = np.arange(len(plates.through))
    ends = bare_ends(body, bare)
    of_plates = np.concatenate([plates.through, plates.first, plates.second[plates.second >= 0]])
    if ends[body.outer[of_plates]].any() or not acting.is_clear(body, left, bare):
        return Cost(lost, "forces act where ground without cohesion has no stress")
    acting.carry(body, plates, (plates.through, every), (plates.missing, plates.errors))
    pushes, reason = _reactions(body, left, acting, plates)
    if pushes is None:
        return Cost(lost, reason)
    pushed = sums_by(body.outer // (body.dim + 1), pushes, len(lost))
    cells, none = np.arange(len(lost)), np.zeros((len(lost), body.dim))
    on_sides = acting.on_sides + acting.mapped(cells, none, pushed)
    passed = _passed(body, acting, pushed, ends)
    if passed is None:
        return Cost(lost, "cells touch others only where ground without cohesion has no stress")
    curved = ends.reshape(len(lost), -1).any(axis=1)
    of_facets, of_force = (
        np.where(curved, *of) for of in zip(QUADRATIC, SIZE[body.dim], strict=True)
    )
    within = acting.mapped(cells, left.cells.mid, left.cells.distances()) * of_force
    inside = upwards(of_facets * (on_sides + passed) + within)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        stretch = body.shapes.stretches**2 / (acting.volumes / VOLUME[body.dim])
        size = np.where(inside == 0, 0.0, upwards(stretch) * inside)
    return Cost(upwards(np.where(np.isnan(size), np.inf, size)), None)


class _Acting:
    """Forces and moments on each cell that τ must balance.

    The jump of tractions between two cells acts on the stronger cell.

    Attributes:
        volumes: Volumes, bounded from below.
        mapped: Function that returns upper bounds on |B⁻¹F| for forces F on cells.
        on_sides: Sum over the sides of each cell of the largest |B⁻¹T| of tractions times area T,
            shape (num_cells,).
        forces: Forces, shape (num_cells, d).
        moments: Moments about ``middles``, shape (num_cells, 1 or 3).
        errors: Errors of the forces and of the moments, shape (2, num_cells).
        middles: A point in each cell.
        extents: Largest distance of each cell's vertices from its point in ``middles``.
        pieces: Index of the piece of each cell.
        jumped: The side on which each inner facet's jump acts.
    """

    def __init__(self, body: Body, left: Remainder) -> None:
        d, count, x = body.dim, len(body.cells), body.vertices[body.cells]
        self.volumes = body.shapes.least_volumes
        self.mapped = body.shapes.to_regular.sizes
        self.pieces = np.unique(pieces_of(body), return_inverse=True)[1].ravel()
        self.middles = x.mean(axis=1)
        self.extents = norms_of(x - self.middles[:, None]).max(axis=1)
        self.on_sides = np.zeros(count)
        self.forces, self.moments = left.cells.mid.copy(), np.zeros((count, 2 * d - 3))
        pulls = left.cells.norms()
        rounded = 16 * U * np.abs(x).max(axis=(1, 2))
        self.errors = np.stack([norms_of(left.cells.rad), pulls * rounded])
        self.errors[0] += 4 * U * pulls
        self._put(body, body.outer, body.facets, left.outer)
        one, other = body.sides[0].T
        cells = one // (d + 1), other // (d + 1)
        bears = np.minimum(body.yield_radius, np.finfo(float).max)
        less, more = (bears[of] for of in cells)
        larger = self.volumes[cells[1]] > self.volumes[cells[0]]
        self.jumped = np.where((more > less) | ((more == less) & larger), other, one)
        self._put(body, self.jumped, self._ends(body), left.inner)

    def _ends(self, body: Body) -> Longs:
        """Return the vertices of each inner facet, in ascending order of their indices."""
        own = body.cells[self.jumped // (body.dim + 1)]
        corners = body.corners[self.jumped % (body.dim + 1)]
        return np.sort(np.take_along_axis(own, corners, axis=1), axis=1)

    def is_clear(self, body: Body, left: Remainder, bare: Flags | None) -> bool:
        """Return whether tractions on cells are exactly zero wherever τ must be zero.

        Args:
            body: The bodies.
            left: The unbalanced forces.
            bare: Flags of vertices of cells at which τ must be zero.
        """
        if bare is None:
            return True
        cells, wide = body.outer // (body.dim + 1), body.dim + 1
        pulled = bare[cells[:, None], body.places] & (left.outer.norms() > 0)
        own = self.jumped // wide
        here = body.cells[own][:, None] == self._ends(body)[..., None]
        jumps = (here & bare[own][:, None]).any(axis=2) & (left.inner.norms() > 0)
        return not (pulled.any() or jumps.any())

    def push(self, body: Body, anchors: Anchors, forces: Floats) -> None:
        """Add to the cells the tractions of anchors, multiplied by ``forces``."""
        for facets, corners, sign in (
            (anchors.facets, anchors.corners, -1.0),
            (anchors.opposite, anchors.opposite_corners, 1.0),
        ):
            at = np.flatnonzero((facets >= 0) & (forces != 0))
            values = anchors.along[at] * Balls.exact(sign * forces[at])[:, None]
            here = np.arange(body.dim) == corners[at, None]
            each = values[:, None].where(here[..., None])
            self._put(body, body.outer[facets[at]], body.facets[facets[at]], each)

    def carry(
        self,
        body: Body,
        plates: Plates,
        at: tuple[Longs, Longs],
        wrenches: tuple[Floats, Floats],
    ) -> None:
        """Add to the cells the forces and moments that plates transfer through facets.

        Args:
            body: The bodies.
            plates: Rigid surfaces.
            at: Facet through which each wrench acts (−1 for no facet), and index of the wrench's
                plate.
            wrenches: Forces, and moments about the plates' centres divided by the extents, shape
                (n, 3 or 6), and the errors of both.
        """
        d, some = body.dim, np.flatnonzero(at[0] >= 0)
        facets, of = at[0][some], at[1][some]
        values, errors = wrenches[0][some], wrenches[1][some]
        extents = plates.extents[of, None]
        forces, turns = values[:, :d], values[:, d:] * extents
        off = upwards(errors[:, :d].sum(axis=1)), upwards((errors[:, d:] * extents).sum(axis=1))
        cells = body.outer[facets] // (d + 1)
        arms = plates.centres[of] - self.middles[cells]
        size, turn = (norms_of(part) for part in (forces, turns))
        far = np.abs(plates.centres[of]).max(axis=1) + np.abs(self.middles[cells]).max(axis=1)
        far = upwards(norms_of(arms)) + 8 * U * far
        np.add.at(self.forces, cells, forces)
        np.add.at(self.moments, cells, turns + moments(arms, forces))
        np.add.at(self.errors[0], cells, off[0] + 8 * U * size)
        lost = off[1] + off[0] * far + 32 * U * (turn + size * far)
        np.add.at(self.errors[1], cells, lost)
        through = self._through(body, plates, (facets, of), (size, turn, off))
        np.add.at(self.on_sides, cells, self.mapped(cells, np.zeros_like(forces), through))

    def through(self, body: Body, plates: Plates, facets: Longs, sizes: Floats) -> Floats:
        """Return upper bounds on the tractions times area with which facets transfer plate forces.

        Args:
            body: The bodies.
            plates: Rigid surfaces.
            facets: Facet of each additional plate force; −1 is not allowed.
            sizes: Sizes of the forces.
        """
        of, d = plates.plate, body.dim
        turns = plates.component >= d
        turn = sizes * np.where(turns, plates.extents[of], 0.0)
        none = np.zeros(len(sizes))
        size = np.where(turns, 0.0, sizes)
        return self._through(body, plates, (facets, of), (size, turn, (none, none)))

    def _through(
        self,
        body: Body,
        plates: Plates,
        at: tuple[Longs, Longs],
        wrench: tuple[Floats, Floats, tuple[Floats, Floats]],
    ) -> Floats:
        (facets, of), (size, turn, off) = at, wrench
        x = body.vertices[body.facets[facets]]
        middle = x.mean(axis=1)
        arms = norms_of(x - middle[:, None])
        area = body.areas[facets] * (1 - 1e-9)
        bends = bends_of(body.dim, arms, area)
        reach = norms_of(plates.centres[of] - middle)
        reach = reach + 16 * U * np.abs(x).max(axis=(1, 2), initial=0.0)
        force = size + off[0]
        return upwards(force + (turn + off[1] + force * reach) * bends * (1 + 1e-9))

    def _put(self, body: Body, sides: Longs, vertices: Longs, tractions: Balls) -> None:
        """Add to the cells the negative of tractions times area on sides."""
        d = body.dim
        cells = sides // (d + 1)
        mid = -tractions.mid
        mapped = self.mapped(cells, mid, tractions.distances())
        np.add.at(self.on_sides, cells, mapped.max(axis=1, initial=0.0))
        means = (np.eye(d) + 1) / (d * (d + 1))  # mean products of barycentric coordinates
        arms = body.vertices[vertices] - self.middles[cells][:, None]
        spread = np.einsum("ab,fbi->fai", means, mid)
        turns = moments(arms.reshape(-1, d), spread.reshape(-1, d))
        np.add.at(self.forces, cells, mid.mean(axis=1))
        np.add.at(self.moments, cells, turns.reshape(len(cells), d, 2 * d - 3).sum(axis=1))
        size = norms_of(tractions.size).mean(axis=1)
        off = tractions.distances().mean(axis=1)
        off += 32 * U * size
        np.add.at(self.errors[0], cells, off)
        far = self.extents[cells] + np.abs(body.vertices[vertices]).max(axis=(1, 2)) * 4 * U
        np.add.at(self.errors[1], cells, off * far + size * 32 * U * far)


def bends_of(dim: int, arms: Floats, area: Floats) -> Floats:
    """Return upper bounds on the tractions times area by which facets transfer a unit moment.

    Args:
        dim: Dimension of the bodies.
        arms: Distances of the facets' vertices from the facets' middles, shape (n, dim).
        area: Areas of the facets, bounded from below.
    """
    if dim == 2:
        return np.asarray(6 / area)
    return np.asarray(9 * arms.max(axis=1, initial=0.0) * (arms**2).sum(axis=1) / area**2)


def _passed(body: Body, acting: _Acting, pushed: Floats, zeros: Longs) -> Floats | None:
    """Return upper bounds on |B⁻¹T| of tractions times area that cells' facets transfer, summed.

    Return None if some cell has no facet that can transfer tractions. A traction that is
    zero at one end of a facet of length L is quadratic. For a force F and a moment M, its Bernstein
    coefficients times L are 0, 3F − 12M/L and 12M/L.

    Args:
        body: The bodies.
        acting: Forces and moments of each cell.
        pushed: Sizes of additional forces on the outer facets of each cell, summed.
        zeros: Number of vertices of each side at which tractions are zero.
    """
    d, wide, count = body.dim, body.dim + 1, len(body.cells)
    across = np.where(zeros < d, across_of(body), -1)
    times = np.where(zeros > 0, 3.0, 1.0)
    levels, back = tree_of(body, across, acting.volumes, acting.pieces)
    x, found = body.vertices[body.cells], np.zeros(count)
    forces, turns = acting.forces.copy(), acting.moments.copy()
    force_errors, turn_errors = acting.errors.copy()
    force_errors += pushed
    turn_errors += pushed * acting.extents
    sizes = norms_of(forces) + force_errors  # sums of magnitudes
    away = np.flatnonzero(back >= 0)
    ends = np.take_along_axis(x[away], body.corners[back[away] % wide][..., None], axis=1)
    middles = acting.middles.copy()  # middles of facets towards the root
    middles[away] = ends.mean(axis=1)
    vectors = body.shapes.areas[away, back[away] % wide]
    least = np.linalg.norm(vectors.mid, axis=1) - 2 * np.linalg.norm(vectors.rad, axis=1)
    area = np.maximum(least * (1 - 1e-12), np.finfo(float).tiny)
    # In 2D, the tractions of a moment are normal to the facet; in 3D they have any direction.
    normals, tilts = np.zeros((count, d)), np.ones(count)  # unit normals, and their errors
    if d == 2:
        normals[away], tilts[away] = vectors.mid / area[:, None], vectors.distances() / area + 8 * U
    bends = np.zeros(count)  # traction times area for a unit moment, then for the moment itself
    arms = norms_of(ends - middles[away][:, None])
    bends[away] = bends_of(d, arms, area)
    shift = acting.middles - middles
    rounded = 32 * U * np.abs(x).max(axis=(1, 2))
    for cells in levels[:0:-1]:
        towards = across[back[cells]] // wide
        # moments about the middle of the facet towards the root
        turns[cells] += moments(shift[cells], forces[cells])
        force_errors[cells] += 8 * U * sizes[cells]
        force = norms_of(forces[cells]) + force_errors[cells]
        arm = norms_of(shift[cells]) + rounded[cells]
        turn_errors[cells] += force_errors[cells] * arm + rounded[cells] * sizes[cells]
        turn = norms_of(turns[cells])
        turn_errors[cells] += 32 * U * (turn + force * arm)
        bends[cells] *= turn + turn_errors[cells]
        step = middles[cells] - acting.middles[towards]
        arm = norms_of(step) + rounded[cells] + rounded[towards]
        np.add.at(sizes, towards, sizes[cells])
        np.add.at(forces, towards, forces[cells])
        np.add.at(force_errors, towards, force_errors[cells])
        np.add.at(turns, towards, turns[cells] + moments(step, forces[cells]))
        added = turn_errors[cells] + force_errors[cells] * arm
        added += (rounded[cells] + rounded[towards]) * force + 32 * U * (turn + force * arm)
        np.add.at(turn_errors, towards, added)
    if sum(map(len, levels)) < count:
        return None
    by = bends[away, None] * normals[away]
    for side in (away, across[back[away]] // wide):
        passed = acting.mapped(side, forces[away], force_errors[away])
        passed += acting.mapped(side, by, bends[away] * tilts[away])
        np.add.at(found, side, times[back[away]] * passed)
    # All terms are non-negative. Each term is rounded at most once in each cell on the way to the
    # root.
    return upwards(found * (1 + 1e-12), 2 * count + 64)


def _reactions(
    body: Body, left: Remainder, acting: _Acting, plates: Plates
) -> tuple[Floats | None, str | None]:
    """Return upper bounds on the additional forces of supports, contact and plates on facets.

    Args:
        body: The bodies.
        left: The unbalanced forces.
        acting: The unbalanced forces of each cell.
        plates: Rigid surfaces.

    Returns:
        The bounds and None, or None and the reason why no such forces are known.
    """
    d, pieces, anchors = body.dim, acting.pieces, left.anchors
    count = int(pieces.max()) + 1
    of_facets = pieces[body.outer // (d + 1)]
    about = _middles(body, pieces, count)
    missing, errors = _missing(body, acting, about)
    # If nothing acts on a piece along an axis, the piece's unbalanced forces along this axis
    # cancel.
    idle = np.zeros((count, 3 * (d - 1)), dtype=bool)
    idle[:, :d] = True
    outside = plates.acts_on(body, left.acts)
    for of, acts in ((of_facets, outside), (pieces, left.pulls)):
        np.logical_and.at(idle[:, :d], of, ~acts)
    missing[idle], errors[idle] = 0.0, 0.0
    columns = len(anchors.facets) + len(plates.first)
    if missing.size * columns > MOST_NUMBERS:
        return None, "there are too many bodies and supports"
    parts = _matrix(body, anchors, of_facets, about), _of_plates(body, plates, of_facets, about)
    mid, rad = (np.concatenate(both, axis=2) for both in zip(*parts, strict=True))
    first = np.append(anchors.facets, plates.first)
    second = np.append(anchors.opposite, plates.second)
    most = np.append(anchors.most, np.full(len(plates.first), np.inf))
    weights = weights_of(body, first, most)

    def push(forces: Floats) -> tuple[Floats, Floats]:
        """Return the forces that remain unbalanced with additional ``forces``, and errors."""
        acting.push(body, anchors, forces[: len(anchors.facets)])
        values = plates.wrenches() * forces[len(anchors.facets) :, None]
        for facets, sign in ((plates.first, 1.0), (plates.second, -1.0)):
            acting.carry(body, plates, (facets, plates.plate), (sign * values, 0 * values))
        return _missing(body, acting, about)

    rows = mid.reshape(missing.size, columns), rad.reshape(missing.size, columns)
    exerted, reason = exerted_of(rows, (weights, most), (missing, errors), push)
    if exerted is None:
        return None, reason
    found = np.zeros(len(body.facets))
    own = slice(len(anchors.facets), None)
    for facets in (first, second):
        there = facets >= 0
        sizes = exerted.copy()
        sizes[own] = acting.through(body, plates, np.maximum(facets[own], 0), exerted[own])
        np.add.at(found, facets[there], sizes[there])
    return upwards(found * (1 + 1e-9), columns), None


def exerted_of(
    rows: tuple[Floats, Floats],
    limits: tuple[Floats, Floats],
    without: tuple[Floats, Floats],
    push: Callable[[Floats], tuple[Floats, Floats]],
) -> tuple[Floats | None, str | None]:
    """Return upper bounds on additional forces that restore balance.

    Args:
        rows: Forces and moments that each unit force causes on the pieces, and their errors, shape
            (num_rows, num_forces).
        limits: Weights of the forces, and their largest admissible sizes.
        without: Unbalanced forces on pieces without the additional forces, and their errors.
        push: Function that applies forces and returns the forces that remain unbalanced.

    Returns:
        The bounds and None, or None and the reason why no such forces are known.
    """
    (mid, rad), (weights, most), (missing, errors) = rows, limits, without
    columns = mid.shape[1]
    if not (np.isfinite(missing).all() and np.isfinite(errors).all()):
        return None, TOO_LARGE
    active = (np.abs(missing) + errors > 0).ravel()
    if not active.any():
        return np.zeros(columns), None
    if not columns:
        return None, HELD
    # All rows outside ``kept`` belong to bodies or directions on which nothing acts.
    kept = _closed(active, (mid != 0) | (rad > 0))
    mid, rad = (part[kept] * weights for part in (mid, rad))
    # Contact near slip can exert only small forces, but supports can exert large forces. Therefore
    # rows are scaled to similar sizes by powers of 2, which causes no rounding error.
    size = norms_of(mid)
    scale = 2.0 ** -np.round(np.log2(np.where(size > 0, size, 1.0)))
    mid, rad = mid * scale[:, None], rad * scale[:, None]
    gram = mid @ mid.T
    size = np.abs(mid)
    error = size @ rad.T + rad @ size.T + rad @ rad.T + (columns + 16) * U * (size @ size.T)
    try:
        inverse = np.linalg.inv(gram)
    except np.linalg.LinAlgError:
        return None, HELD
    n = len(gram)
    rest = np.abs(np.eye(n) - inverse @ gram) + np.abs(inverse) @ (
        error + (n + 2) * U * np.abs(gram)
    )
    off_one = float(upwards(rest, columns).sum(axis=1).max(initial=0.0))
    if not off_one < 0.5:
        return None, HELD
    first = -weights * (mid.T @ (inverse @ (missing.ravel()[kept] * scale)))
    missing, errors = push(first)
    needed = np.abs(inverse) @ ((np.abs(missing) + errors).ravel()[kept] * scale)
    needed = needed + 2 * off_one * needed.max(initial=0.0)
    forces = upwards(weights * ((size + rad).T @ needed), columns + n)
    if (upwards(np.abs(first) + forces) > most).any():
        return None, HELD
    return np.asarray(forces), None


TOO_LARGE = "numbers are too large, or not finite"

HELD = "neither supports nor contact pressure can balance the residual forces on a body"


def _closed(rows: Flags, touched: Flags) -> Flags:
    """Return flags of rows that forces couple to the given rows, directly or through other rows."""
    while True:
        more = touched[:, touched[rows].any(axis=0)].any(axis=1) | rows
        if (more == rows).all():
            return np.asarray(rows)
        rows = more


def weights_of(body: Body, facets: Longs, most: Floats) -> Floats:
    """Return a weight of each force: the force that its facet's cell bears, at most ``most``.

    Args:
        body: The bodies.
        facets: The facet of each force.
        most: The largest admissible sizes of the forces.
    """
    cells = body.outer // (body.dim + 1)
    radii = body.yield_radius[cells][facets]
    bears = np.isfinite(radii) & (radii > 0)  # 0 without cohesion
    radii = np.where(bears, radii, radii[bears].max(initial=0.0) or 1.0)
    return np.minimum(radii * body.areas[facets], most)


def _middles(body: Body, pieces: Longs, count: int) -> tuple[Floats, Floats]:
    """Return the centre of each piece's bounding box, and the box's longest edge."""
    x = body.vertices[body.cells]
    least, most = np.full((count, body.dim), np.inf), np.full((count, body.dim), -np.inf)
    np.minimum.at(least, pieces, x.min(axis=1))
    np.maximum.at(most, pieces, x.max(axis=1))
    return (least + most) / 2, (most - least).max(axis=1)


def _missing(body: Body, acting: _Acting, about: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Return each piece's unbalanced force and moment over extent, and errors, (count, 3 or 6)."""
    d, pieces, count = body.dim, acting.pieces, len(about[1])
    arms = acting.middles - about[0][pieces]
    turns = acting.moments + moments(arms, acting.forces)
    forces, turning = np.zeros((count, d)), np.zeros((count, 2 * d - 3))
    np.add.at(forces, pieces, acting.forces)
    np.add.at(turning, pieces, turns)
    size = norms_of(acting.forces)
    reach = norms_of(arms) + acting.extents
    rounded = 4 * U * (np.bincount(pieces).max() + 16)
    far = 16 * U * np.abs(body.vertices[body.cells]).max(axis=(1, 2))
    off = acting.errors[0] + rounded * size
    sizes = size * reach + norms_of(acting.moments)
    turned_off = acting.errors[1] + acting.errors[0] * reach + rounded * sizes + far * size
    errors = np.zeros((count, 3 * (d - 1)))
    errors[:, :d] = np.bincount(pieces, weights=off, minlength=count)[:, None]
    errors[:, d:] = np.bincount(pieces, weights=turned_off, minlength=count)[:, None]
    mid = np.hstack([forces, turning])
    errors += 4 * U * np.abs(mid)
    errors[:, d:] /= about[1][:, None]
    mid[:, d:] /= about[1][:, None]
    return mid, upwards(errors, 2 * len(pieces) + 64)


def _of_plates(
    body: Body, plates: Plates, of_facets: Longs, about: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return the forces and moments of plates on pieces, in the form of :func:`_matrix`."""
    d, count = body.dim, len(about[1])
    wrenches, columns = plates.wrenches(), np.arange(len(plates.first))
    mid, rad = np.zeros((2, count, wrenches.shape[1], len(columns)))
    for facets, sign in ((plates.first, 1.0), (plates.second, -1.0)):
        at = np.flatnonzero(facets >= 0)
        of, plate = of_facets[facets[at]], plates.plate[at]
        extents = about[1][of, None]
        forces = wrenches[at, :d]
        arms = plates.centres[plate] - about[0][of]
        turns = wrenches[at, d:] * plates.extents[plate, None]
        turns = (turns + moments(arms, forces)) / extents
        mid[of, :, columns[at]] += sign * np.hstack([forces, turns])
        far = np.abs(plates.centres[plate]).max(axis=1) + np.abs(about[0][of]).max(axis=1)
        lost = 16 * U * far[:, None] / extents + 16 * U * np.abs(turns)
        rad[of, d:, columns[at]] += lost
    return mid, rad


def _matrix(
    body: Body, anchors: Anchors, of_facets: Longs, about: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return forces and moments of unit anchor forces on pieces, and errors, (count, 3 or 6, n)."""
    d, count, columns = body.dim, len(about[1]), len(anchors.facets)
    rows = d + 2 * d - 3
    mid, rad = np.zeros((2, count, rows, columns))
    for facets, corners, sign in (
        (anchors.facets, anchors.corners, 1.0),
        (anchors.opposite, anchors.opposite_corners, -1.0),
    ):
        at = np.flatnonzero(facets >= 0)
        of, numbers = of_facets[facets[at]], body.facets[facets[at]]
        x = Balls.exact(body.vertices[numbers]) - Balls.exact(about[0][of][:, None])
        # Means of products of barycentric coordinates are (1 + δ)/(d(d + 1)).
        arms = x.sum(axis=1) + x[np.arange(len(at)), corners[at]]
        arms = arms * Balls.exact(1 / about[1][of])[:, None] * Balls.part(d * (d + 1))
        force = anchors.along[at]
        turns = crossed(arms, force)
        for part, here in ((force * Balls.part(d), slice(0, d)), (turns, slice(d, rows))):
            mid[of, here, at] += sign * part.mid
            rad[of, here, at] += part.rad + np.abs(part.low)
    return mid, upwards(rad + U * np.abs(mid))
