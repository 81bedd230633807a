"""Compute the cost of volume changes: the size of a velocity that undoes them.

A velocity v is admissible except for volume changes in cells that must preserve their volume. If a
velocity w undoes these changes, v + w is admissible, and D(ε(v + w)) ≤ D(ε(v)) + D(ε(w)), because D
is convex and homogeneous of degree 1. Therefore only the size of ∇w in each cell is needed, and the
module computes an upper bound on this size.

1. Volume leaves each cell through one facet to the next cell of a tree, and finally through an
   outlet. Outlets are free surfaces, cells whose volume may change, and contacts that separate. On
   the facets of this path, w is a bump b(x)a, which is zero at the facets' edges and has ∫b = A for
   the area A. With the area vector A n and a = n/A, the flux is 1. In both cells beside the facet,
   div w is constant.
2. The remaining div v in a cell is linear with zero mean. The part of w that undoes it is zero on
   all facets.
3. Such velocities w are continuous, and of degree d in each of the d + 1 parts into which the
   centre divides a cell (of degree 2 in 2D, D. N. Arnold, J. Qin, 1992; of degree 3 in 3D, S.
   Zhang, doi:10.1090/S0025-5718-04-01711-9). On the regular simplex with edges of length 1,
   :data:`SIZE` bounds their gradients. The map x = By onto the cell gives w = Bw'/det B. Fluxes are
   unchanged, and ∇w = B∇w'B⁻¹/det B. A bump vector a of the cell becomes det B B⁻¹a on the regular
   simplex.

In axisymmetry, r tr ε(u) = div v holds for v = ru in the section plane, so the same method applies.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, contracted, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.mechanism import Mechanism
from perfplast_fenicsx.proof.pieces import across_of, joined
from perfplast_fenicsx.proof.places import numbers_in_cell
from perfplast_fenicsx.proof.touching import obstacles_of, touching

SIZE = {2: (2.67, 16.3), 3: (4.51, 79.0)}
"""Bounds on gradients in a regular simplex, by dimension. The first factor multiplies the largest
divergence of zero mean; the second factor multiplies the length of a bump's vector a. A test
computes both factors.
"""

LOST = "volume of cells has no outlet, as at"


@dataclass(frozen=True)
class Undone:
    """Upper bounds on the size of a velocity w that undoes volume changes.

    Attributes:
        gradients: The largest ‖∇w‖ in each cell times its volume, shape (num_cells,).
        change: The largest |div w| at a vertex times the volume, shape (num_cells,).
        through: ∫|w| on outer facets, shape (num_facets,).
        reason: Reason why no such velocity is known, or None.
    """

    gradients: Floats
    change: Floats
    through: Floats
    reason: str | None


def undone(body: Body, mechanism: Mechanism, change: Balls, kinds: tuple[Flags, Flags]) -> Undone:
    """Return upper bounds on the size of a velocity that undoes volume changes.

    Args:
        body: The bodies.
        mechanism: Velocity of the bodies.
        change: div v times the volume at the vertices of cells, shape (num_cells, d + 1).
        kinds: Flags of cells that preserve their volume, and of cells that admit all rates.
    """
    d, count = body.dim, len(body.cells)
    keeps, takes = kinds
    change = change.where(keeps[:, None])
    mean = change.sum(axis=1) * Balls.part(d + 1)
    uneven = (change - mean[:, None]).size.max(axis=1)
    volumes = body.shapes.least_volumes
    largest, inverse = body.shapes.stretches, body.shapes.to_regular.norms
    of_change, of_bump = SIZE[d]
    inside = np.where(uneven != 0, of_change * largest * inverse * uneven, 0.0)
    through = np.zeros(len(body.facets))
    sizes = change.size.max(axis=1)
    if (mean.size == 0).all():
        return Undone(upwards(inside), sizes, through, None)
    ways = _Ways(body, mechanism, keeps, takes)
    fluxes, errors = ways.fluxes(-(mean.mid + mean.low), mean.rad + 2 * U * np.abs(mean.mid))
    most = np.abs(fluxes) + errors
    reason = ways.fault(fluxes, errors)
    on_sides = np.zeros(count * (d + 1))  # |flux| over the free part of the area vector
    some = np.flatnonzero((ways.out >= 0) & (most != 0))
    side = ways.out[some]
    shares = most[some] / ways.free_area[some]
    on_sides[side] += shares
    there = ways.across[side]
    inner = there >= 0
    on_sides[there[inner]] += shares[inner]
    bumps = on_sides.reshape(count, d + 1).sum(axis=1)
    with np.errstate(invalid="ignore"):
        whole = volumes + 4 * body.shapes.volumes.rad
        bumps = np.where(bumps != 0, of_bump * whole * largest * inverse**2 * bumps, 0.0)
    gradients = upwards(np.where(np.isfinite(inside + bumps), inside + bumps, np.inf), count)
    sizes = np.where(keeps, sizes, np.sqrt(d) * gradients)
    at = np.full(count * (d + 1), -1)
    at[body.outer] = np.arange(len(body.outer))
    moved = most[some] * ways.tilt[some]
    for sides in (side, there):  # outlets, and both sides of contacts through which volume passes
        facets = np.where(sides >= 0, at[sides], -1)
        np.add.at(through, facets[facets >= 0], moved[facets >= 0])
    return Undone(gradients, sizes, upwards(through), reason)


class _Ways:
    """The path along which volume leaves each cell that must preserve its volume.

    Attributes:
        out: Side through which volume leaves each cell; −1 for cells without a path, and for roots
            without an outlet.
        free_area: Length of this side's area vector after removing held components.
        tilt: Area of this side divided by ``free_area``.
        across: Opposite side of each side; −1 for outer facets.
    """

    def __init__(self, body: Body, mechanism: Mechanism, keeps: Flags, takes: Flags) -> None:
        d, wide, count = body.dim, body.dim + 1, len(body.cells)
        self._body, self._mechanism, self._keeps = body, mechanism, keeps
        self.across = across_of(body)
        areas = body.shapes.areas.mid.reshape(-1, d)
        self._sizes = np.linalg.norm(areas, axis=1)
        free = np.ones((count * wide, d), dtype=bool)
        free[body.outer] = ~body.held
        loose = np.linalg.norm(areas * free, axis=1)
        touch = np.concatenate([body.contacts.ravel(), body.obstacles])
        pressed = np.isin(body.surface, touch)
        shut = np.isin(body.surface, body.rigid) | body.guided.any(axis=1)
        shut |= np.asarray(body.on_axis) | (pressed & body.held.any(axis=1))
        cells = np.arange(count * wide) // wide
        opens = np.full(count * wide, 9)  # cost of an outlet; 9 excludes it
        least = 0.1  # smallest free part of an area vector, relative to its length
        outer = np.where(shut | (loose < least * self._sizes)[body.outer], 9, 0)
        opens[body.outer] = np.where(outer == 0, np.where(pressed, 2, 0), 9)
        opens[body.outer[_sticks(body)]] = 9
        inner = np.flatnonzero(self.across >= 0)
        beyond = self.across[inner] // wide
        grows = body.plastic.copy()
        grows[body.plastic] = body.cones.grows[body.cone[body.plastic]]
        opens[inner] = np.where(takes[beyond], 0, np.where(grows[beyond], 1, 9))
        opens[~keeps[cells]] = 9
        self._pressed = np.zeros(count * wide, dtype=bool)
        self._pressed[body.outer] = pressed
        self._links = (self.across >= 0) & keeps[cells] & keeps[self.across // wide]
        self._unlike, self._glued = np.zeros(count * wide), self._links.copy()
        self._join_contacts(shut)
        opens[self._links] = 9
        links = np.flatnonzero(self._links)
        pieces = joined(count, links // wide, self.across[links] // wide)
        self._pieces = pieces
        best = np.full(count, 9)
        np.minimum.at(best, pieces[cells], opens)
        chosen = (opens < 9) & (opens == best[pieces[cells]])
        self.out = np.full(count, -1)
        some = np.flatnonzero(chosen)
        some = some[np.lexsort([loose[some], cells[some]])]
        some = some[np.append(np.diff(cells[some]) != 0, True)[: len(some)]]
        self.out[cells[some]] = some
        roots = cells[some]
        none = np.flatnonzero(keeps & (best[pieces] == 9))
        none = none[np.lexsort([body.volumes[none], pieces[none]])]
        self._closed = none[np.append(np.diff(pieces[none]) != 0, True)[: len(none)]]
        self._levels = self._tree(np.concatenate([roots, self._closed]))
        at = np.maximum(self.out, 0)
        self.free_area = np.where(self.out >= 0, loose[at], 1.0) * (1 - 1e-12)
        self.tilt = np.where(self.out >= 0, self._sizes[at], 1.0) / self.free_area

    def _join_contacts(self, shut: Flags) -> None:
        """Let volume pass through contacts, with the same bump on both sides.

        Facets that also touch another surface stay closed, because the bump could enter it.
        Rounding makes the areas of matching facets differ, and therefore the fluxes too.
        """
        body, wide, d = self._body, self._body.dim + 1, self._body.dim
        areas = self._body.shapes.areas.mid.reshape(-1, d)
        pairs = [touching(body, one, other) for one, other in body.contacts]
        times = np.zeros(len(body.facets), dtype=np.int64)
        touched = [of for pair in pairs for of in (pair.first, pair.second)]
        for facets in (*touched, *(body.on(tag) for tag in body.obstacles)):
            np.add.at(times, facets, 1)
        shut = shut | (times > 1)
        for pair in pairs:
            open_ = ~(shut[pair.first] | shut[pair.second])
            sides = [body.outer[of[open_]] for of in (pair.first, pair.second)]
            both = self._keeps[sides[0] // wide] & self._keeps[sides[1] // wide]
            a, b = (side[both] for side in sides)
            for here, there in ((a, b), (b, a)):
                self.across[here], self._links[here] = there, True
                dots = np.einsum("fi,fi->f", areas[here], areas[there])
                self._unlike[here] = np.abs(1 + dots / self._sizes[here] ** 2) + 64 * U

    def _tree(self, roots: Longs) -> list[Longs]:
        """Build paths to the roots through large facets; return cells by distance from the roots.

        The paths are stored in ``out``.
        """
        wide = self._body.dim + 1
        seen = ~self._keeps
        seen[roots] = True
        levels = [roots]
        while len(levels[-1]):
            ways = (levels[-1][:, None] * wide + np.arange(wide)).ravel()
            there = self.across[ways[self._links[ways]]]
            there = there[~seen[there // wide]]
            there = there[np.lexsort([self._sizes[there], there // wide])]
            there = there[np.append(np.diff(there // wide) != 0, True)[: len(there)]]
            cells = there // wide
            self.out[cells], seen[cells] = there, True
            levels.append(cells)
        return levels

    def fluxes(self, needed: Floats, errors: Floats) -> tuple[Floats, Floats]:
        """Return the flux out of each cell, with the fluxes of all cells beyond, and errors."""
        wide = self._body.dim + 1
        found, off = np.where(self._keeps, needed, 0.0), np.where(self._keeps, errors, 0.0)
        sizes = np.abs(found)
        for cells in self._levels[:0:-1]:
            towards = self.across[self.out[cells]] // wide
            np.add.at(found, towards, found[cells])
            np.add.at(sizes, towards, sizes[cells])
            unlike = self._unlike[self.out[cells]] * (np.abs(found[cells]) + off[cells])
            np.add.at(off, towards, off[cells] + 8 * U * sizes[cells] + unlike)
        return found, upwards(off + 8 * U * sizes, len(found))

    def fault(self, fluxes: Floats, errors: Floats) -> str | None:
        """Return the reason why some volume has no outlet, or None.

        Contact surfaces can separate but not penetrate. If a piece has no outlet, the flux of v
        through its surface must be exactly zero, as it is if supports hold all components.
        """
        body, wide = self._body, self._body.dim + 1
        some = np.flatnonzero(self.out >= 0)
        enters = some[self._pressed[self.out[some]] & (self.across[self.out[some]] < 0)]
        lost = enters[fluxes[enters] + errors[enters] > 0]
        if len(self._closed):
            sides = np.flatnonzero(~self._glued & self._keeps[np.arange(len(self._links)) // wide])
            closed = np.isin(self._pieces[sides // wide], self._pieces[self._closed])
            sides = sides[closed]
            flux = self._through(sides)
            bad = np.unique(self._pieces[sides[flux > 0] // wide])
            lost = np.concatenate([lost, self._closed[np.isin(self._pieces[self._closed], bad)]])
        if not len(lost):
            return None
        where = body.vertices[body.cells[lost[0]]].mean(axis=0)
        return f"{LOST} ({', '.join(f'{x:.6g}' for x in where)})"

    def _through(self, sides: Longs) -> Floats:
        """Return upper bounds on the flux of v through sides times the number of coefficients."""
        body, d = self._body, self._body.dim
        of = sides_places(body, self._mechanism.places.of_cells, sides)
        v = self._mechanism.at[of].sum(axis=1)
        areas = self._body.shapes.areas.each(lambda part: part.reshape(-1, d)[sides])
        return contracted(v, areas).size


def _sticks(body: Body) -> Flags:
    """Return flags of facets that cannot separate along their normals without dissipation."""
    found = np.zeros(len(body.facets), dtype=bool)
    most = 1e6  # largest μ for which a pair may separate
    rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
    for pair, (c, mu) in zip(body.contacts, rubs, strict=True):
        found[np.isin(body.surface, pair)] |= mu > most or c > 0
    for tag, normal, c, mu in obstacles_of(body):
        facets = body.on(tag)
        along = body.normals[facets] @ normal
        across = np.linalg.norm(body.normals[facets] - along[:, None] * normal, axis=1)
        found[facets] |= ~(along > 1.1 * mu * across + 0.1) | (c > 0)
    return found


def sides_places(body: Body, of_cells: Longs, sides: Longs) -> Longs:
    """Return the indices of the coefficients on sides, shape (n, 3 or 6).

    Args:
        body: The bodies.
        of_cells: Indices of each cell's coefficients (:class:`places.Places`).
        sides: Indices of sides.
    """
    d = body.dim
    corners, number = body.corners[sides % (d + 1)], numbers_in_cell(d)
    columns = [number[corners[:, a], corners[:, b]] for a in range(d) for b in range(a, d)]
    own = of_cells[sides // (d + 1)]
    return np.take_along_axis(own, np.stack(columns, axis=1), axis=1)
