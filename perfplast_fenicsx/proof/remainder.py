"""Compute the unbalanced forces of a stress, with bounds on the rounding errors.

The forces on a cell are forces per volume times the volume, and tractions at the vertices of its
facets times their areas. The geometry of the cell is computed exactly from the stored coordinates.
Supports and contact exert forces on outer facets. The module chooses these forces so that the
residual is small:

- A support exerts the traction of the stress along its held directions.
- Contact exerts q ≥ 0 times the normal of the pair's first facet. With friction, contact also
  exerts a shear traction of at most c + μq. The opposite tractions act on the other side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balls import (
    Balls,
    U,
    contracted,
    put,
    stacked,
)
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.touching import Touching, obstacles_of, touching

UNIT = 4e-12
"""Four times the largest error of the length of unit vectors in a file."""


@dataclass(frozen=True)
class Anchors:
    """Additional tractions that supports and contact can exert.

    Each traction is linear on its facet, and zero at all vertices but one.

    Attributes:
        facets: The facet of each traction, shape (n,).
        corners: Index in the facet of the vertex with nonzero traction.
        opposite: Facet on which the opposite traction acts, or −1 if no facet carries it.
        opposite_corners: Index in the opposite facet of the vertex with nonzero traction.
        along: Directions of the tractions, vectors of length about 1, shape (n, d).
        most: Largest traction times area at the vertex; ∞ if the traction is not limited.
    """

    facets: Longs
    corners: Longs
    opposite: Longs
    opposite_corners: Longs
    along: Balls
    most: Floats


@dataclass(frozen=True)
class Remainder:
    """Unbalanced forces, and the facets and cells on which forces act.

    Attributes:
        cells: Unbalanced forces per volume times the volume, shape (num_cells, d).
        inner: Jumps of tractions times area at the vertices of inner facets, sorted by vertex
            number. The jumps act on the first of the two cells; shape (num_inner, d, d).
        outer: Tractions times area on outer facets that nothing balances, shape (num_facets, d, d).
        acts: Whether any force acts on each facet along each axis, shape (num_facets, d).
        pulls: Whether any body force acts on each cell along each axis, shape (num_cells, d).
        anchors: Additional forces that can act.
        plates: Tractions times area minus load tractions times area, shape (num_facets, d, d). On
            each rigid surface, their resultant must equal the resultant of the plate's loads.
    """

    cells: Balls
    inner: Balls
    outer: Balls
    acts: Flags
    pulls: Flags
    anchors: Anchors
    plates: Balls


def remainder_of(
    body: Body,
    stress: Floats,
    kinds: Sequence[tuple[float, Loads]],
    bare: Flags | None = None,
) -> Remainder:
    """Return the remainder of a stress: its unbalanced forces.

    Args:
        body: The bodies, in 2D or 3D.
        stress: Stress (effective with a pore pressure) at the vertices of each cell.
        kinds: Loads of each kind, and their factors.
        bare: Flags of vertices of cells at which supports and contact must not exert forces, shape
            (num_cells, d + 1).
    """
    d = body.dim
    areas = body.shapes.areas
    force, pores, traction = (
        summed([(factor, getattr(of, name)) for factor, of in kinds])
        for name in ("body_force", "pore_pressure", "traction")
    )
    total = Balls.exact(stress)
    if pores.mid.any():
        total = total - pores[..., None, None] * Balls.exact(np.eye(d)[None, None])
    on_sides = contracted(total[:, None], areas[:, :, None, None])  # cell, side, vertex, axis
    pulling = force * body.shapes.volumes[:, None]
    ends = stacked([on_sides[:, k, k] for k in range(d + 1)], 1).sum(axis=1)
    sides = on_sides.each(lambda part: part.reshape(-1, d + 1, d))

    def at(numbers: Longs, places: Longs) -> Balls:
        return sides[numbers[:, None], places]

    one, other = body.sides[0].T
    jumps = at(one, _alike(body, one)) + at(other, _alike(body, other))
    own = None if bare is None else bare[(body.outer // (d + 1))[:, None], body.places]
    outer = Outer(body, at(body.outer, body.places), traction, areas, bare=own)
    return Remainder(
        pulling - ends * Balls.part(d),
        jumps,
        outer.left,
        outer.acts,
        pulling.size > 0,
        outer.anchors(),
        outer.rest,
    )


def summed(kinds: Sequence[tuple[float, Floats]]) -> Balls:
    """Return the sum of the loads times their factors."""
    found = [Balls.exact(values) * Balls.exact(factor) for factor, values in kinds if values.any()]
    if not found:
        return Balls.exact(np.zeros_like(kinds[0][1]))
    return sum(found[1:], start=found[0])


def _alike(body: Body, sides: Longs) -> Longs:
    """Return indices in the cells of the vertices of sides, sorted by vertex number."""
    d = body.dim
    cells, places = sides // (d + 1), body.corners[sides % (d + 1)]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    return np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)


class Outer:
    """Outer facets with n values on each facet: at vertices, or coefficients of quadratics.

    Attributes:
        rest: Tractions times area minus load tractions times area, shape (num_facets, n, d).
        left: Tractions times area that nothing balances.
        acting: Tractions times area that loads, supports, contact and plates exert on the facets.
    """

    def __init__(
        self,
        body: Body,
        at: Balls,
        traction: Balls,
        areas: Balls,
        radii: Floats | None = None,
        bare: Flags | None = None,
    ) -> None:
        """Choose the tractions of supports, contact and plates.

        Args:
            body: The bodies.
            at: Tractions times area from the stress, shape (num_facets, n, d).
            traction: Tractions of the loads, of the same shape.
            areas: Area vectors of the sides of cells.
            radii: In axisymmetry the coefficients of r, by which tractions are multiplied, shape
                (num_facets, n).
            bare: Flags of values at which supports and contact must not exert forces, shape
                (num_facets, n).
        """
        d = body.dim
        self._body, self._free = body, ~body.held
        self._areas = areas.each(lambda part: part.reshape(-1, d)[body.outer])
        squares = (self._areas * self._areas).sum(axis=1)
        self._sizes = squares.root()
        shape = at.mid.shape[:2]
        count = shape[0]
        self._radii = np.ones(shape) if radii is None else radii
        self._bare = np.zeros(shape, dtype=bool) if bare is None else bare.copy()
        self._into = Balls.exact(np.zeros((count, d)))
        self._pressure, self._shear = np.zeros(shape), np.zeros((*shape, d))
        self._opposite = np.full(count, -1)
        self._touches = np.zeros(count, dtype=bool)
        self._order = np.zeros(shape, dtype=np.int64)
        self._second = np.zeros(count, dtype=bool)
        self._room = np.full(shape, np.inf)  # additional force that friction allows
        self._rubs = np.zeros(count, dtype=bool)
        loads = traction * self._sizes[:, None, None]
        self.rest = at - loads
        self._exert()
        exerted = self._into[:, None] * Balls.exact(-self._pressure)[..., None]
        exerted = exerted + Balls.exact(self._shear)
        glued = np.isin(body.surface, body.rigid)[:, None, None]
        exerted = exerted.where(~glued, self.rest)
        free = self._free[:, None]
        self.left = (self.rest - exerted).where(free & ~glued)
        self.acting = (loads + exerted).where(free, at)
        self.acts = np.asarray((self.acting.size > 0).any(axis=1))

    def _exert(self) -> None:
        """Choose the tractions of supports and contact."""
        body = self._body
        extra = self._order.shape[1] - body.dim  # 1 in axisymmetry, for the edge of a facet
        for pair, c, mu in self._pairs():
            self._into = put(self._into, pair.first, self._areas[pair.first])
            self._into = put(self._into, pair.second, -self._areas[pair.first])
            order = np.column_stack([pair.order, *[np.full(len(pair.order), body.dim)] * extra])
            self._opposite[pair.first], self._order[pair.first] = pair.second, order
            self._second[pair.second] = True
            self._bare[pair.first] |= np.take_along_axis(self._bare[pair.second], order, axis=1)
            self._touches[pair.first] = self._touches[pair.second] = True
            known = self._told(pair.first)
            first = self._pushes(pair.first)
            across = np.take_along_axis(self._pushes(pair.second), order, axis=1)
            pushes = np.where(known[:, None], first, across)
            pushes = np.where((known | self._told(pair.second))[:, None], pushes, 0.0)
            self._rub(pair.first, pushes, (c, mu), (pair.second, order))
        for tag, normal, c, mu in obstacles_of(body):
            facets = body.on(tag)
            normals = Balls.exact(np.tile(normal, (len(facets), 1)))
            self._into = put(self._into, facets, normals * self._sizes[facets][:, None])
            self._touches[facets] = True
            self._rub(facets, self._pushes(facets), (c, mu), None)
        guided = np.flatnonzero(body.guided.any(axis=1))
        along = Balls.exact(body.guided[guided]) * self._sizes[guided][:, None]
        self._into = put(self._into, guided, along)
        self._pressure[guided] = self._pushes(guided)

    def _pairs(self) -> list[tuple[Touching, float, float]]:
        body = self._body
        rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
        return [
            (touching(body, one, other), float(c), float(mu))
            for one, other, (c, mu) in zip(*body.contacts.T, rubs, strict=True)
        ]

    def _told(self, facets: Longs) -> Flags:
        """Return flags of facets on which supports leave part of the contact direction free."""
        share = self._into.mid[facets] * self._free[facets]
        squares = np.einsum("fi,fi->f", share, share)
        undetermined = 1e-12
        return np.asarray(squares > undetermined * self._sizes.mid[facets] ** 2)

    def _pushes(self, facets: Longs) -> Floats:
        """Return the pressure with the smallest residual, at the vertices of facets."""
        share = self._into.mid[facets] * self._free[facets]
        squares = np.einsum("fi,fi->f", share, share)
        squares[~self._told(facets)] = np.inf
        return np.asarray(-np.einsum("fvi,fi->fv", self.rest.mid[facets], share) / squares[:, None])

    def _rub(
        self,
        facets: Longs,
        pushes: Floats,
        terms: tuple[float, float],
        pair: tuple[Longs, Longs] | None,
    ) -> None:
        """Choose the pressure on contact facets, and shear forces with friction.

        Args:
            facets: The facets.
            pushes: Pressure with the smallest residual, for each facet and vertex.
            terms: Adhesion c and friction μ.
            pair: Opposite facets, and the indices of the opposite values; None for obstacles.
        """
        pressure, shear = np.where(self._bare[facets], 0.0, np.maximum(pushes, 0.0)), None
        c, mu = terms[0] * self._radii[facets], terms[1]
        if any(terms):
            shear = self._shears(facets, pair)
            least = self._sizes.mid[facets] - self._sizes.rad[facets]
            sizes = np.linalg.norm(shear, axis=2)
            rounding = 64 * U if pair is not None else UNIT
            limit = (1 - rounding) * (c + mu * pressure) * least[:, None]
            limit[self._bare[facets]] = 0.0
            shear *= np.minimum(1.0, limit / np.where(sizes > 0, sizes, 1.0))[..., None]
            sizes = np.minimum(sizes, limit)
            # Additional pressure compensates the normal component of a rounded shear traction.
            pressure = pressure + rounding * sizes / least[:, None]
            self._shear[facets] = shear
            room = np.maximum(limit - sizes, 0.0) / (1 + mu)
            self._rubs[facets], self._room[facets] = True, room
        self._pressure[facets] = pressure
        if pair is not None:
            places = np.argsort(pair[1], axis=1)
            self._pressure[pair[0]] = np.take_along_axis(pressure, places, axis=1)
            if shear is not None:
                self._shear[pair[0]] = -np.take_along_axis(shear, places[..., None], axis=1)

    def _shears(self, facets: Longs, pair: tuple[Longs, Longs] | None) -> Floats:
        """Return the tangential tractions of the stress from a side without supports."""
        found = self._across(facets)
        if pair is not None:
            there = -np.take_along_axis(self._across(pair[0]), pair[1][..., None], axis=1)
            alone = np.asarray(self._free[facets].all(axis=1))
            found = np.where(alone[:, None, None], found, there)
        return found

    def _across(self, facets: Longs) -> Floats:
        rest, into = self.rest.mid[facets], self._into.mid[facets]
        squares = np.einsum("fi,fi->f", into, into)
        for _ in range(2):  # the second pass removes rounding errors
            along = np.einsum("fvi,fi->fv", rest, into) / squares[:, None]
            rest = rest - along[..., None] * into[:, None]
        return np.asarray(rest)

    def anchors(self) -> Anchors:
        """Return the additional forces that supports and contact can exert."""
        body, d = self._body, self._body.dim
        sizes = np.maximum(self._sizes.mid, np.finfo(float).tiny)
        unit = self._into * Balls.exact(1 / sizes)[:, None]
        wide = self._order.shape[1]
        facets, axes = np.nonzero(body.held)
        guided = np.flatnonzero(body.guided.any(axis=1))
        endless = np.where((self._radii > 0) & ~self._bare, np.inf, 0.0)
        found = [
            (facets, Balls.exact(np.eye(d)[axes]), endless[facets]),
            (guided, unit[guided], endless[guided]),
        ]
        least = self._sizes.mid - 2 * self._sizes.rad
        presses = np.maximum(self._pressure, 0.0) * least[:, None]
        # Each force gets a share of the pressure, so all forces together cause neither tension nor
        # slip.
        room = np.minimum(self._room, presses / 2) / (d + 1)
        presses_there = np.asarray((room > 0).any(axis=1))
        some = np.flatnonzero(self._touches & ~self._second & presses_there)
        found.append((some, unit[some], room[some]))
        some = some[self._rubs[some]]
        for axis in np.eye(d):
            found.append((some, Balls.exact(np.tile(axis, (len(some), 1))), room[some]))
        facets = np.repeat(np.concatenate([rows[0] for rows in found]), wide)
        corners = np.tile(np.arange(wide), len(facets) // wide)
        parts = [[getattr(rows[1], of) for rows in found] for of in ("mid", "low", "rad")]
        along = Balls(*(np.repeat(np.concatenate(part), wide, axis=0) for part in parts))
        most = np.concatenate([rows[2] for rows in found]).ravel()
        opposite = np.where(np.isinf(most), -1, self._opposite[facets])
        there = self._order[facets, corners]
        return Anchors(facets, corners, opposite, there, along, most)
