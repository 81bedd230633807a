"""Compute jumps of a velocity in contact, and move free points out of penetrations.

A jump w has Bernstein coefficients on a facet. If all coefficients satisfy w·n + μ‖w_t‖ ≤ 0, w
satisfies this condition everywhere: Bernstein polynomials are non-negative and sum to 1, and the
condition describes a convex cone. Also, ∫c‖w_t‖ is at most c times the area times the mean norm of
the tangential coefficients.
"""

from itertools import combinations

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, contracted, put
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.places import Places
from perfplast_fenicsx.proof.touching import obstacles_of, touching

FREE = 0.01
"""Smallest squared length of the free part of a unit normal for which a point is moved."""

DIGITS = 1e-28
"""Least relative speed of separation: several rounding errors of double-double numbers."""


class Jumps:
    """Coefficients of jumps in contact, with one coefficient per row.

    Attributes:
        first: Index of the point on the first surface, shape (n,).
        second: Index of the opposite point; −1 for obstacles.
        facet: The facet of each coefficient.
        reason: Reason why contact cannot be checked, or None.
    """

    def __init__(self, body: Body, places: Places) -> None:
        d, of = body.dim, places.of_facets
        self.reason: str | None = None
        areas = body.shapes.areas.each(lambda part: part.reshape(-1, d)[body.outer])
        self._areas = (areas * areas).sum(axis=1).root().size
        rows: list[tuple[Longs, Longs, Longs, Balls, float, float]] = []
        edges = list(combinations(range(d), 2))
        place = np.zeros((d, d), dtype=np.int64)
        for node, (a, b) in enumerate(edges, start=d):
            place[a, b] = node
        rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
        for one, other, (c, mu) in zip(*body.contacts.T, rubs, strict=True):
            pair = touching(body, one, other)
            if pair.apart:
                self.reason = (
                    f"at least {pair.apart} facets of contact have no matching opposite facet"
                )
            ends = np.sort(pair.order[:, edges], axis=2)
            order = np.concatenate([pair.order, place[ends[..., 0], ends[..., 1]]], axis=1)
            there = np.take_along_axis(of[pair.second], order, axis=1)
            row = (pair.first, of[pair.first], there, areas[pair.first], float(c), float(mu))
            rows.append(row)
        for tag, normal, c, mu in obstacles_of(body):
            facets = body.on(tag)
            normals = Balls.exact(np.tile(normal, (len(facets), 1)))
            places_there = np.full(of[facets].shape, -1)
            rows.append((facets, of[facets], places_there, normals, float(c), float(mu)))
        count = self._count = of.shape[1]

        none = np.zeros(0, dtype=np.int64)
        self.facet = np.repeat(np.concatenate([none, *(row[0] for row in rows)]), count)
        self.first = np.concatenate([none, *(row[1].ravel() for row in rows)])
        self.second = np.concatenate([none, *(row[2].ravel() for row in rows)])
        lengths = [len(row[0]) * count for row in rows]
        self._adhesion = np.repeat([row[4] for row in rows], lengths)
        self._friction = np.repeat([row[5] for row in rows], lengths)
        parts = [
            np.concatenate([np.zeros((0, d)), *(getattr(row[3], part) for row in rows)])
            for part in ("mid", "low", "rad")
        ]
        self._normals = Balls(*(np.repeat(part, count, axis=0) for part in parts))
        self._sizes = np.linalg.norm(self._normals.mid, axis=1)
        self._units = self._normals.mid / np.where(self._sizes > 0, self._sizes, 1.0)[:, None]

    def _of(self, at: Balls) -> Balls:
        """Return the jumps of the coefficients ``at``."""
        opposite = at[self.second].where((self.second >= 0)[:, None])
        return at[self.first] - opposite

    def enters(self, at: Balls) -> Floats:
        """Return upper bounds on w·n + μ‖w_t‖, which must be at most zero."""
        if not len(self.first):
            return np.zeros(0)
        w = self._of(at)
        along = contracted(w, self._normals)
        up = (along.mid + along.low) + 4 * U * np.abs(along.mid) + along.rad
        across = self._friction * self._slips(w) * self._sizes
        total = up + across
        total = total + 8 * U * (np.abs(up) + across) * (across > 0)
        return np.asarray(np.where(np.isfinite(total), total / self._sizes, np.inf))

    def _slips(self, w: Balls) -> Floats:
        """Return upper bounds on ‖w_t‖ for jumps w."""
        values = w.mid + w.low
        along = np.einsum("ni,ni->n", values, self._units)
        size = np.linalg.norm(values, axis=1)
        rounding = 64 * U * size + np.linalg.norm(w.rad, axis=1)
        return np.asarray(np.linalg.norm(values - along[:, None] * self._units, axis=1) + rounding)

    def slip(self, at: Balls) -> float:
        """Return an upper bound on the dissipation of slip: c times area times mean norm."""
        some = np.flatnonzero(self._adhesion > 0)
        if not len(some):
            return 0.0
        sizes = self._slips(self._of(at))[some] * self._adhesion[some]
        powers = sizes * self._areas[self.facet[some]] / self._count
        return float(powers.sum() * (1 + 8 * len(some) * U))

    def alone(self, free: Flags) -> Flags:
        """Return flags of jumps that moving a free point cannot open."""
        sides = (self._freedom(side, free) for side in (self.first, self.second))
        return np.asarray(np.maximum(*sides) < FREE)

    def rows(self, some: Longs) -> tuple[Floats, Longs]:
        """Return vectors r, and each r's jump: a jump w separates if r·w ≤ 0 for all its r.

        In 3D, an enclosing eight-sided pyramid replaces the friction cone.
        """
        n, mu = self._units[some], self._friction[some]
        if not (mu > 0).any():
            return n, some
        if n.shape[1] == 2:
            across = np.column_stack([-n[:, 1], n[:, 0]])
            sides = [n + mu[:, None] * across, n - mu[:, None] * across]
        else:
            every = np.concatenate([n[:, :, None], np.tile(np.eye(3), (len(n), 1, 1))], axis=2)
            frames = np.linalg.qr(every)[0]
            angles = np.arange(8) * np.pi / 4
            wide = mu[:, None] / np.cos(np.pi / 8)
            sides = [
                n + wide * (np.cos(a) * frames[:, :, 1] + np.sin(a) * frames[:, :, 2])
                for a in angles
            ]
        return np.concatenate(sides), np.tile(some, len(sides))

    def _freedom(self, side: Longs, free: Flags) -> Floats:
        """Return the squared length of each normal's free part at a point; 0 without a point."""
        return np.where(side >= 0, ((self._units * free[side]) ** 2).sum(axis=1), 0.0)

    def parted(self, at: Balls, enters: Floats, free: Flags) -> Balls:
        """Return the coefficients after moving free points out of penetrations.

        Args:
            at: The coefficients.
            enters: Result of :meth:`enters` for these coefficients.
            free: Flags of the components along which points may move, shape (num_points, d).
        """
        bad = enters > 0
        if not bad.any():
            return at
        here, there = self._freedom(self.first, free), self._freedom(self.second, free)
        mover = np.where(here >= there, self.first, self.second)
        sign = np.where(here >= there, -1.0, 1.0)
        movable = np.maximum(here, there) >= FREE
        count = len(free)
        worst = np.zeros(count)
        some = np.flatnonzero(bad & movable)
        np.maximum.at(worst, mover[some], enters[some])
        ways = np.zeros((count, free.shape[1]))
        for side, out in ((self.first, -1.0), (self.second, 1.0)):
            near = np.flatnonzero((side >= 0) & (enters > -1e3 * worst[side]) & (worst[side] > 0))
            np.add.at(ways, side[near], out * self._units[near] * free[side[near]])
        length = np.linalg.norm(ways, axis=1)
        ways /= np.where(length > 0, length, 1.0)[:, None]
        way = ways[mover[some]]
        along = np.einsum("ni,ni->n", way, self._units[some])
        across = np.linalg.norm(way - along[:, None] * self._units[some], axis=1)
        gains = sign[some] * along - self._friction[some] * across
        fine = gains > 1e-3
        steps = np.zeros(count)
        np.maximum.at(steps, mover[some][fine], enters[some][fine] / gains[fine])
        moved = np.flatnonzero(steps > 0)
        least = DIGITS * np.linalg.norm(at.mid[moved], axis=1)
        sizes = 2 * np.maximum(steps[moved], least)
        shift = Balls.exact(sizes[:, None] * ways[moved])
        return put(at, moved, at[moved] + shift)
