"""Check whether forces on the joints of rigid blocks prove a lower bound.

No cell of these bodies can yield.

A block is a set of cells that inner facets connect. Because a block carries any stress, only the
resultant force and moment on the block must balance. Forces act on its joints at the vertices of
facets; in 2D, they are forces per thickness. If surfaces adhere, shear tractions act too, which are
linear between vertices. λ is a lower bound on the limit load if

- the loads at λ, the forces and the tractions balance on each block;
- the forces and tractions on both sides of a contact are opposite;
- the contact forces push with p ≥ 0, and their shear force satisfies ‖f_t‖ ≤ μp;
- the adhesive tractions are tangential to the facet, with a size of at most c;
- all other forces act where supports hold the blocks.

Proof: admissible rigid motions have jumps w in the joints with w_n + μ‖w_t‖ ≤ 0. The work of the
    forces on these jumps is not negative, and the work of the tractions is at least −∫c‖w_t‖
    (static theorem, D. C. Drucker, W. Prager, H. J. Greenberg, doi:10.1090/qam/45573; for blocks,
    J. Heyman, doi:10.1016/0020-7683(66)90018-7).

The checker decomposes the stored forces into pressures and shear forces that satisfy these
conditions exactly, on the first side of each contact. A residual force and moment remain on each
block. Because the best forces are at their limits, no capacity remains for forces that balance the
residual. Therefore a file can contain a second set of forces inside the limits, for loads at
another factor. The spare capacity of a weighted mean of both sets is proportional to the weight of
the second set. The bound is the mean of both factors with the same weights.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from perfplast_fenicsx.proof.balance import HELD, MOST_NUMBERS, exerted_of
from perfplast_fenicsx.proof.balls import Balls, U, crossed, put, stacked, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.pieces import pieces_of
from perfplast_fenicsx.proof.remainder import summed
from perfplast_fenicsx.proof.touching import obstacles_of, touching

UNIT = 2e-12
"""Twice the largest error of the length of unit vectors in a file."""

Factors = tuple[float, float, float]
"""Factors of the sought loads, of constant loads and of free loads."""


@dataclass(frozen=True)
class JointForces:
    """Forces on joints, as stored in the file.

    Attributes:
        forces: Forces on the cells at the vertices of outer facets, shape (num_facets, d, d).
        tractions: Adhesive tractions (stress) at the same vertices, linear between the vertices.
        factors: Factors of the loads that these forces and tractions balance.
    """

    forces: Floats
    tractions: Floats
    factors: Factors


@dataclass(frozen=True)
class Carried:
    """The loads that rigid blocks provably carry by forces on their joints.

    Attributes:
        factor: Proven factor of the sought loads; None if nothing is proven.
        reason: Reason why nothing is proven, or None.
        left: Sum of the magnitudes of unbalanced forces, and of moments divided by extents, for the
            first set of forces.
        loads: The sum of the loads' magnitudes.
    """

    factor: float | None
    reason: str | None
    left: float
    loads: float


def carried_by(
    body: Body, best: JointForces, inner: JointForces | None, loads: Sequence[Loads]
) -> Carried:
    """Return the loads that rigid blocks provably carry by forces on their joints.

    Args:
        body: The bodies, none of which can yield.
        best: Forces with the largest factor.
        inner: Forces inside the limits; None if the file has no such forces.
        loads: Loads of each kind.
    """
    blocks = _Blocks(body, loads)
    joints = _Joints(body, blocks)
    second, loaded = best if inner is None else inner, blocks.loaded(best.factors)
    if not all(np.isfinite(of).all() for it in (best, second) for of in (it.forces, it.tractions)):
        return Carried(None, "forces on joints are not finite", np.inf, loaded)
    parts = joints.of(best), joints.of(second)
    missing, errors = joints.missing(parts[0], best.factors)
    left = float((np.abs(missing) + errors).sum())
    anchors = joints.anchors()
    if joints.reason is not None:
        return Carried(None, joints.reason, left, loaded)
    if missing.size * anchors.count > MOST_NUMBERS:
        return Carried(None, "there are too many blocks and joints", left, loaded)
    rows, size = anchors.rows(blocks), loaded or 1.0
    inside = anchors.room(joints, parts[1], size)
    for share in _shares(rows[0], missing, inside):
        pairs = zip(best.factors, second.factors, strict=True)
        sought, _, others = ((1 - share) * a + share * b for a, b in pairs)
        factors = sought, best.factors[1], others
        mixed = joints.inside(parts[0].mixed(parts[1], share))
        room = anchors.room(joints, mixed, size)
        most = np.where(anchors.is_limited, room, np.inf)
        # Forces are scaled by the capacity of the inner forces. Without this scaling, rounding
        # loses small forces beside large forces.
        weights = np.minimum(share * inside, most)

        def push(
            forces: Floats, mixed: _Parts = mixed, factors: Factors = factors
        ) -> tuple[Floats, Floats]:
            """Return the forces that remain unbalanced with additional ``forces``, and errors."""
            return joints.missing(mixed, factors, (anchors, forces))

        without = joints.missing(mixed, factors)
        if exerted_of(rows, (weights, most), without, push)[0] is not None:
            return Carried(factors[0], None, left, loaded)
    return Carried(None, HELD, left, loaded)


def _shares(rows: Floats, missing: Floats, room: Floats) -> list[float]:
    """Return the weights of the inner forces that the caller tries in turn.

    With the first weight, balance needs at most half of each capacity.

    Args:
        rows: Forces and moments that each anchor exerts on blocks, shape (num_rows, num_anchors).
        missing: Unbalanced forces without inner forces.
        room: Capacity of the inner forces.
    """
    scaled = rows * room
    size = np.linalg.norm(scaled, axis=1)
    scale = np.where(size > 0, size, 1.0)
    needed = np.linalg.lstsq(scaled / scale[:, None], missing.ravel() / scale, rcond=1e-12)[0]
    least = 1e-14 + 2 * float(np.abs(needed).max(initial=0.0))
    growing = (least * 8.0**number for number in range(16))
    return [*(share for share in growing if share < 1), 1.0]


@dataclass(frozen=True)
class _Parts:
    """Forces on joints and supports, decomposed along normals, tangents and held directions.

    Attributes:
        pressure: Non-negative pressure force at each spot, shape (num_spots,).
        shear: Coefficients of the shear force along the tangents, shape (num_spots, d − 1).
        adhesion: Coefficients of the adhesive traction along the tangents, of the same shape.
        held: Coefficients of the forces along the directions that supports hold.
    """

    pressure: Floats
    shear: Floats
    adhesion: Floats
    held: Floats

    def mixed(self, other: "_Parts", share: float) -> "_Parts":
        """Return the weighted mean with another set; ``share`` is the weight of the other set.

        The mean satisfies the conditions, apart from rounding, because the admissible sets are
        convex.
        """
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Parts(*((1 - share) * one + share * two for one, two in pairs))


class _Blocks:
    """Blocks, and the loads on them.

    Attributes:
        of_facets: The block of each outer facet.
    """

    def __init__(self, body: Body, loads: Sequence[Loads]) -> None:
        numbers = np.unique(pieces_of(body), return_inverse=True)[1].ravel()
        self._body, self._loads, self._of_cells = body, loads, numbers
        self._count = int(numbers.max()) + 1
        x, d = body.vertices[body.cells], body.dim
        least, most = np.full((self._count, d), np.inf), np.full((self._count, d), -np.inf)
        np.minimum.at(least, numbers, x.min(axis=1))
        np.maximum.at(most, numbers, x.max(axis=1))
        self._middle, self._over = (least + most) / 2, 1 / (most - least).max(axis=1)
        self.of_facets = numbers[body.outer // (d + 1)]
        self._volumes = body.shapes.volumes
        areas = body.shapes.areas.each(lambda part: part.reshape(-1, d)[body.outer])
        self.areas, self.sizes = areas, (areas * areas).sum(axis=1).root()

    def loaded(self, factors: Factors) -> float:
        """Return the sum of the magnitudes of the loads at given factors."""
        body, found = self._body, 0.0
        for factor, loads in zip(factors, self._loads, strict=True):
            pulls, pushes = loads.sizes(body.volumes, body.areas)
            found += abs(factor) * float(pulls.sum() + pushes.sum())
        return found

    def acting(self, factors: Factors) -> Balls:
        """Return the forces and moments of loads on blocks, shape (num_blocks, 3 or 6)."""
        body, d = self._body, self._body.dim
        kinds = list(zip(factors, self._loads, strict=True))
        force, traction = (
            summed([(factor, getattr(of, name)) for factor, of in kinds])
            for name in ("body_force", "traction")
        )
        x = Balls.exact(body.vertices[body.cells]).sum(axis=1) * Balls.part(d + 1)
        found = self.wrenches(self._of_cells, x, force * self._volumes[:, None])
        facets, corners = np.nonzero(traction.size.any(axis=2))
        pushes = traction[facets, corners] * self.hats(facets)[:, None]
        middles = self.middles(facets, corners)
        return found + self.wrenches(self.of_facets[facets], middles, pushes)

    def hats(self, facets: Longs) -> Balls:
        """Return the tributary area of each vertex of facets."""
        return self.sizes[facets] * Balls.part(self._body.dim)

    def middles(self, facets: Longs, corners: Longs) -> Balls:
        """Return the centres of facet tractions that are zero at all vertices but one."""
        x = Balls.exact(self._body.vertices[self._body.facets[facets]])
        return (x.sum(axis=1) + x[np.arange(len(facets)), corners]) * Balls.part(self._body.dim + 1)

    def turned(self, of: Longs, places: Balls, forces: Balls) -> Balls:
        """Return forces with their moments divided by the blocks' extents, shape (n, 3 or 6).

        Args:
            of: Block of each force.
            places: Points at which the forces act.
            forces: The forces.
        """
        arms = (places - Balls.exact(self._middle[of])) * Balls.exact(self._over[of])[:, None]
        parts = forces, crossed(arms, forces)
        return Balls(
            *(np.hstack([getattr(p, name) for p in parts]) for name in ("mid", "low", "rad"))
        )

    def wrenches(self, of: Longs, places: Balls, forces: Balls) -> Balls:
        """Return the resultant force and moment, divided by the extent, on each block.

        See :meth:`turned` for the arguments.
        """
        each = self.turned(of, places, forces)
        order = np.argsort(of, kind="stable")
        of, each = of[order], each[order]
        while (np.diff(of) == 0).any():  # pairwise summation within each block
            starts = np.flatnonzero(np.diff(of, prepend=-1))
            lengths = np.diff(starts, append=len(of))
            within = np.arange(len(of)) - np.repeat(starts, lengths)
            one = np.flatnonzero(within % 2 == 0)
            other = np.minimum(one + 1, len(of) - 1)
            two = (of[other] == of[one]) & (other > one)
            each, of = each[one] + each[other].where(two[:, None]), of[one]
        return put(Balls.exact(np.zeros((self._count, each.mid.shape[1]))), of, each)


class _Spots(NamedTuple):
    """Vertices of facets in contact, and the opposite vertices; all arrays of shape (num_spots,).

    Attributes:
        facets: Facet on the first side.
        corners: Index of the vertex in its facet.
        second: Opposite facet, −1 for an obstacle.
        opposite: Index of the opposite vertex in its facet.
        adhesion: Largest adhesive traction.
        friction: Coefficient of friction μ.
        rounding: Largest error of the length of the normal.
    """

    facets: Longs
    corners: Longs
    second: Longs
    opposite: Longs
    adhesion: Floats
    friction: Floats
    rounding: Floats


class _Joints:
    """Points where forces can act: spots of joints, and supports with their held directions.

    Forces at a spot act along a normal and tangents of the first side; the directions of these
    vectors have no rounding error. The opposite forces act on the second side.

    Attributes:
        reason: Reason why the conditions cannot be checked, or None.
    """

    def __init__(self, body: Body, blocks: _Blocks) -> None:
        self._body, self._blocks = body, blocks
        self.reason: str | None = None
        d, times = body.dim, np.zeros(len(body.facets), dtype=int)
        sizes = np.maximum(np.linalg.norm(blocks.areas.mid, axis=1), np.finfo(float).tiny)
        units = blocks.areas * Balls.exact(1 / sizes)[:, None]
        x = Balls.exact(body.vertices[body.facets])
        over = Balls.exact(sizes ** (-1 / (d - 1)))[:, None]
        along = stacked([(x[:, k] - x[:, 0]) * over for k in range(1, d)], 1)
        spots, normals, tangents = [], list[Balls](), list[Balls]()
        rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
        for one, other, terms in zip(*body.contacts.T, rubs, strict=True):
            pair = touching(body, one, other)
            if pair.apart:
                self.reason = (
                    f"at least {pair.apart} facets of contact have no matching opposite facet"
                )
            np.add.at(times, np.append(pair.first, pair.second), 1)
            spots.append(_spots(pair.first, (pair.second, pair.order), (*terms, 64 * U)))
            normals.append(units[spots[-1].facets])
            tangents.append(along[spots[-1].facets])
        for tag, normal, c, mu in obstacles_of(body):
            facets = body.on(tag)
            times[facets] += 1
            alone = np.full(len(facets), -1), np.tile(np.arange(d), (len(facets), 1))
            spots.append(_spots(facets, alone, (float(c), float(mu), UNIT)))
            count = len(spots[-1].facets)
            normals.append(Balls.exact(np.tile(normal, (count, 1))))
            tangents.append(Balls.exact(np.tile(_across(normal), (count, 1, 1))))
        self._spots = _Spots(*(np.concatenate(of) for of in zip(*spots, strict=True)))
        self._normal, self._tangents = _joined(normals), _joined(tangents)
        self._find_supports(times)

    def _find_supports(self, times: Longs) -> None:
        """Find the directions that supports hold, and any reason that prevents the check."""
        body = self._body
        guided = np.asarray(body.guided.any(axis=1))
        if (times > 1).any():
            self.reason = "a facet touches two others"
        if (body.held.any(axis=1) | guided)[times > 0].any():
            self.reason = "supports hold facets in contact"
        if len(body.rigid) or body.is_revolved:
            self.reason = "blocks are glued to rigid plates, or are bodies of revolution"
        facets, axes = np.nonzero(body.held)
        d = body.dim
        self._held = np.repeat(np.append(facets, np.flatnonzero(guided)), d)
        self._held_corners = np.tile(np.arange(d), len(self._held) // d)
        self._held_along = np.repeat(np.append(np.eye(d)[axes], body.guided[guided], axis=0), d, 0)

    def of(self, given: JointForces) -> _Parts:
        """Return the forces, decomposed so that they satisfy all conditions."""
        normal, tangents = self._normal.mid, self._tangents.mid
        at, along = (self._spots.facets, self._spots.corners), self._held_along
        force, traction = given.forces[at], given.tractions[at]
        pressure = np.maximum(-np.einsum("ni,ni->n", force, normal), 0.0)
        back = np.linalg.inv(np.einsum("nik,njk->nij", tangents, tangents))
        shear, adhesion = (
            np.einsum("nij,njk,nk->ni", back, tangents, of) for of in (force, traction)
        )
        held = np.einsum("ni,ni->n", given.forces[self._held, self._held_corners], along)
        parts = _Parts(pressure, shear, adhesion, held / np.einsum("ni,ni->n", along, along))
        return self.inside(parts)

    def inside(self, parts: _Parts) -> _Parts:
        """Return the decomposed forces, with shears above their limits reduced to the limits."""
        shrunk = []
        for values, limit in zip((parts.shear, parts.adhesion), self._limits(parts), strict=True):
            size = self._sizes(values)
            beyond = size > limit
            share = np.where(beyond, limit / np.where(beyond, size, 1.0) * (1 - 64 * U), 1.0)
            shrunk.append(values * share[:, None])
        shear, adhesion = shrunk
        return _Parts(parts.pressure, shear, adhesion, parts.held)

    def _sizes(self, values: Floats) -> Floats:
        """Return upper bounds on the lengths of vectors with given tangent coefficients."""
        return (self._tangents * Balls.exact(values)[..., None]).sum(axis=1).norms()

    def _limits(self, parts: _Parts) -> tuple[Floats, Floats]:
        """Return lower bounds on the admissible shear forces and adhesive tractions."""
        less = 1 - 2 * self._spots.rounding
        return self._spots.friction * parts.pressure * less, self._spots.adhesion * (1 - 4 * U)

    def rooms(self, parts: _Parts) -> tuple[Floats, Floats]:
        """Return lower bounds on the additional forces and tractions that spots can carry."""
        mu, (limit, adheres) = self._spots.friction, self._limits(parts)
        # ‖f_t‖ ≤ μp still holds if the pressure decreases and the shear increases by this force.
        beside = (limit - self._sizes(parts.shear)) / (1 + mu)
        room = np.where(mu > 0, beside, parts.pressure)
        less = 1 - 1e-9  # margin for rounding
        return (
            np.maximum(room * less, 0.0),
            np.maximum((adheres - self._sizes(parts.adhesion)) * less, 0.0),
        )

    def missing(
        self, parts: _Parts, factors: Factors, besides: tuple["_Anchors", Floats] | None = None
    ) -> tuple[Floats, Floats]:
        """Return the unbalanced forces and moments on blocks, and their errors.

        Args:
            parts: Decomposed forces on joints and supports.
            factors: Factors of the loads.
            besides: Additional anchors and their forces.
        """
        shear, adheres = (
            (self._tangents * Balls.exact(of)[..., None]).sum(axis=1)
            for of in (parts.shear, parts.adhesion)
        )
        pushes = shear - self._normal * Balls.exact(parts.pressure)[:, None]
        found = [self._blocks.acting(factors), *self._on_both(pushes, self._vertices())]
        if parts.adhesion.any():
            adheres = adheres * self._blocks.hats(self._spots.facets)[:, None]
            found += self._on_both(adheres, self._middles())
        pulls = Balls.exact(self._held_along) * Balls.exact(parts.held)[:, None]
        of = self._blocks.of_facets[self._held]
        found.append(self._blocks.wrenches(of, self._supports(), pulls))
        if besides is not None:
            found += besides[0].acting(self._blocks, besides[1])
        total = sum(found[1:], start=found[0])
        return total.mid, upwards(total.rad + np.abs(total.low))

    def _on_both(self, forces: Balls, places: tuple[Balls, Balls]) -> list[Balls]:
        """Return the contributions of forces at spots to the blocks on both sides."""
        spots, blocks = self._spots, self._blocks
        two = np.flatnonzero(spots.second >= 0)
        return [
            blocks.wrenches(blocks.of_facets[spots.facets], places[0], forces),
            blocks.wrenches(blocks.of_facets[spots.second[two]], places[1][two], -forces[two]),
        ]

    def _vertices(self) -> tuple[Balls, Balls]:
        """Return the coordinates of spots on both sides."""
        x, ends, of = self._body.vertices, self._body.facets, self._spots
        sides = (of.facets, of.corners), (of.second, of.opposite)
        one, other = (Balls.exact(x[ends[at]]) for at in sides)
        return one, other

    def _middles(self) -> tuple[Balls, Balls]:
        """Return centres of tractions that are zero at all vertices but one, for both sides."""
        of = self._spots
        one = self._blocks.middles(of.facets, of.corners)
        return one, self._blocks.middles(of.second, of.opposite)

    def _supports(self) -> Balls:
        """Return the points where supports act."""
        return Balls.exact(self._body.vertices[self._body.facets[self._held, self._held_corners]])

    def anchors(self) -> "_Anchors":
        """Return the additional forces that joints and supports can exert."""
        spots, d = self._spots, self._body.dim
        rubs, smooth, adheres = (
            np.flatnonzero(of)
            for of in (spots.friction > 0, spots.friction == 0, spots.adhesion > 0)
        )
        of_spots = self._blocks.of_facets[spots.facets]
        there = np.where(spots.second >= 0, self._blocks.of_facets[spots.second], -1)
        vertices, middles = self._vertices(), self._middles()
        share = 0.999  # share of the capacity that is used, since lengths are rounded
        found = list[tuple[int, Longs, Balls, tuple[Balls, Balls], Floats]]()
        for axis in np.eye(d):
            along = Balls.exact(np.tile(axis, (len(rubs), 1)))
            found.append((0, rubs, along, vertices, np.full(len(rubs), share / d**0.5)))
        found.append((0, smooth, self._normal[smooth], vertices, np.full(len(smooth), share)))
        for k in range(d - 1):
            along = self._tangents[adheres, k]
            size: Floats = np.asarray(share / ((d - 1) * along.norms()), dtype=np.float64)
            hats = self._blocks.hats(spots.facets[adheres])
            found.append((1, adheres, along * hats[:, None], middles, size))
        every, supports = np.arange(len(self._held)), self._supports()
        along = Balls.exact(self._held_along)
        held = self._blocks.of_facets[self._held]
        blocks = [np.column_stack([of_spots[at], there[at]]) for _, at, *_ in found]
        places = [(both[0][at], both[1][at]) for _, at, _, both, _ in found]
        return _Anchors(
            kind=np.repeat(
                [*(of[0] for of in found), 2], [*(len(of[1]) for of in found), len(every)]
            ),
            spot=np.concatenate([*(of[1] for of in found), every]),
            along=_joined([*(of[2] for of in found), along]),
            block=np.concatenate([*blocks, np.column_stack([held, np.full(len(held), -1)])]),
            places=(
                _joined([*(of[0] for of in places), supports]),
                _joined([*(of[1] for of in places), supports]),
            ),
            scale=np.concatenate([*(of[4] for of in found), np.ones(len(every))]),
        )


@dataclass(frozen=True)
class _Anchors:
    """Additional forces that joints and supports can exert.

    Attributes:
        kind: 0 for forces on joints, 1 for adhesive tractions, 2 for supports; shape (n,).
        spot: Index of the spot, or of the held direction.
        along: Forces on the first side at the coefficient 1, shape (n, d).
        block: Block on which each force acts, and block on which the opposite force acts (−1 for no
            block); shape (n, 2).
        places: Points of action on both blocks.
        scale: Share of the spot's capacity up to which each force may act; 1 for supports.
    """

    kind: Longs
    spot: Longs
    along: Balls
    block: Longs
    places: tuple[Balls, Balls]
    scale: Floats

    @property
    def count(self) -> int:
        """Return the number of forces."""
        return len(self.kind)

    @property
    def is_limited(self) -> Flags:
        """Return flags of forces whose size is limited."""
        return np.asarray(self.kind < 2)

    def room(self, joints: _Joints, parts: _Parts, size: float) -> Floats:
        """Return the largest forces that anchors can exert in addition to the forces ``parts``.

        Forces of supports have no limit. For them, the function returns the largest force at spots,
        or ``size`` if this force is zero, so that rounding loses no small numbers.
        """
        found = np.zeros(self.count)
        for kind, room in enumerate(joints.rooms(parts)):
            here = self.kind == kind
            found[here] = room[self.spot[here]] * self.scale[here]
        found[~self.is_limited] = float(found.max(initial=0.0)) or size
        return found

    def acting(self, blocks: _Blocks, forces: Floats) -> list[Balls]:
        """Return the forces and moments that anchors exert on the blocks of both sides."""
        values = self.along * Balls.exact(forces)[:, None]
        two = np.flatnonzero(self.block[:, 1] >= 0)
        return [
            blocks.wrenches(self.block[:, 0], self.places[0], values),
            blocks.wrenches(self.block[two, 1], self.places[1][two], -values[two]),
        ]

    def rows(self, blocks: _Blocks) -> tuple[Floats, Floats]:
        """Return wrenches of unit forces on blocks, and errors, shape (num_rows, num_anchors)."""
        first = blocks.turned(self.block[:, 0], self.places[0], self.along)
        second = blocks.turned(np.maximum(self.block[:, 1], 0), self.places[1], -self.along)
        wide = first.mid.shape[1]
        mid, rad = np.zeros((2, int(blocks.of_facets.max()) + 1, wide, self.count))
        for side, values in enumerate((first, second)):
            at = np.flatnonzero(self.block[:, side] >= 0)
            mid[self.block[at, side], :, at] += values.mid[at]
            rad[self.block[at, side], :, at] += values.rad[at] + np.abs(values.low[at])
        shape = (-1, self.count)
        return mid.reshape(shape), upwards(rad + U * np.abs(mid)).reshape(shape)


def _spots(
    facets: Longs, opposite: tuple[Longs, Longs], terms: tuple[float, float, float]
) -> _Spots:
    """Return spots at all vertices of facets.

    Args:
        facets: Facets of the first side.
        opposite: Opposite facets, and indices of the opposite vertices in them, shape (n, d).
        terms: Adhesion, μ, and errors of normals.
    """
    second, order = opposite
    count, d = order.shape
    each = (np.full(count * d, of) for of in terms)
    corners = np.tile(np.arange(d), count)
    return _Spots(np.repeat(facets, d), corners, np.repeat(second, d), order.ravel(), *each)


def _joined(parts: Sequence[Balls]) -> Balls:
    """Return the numbers of several arrays, concatenated."""
    names = ("mid", "low", "rad")
    return Balls(*(np.concatenate([getattr(p, of) for p in parts]) for of in names))


def _across(normal: Floats) -> Floats:
    """Return vectors perpendicular to a vector, without rounding, shape (d − 1, d)."""
    if len(normal) == 2:
        return np.array([[-normal[1], normal[0]]])
    axes = np.eye(3)[np.argsort(np.abs(normal))[:2]]
    return np.asarray(np.cross(normal, axes), dtype=np.float64)
