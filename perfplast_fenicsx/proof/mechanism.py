"""Correct the stored velocity so that it is exactly admissible, except for volume changes.

The velocity is quadratic in each cell, with Bernstein coefficients at vertices and edges. It is
continuous, because neighbouring cells share these coefficients. The coefficients are corrected as
exact numbers (:class:`balls.Balls`), and all results use the corrected coefficients:

- Coefficients are zero along the directions that supports hold.
- Elastic cells that share a point, and the rigid surfaces that share points with them, move as one
  rigid body.
- In contact, each coefficient w of the jump must separate the surfaces by −w·n ≥ μ‖w_t‖. If all
  coefficients do, the surfaces separate everywhere, because Bernstein polynomials are non-negative
  and this set is a convex cone. If surfaces separate too little, points move along the normals.
  Points of deformable cells move one by one, and rigid bodies by motions that separate them from
  all bodies in contact with them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from perfplast_fenicsx.proof.balls import (
    Balls,
    contracted,
    crossed,
    inverse_of,
    put,
    stacked,
)
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.jumps import DIGITS, Jumps
from perfplast_fenicsx.proof.pieces import joined
from perfplast_fenicsx.proof.places import Places, places_of

RESTING = 1e-5
"""Largest deviation from a rigid motion, relative to the largest velocity, of cells that may count
as rigid."""

ROUNDS = 12
"""Largest number of passes over the contacts. Opening one contact may close another contact."""


@dataclass(frozen=True)
class Mechanism:
    """A velocity that is admissible except for volume changes.

    Attributes:
        places: Points of the coefficients.
        at: The coefficients, shape (num_points, d).
        motions: Velocity of each rigid surface at its ``centres``, shape (num_rigid, d).
        turns: Rotations of the rigid surfaces, shape (num_rigid, 1 or 3).
        centres: Centres of the rigid surfaces, shape (num_rigid, d).
        slip: Dissipation of slip, bounded from above.
        rigid: Whether each cell moves exactly as a rigid body.
        reason: Reason why the velocity is not admissible, or None.
    """

    places: Places
    at: Balls
    motions: Balls
    turns: Floats
    centres: Floats
    slip: float
    rigid: Flags
    reason: str | None


def mechanism_of(body: Body, v: Floats, resting: Sequence[Longs] = ()) -> Mechanism:
    """Return an admissible velocity near the stored velocity.

    Args:
        body: The bodies.
        v: Velocity at the nodes of each cell, continuous, shape (num_cells, 6 or 10, d).
        resting: Sets of plastic cells that also move as rigid bodies (:func:`resting_in`).
    """
    places, n = places_of(body), len(body.vertices)
    values = np.zeros((places.count, body.dim))
    values[places.of_cells] = v
    ends = Balls.exact(values[places.ends])
    half = Balls.exact(0.5)
    edges = Balls.exact(2 * values[n:]) - (ends[:, 0] + ends[:, 1]) * half
    at = put(Balls.exact(values), np.arange(n, places.count), edges)
    held = _held(body, places)
    at = at.where(~held)
    at = _guided(body, places, at, held)
    units = _Units(body, places, values, held, resting)
    at = units.moved(at)
    jumps = Jumps(body, places)
    if len(jumps.first):
        every = np.arange(len(body.cells))
        at = _Units(body, places, 0 * values, held, [every]).lifted(at, jumps, units)
    guided = _at_places(places, body.guided != 0)  # axes that are not across a guide
    free = ~held & ~guided & (units.of_place < 0)[:, None]
    for _ in range(ROUNDS):
        enters = jumps.enters(at)
        if not (enters > 0).any():
            break
        at = units.parted(at, jumps, enters, free)
        at = jumps.parted(at, jumps.enters(at), free)
    enters = jumps.enters(at)
    reason = jumps.reason
    if reason is None and not (enters <= 0).all():
        where = body.vertices[body.facets[jumps.facet[np.argmax(enters)]]].mean(axis=0)
        reason = "bodies penetrate each other, or separate too little for their slip"
        reason = f"{reason}, as at ({', '.join(f'{x:.6g}' for x in where)})"
    if not np.isfinite(at.size).all():
        reason = "the velocity is lost to rounding"
    motions, turns, centres = units.of_plates(body)
    unit = units.of_place[places.of_cells]
    rigid = (unit[:, 0] >= 0) & (unit == unit[:, :1]).all(axis=1)
    return Mechanism(places, at, motions, turns, centres, jumps.slip(at), rigid, reason)


def resting_in(body: Body, v: Floats) -> list[Longs]:
    """Return sets of plastic cells with a common cone that move almost as rigid bodies.

    In very strong cells, rounding errors of the velocity can cause more dissipation than all other
    cells.

    Args:
        body: The bodies.
        v: Velocity at the nodes of each cell, shape (num_cells, 6 or 10, d).
    """
    one, other = (body.sides[0] // (body.dim + 1)).T
    alike = body.cone[one] == body.cone[other]
    pieces, found = joined(len(body.cells), one[alike], other[alike]), []
    pieces = np.where(body.plastic, pieces, -1)
    order = np.argsort(pieces, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(pieces[order])) + 1):
        if pieces[cells[0]] < 0:
            continue
        x, there = body.vertices[body.cells[cells]], v[cells]
        ends = np.array(list(combinations(range(body.dim + 1), 2)))
        x = np.concatenate([x, x[:, ends].mean(axis=2)], axis=1).reshape(-1, body.dim)
        centre = x[0]
        columns = _columns(x, centre, body.is_revolved)
        if body.is_revolved:
            columns = columns[:, :, 1:2]
        size = np.abs(columns).max(axis=(0, 1))
        rows = (columns / np.where(size > 0, size, 1.0)).reshape(-1, columns.shape[2])
        motion = np.linalg.lstsq(rows, there.reshape(-1), rcond=None)[0]
        off = np.abs(rows @ motion - there.reshape(-1)).max()
        if off <= RESTING * np.abs(v).max(initial=0.0):
            found.append(cells)
    return found


def _columns(x: Floats, centre: Floats, revolved: bool) -> Floats:
    """Return velocities at points x of unit rigid motions about a centre, shape (n, d, 3 or 6).

    For bodies of revolution, the velocities are multiplied by r.
    """
    d = x.shape[1]
    shifts = [np.broadcast_to(axis, x.shape) for axis in np.eye(d)]
    turns = [_turned(axis, x - centre) for axis in np.eye(2 * d - 3)]
    every = np.stack([*shifts, *turns], axis=2)
    return every * x[:, :1, None] if revolved else every


def _held(body: Body, places: Places) -> Flags:
    """Return flags of components that supports hold; for rings, also of those on the axis."""
    held = _at_places(places, body.held)
    if body.is_revolved:
        n, on_axis = len(body.vertices), body.vertices[:, 0] == 0
        held[:n][on_axis] = True
        held[n:][on_axis[places.ends].all(axis=1)] = True
    return held


def _at_places(places: Places, flags: Flags) -> Flags:
    """Return whether any facet at a place has a flag, shape (number of places, d)."""
    found = np.zeros((places.count, flags.shape[1]), dtype=bool)
    for column in places.of_facets.T:
        np.logical_or.at(found, column, flags)
    return found


def _lines(directions: Floats) -> Floats:
    """Return directions with a positive first component that is not zero: g and −g are equal."""
    first = np.take_along_axis(directions, np.argmax(directions != 0, axis=1)[:, None], axis=1)
    return np.asarray(directions * np.sign(first))


def _guided(body: Body, places: Places, at: Balls, held: Flags) -> Balls:
    """Return the coefficients without their components along guided directions."""
    some = np.flatnonzero(body.guided.any(axis=1))
    if not len(some):
        return at
    count = places.of_facets.shape[1]
    rows = np.repeat(_lines(body.guided[some]), count, axis=0)
    numbers = places.of_facets[some].ravel()
    rows = np.unique(np.column_stack([numbers, rows]), axis=0)
    return _across(at, held, rows[:, 0].astype(np.int64), rows[:, 1:])


def _across(values: Balls, held: Flags, numbers: Longs, directions: Floats) -> Balls:
    """Return vectors without their components along given directions.

    A vector becomes zero if it has at least d directions, including axes along which it is zero.

    Args:
        values: Vectors, shape (n, d).
        held: Axes along which the vectors are zero, shape (n, d).
        numbers: Indices of the vectors that have further directions.
        directions: Unit vectors, shape (len(numbers), d), distinct for each vector.
    """
    d = held.shape[1]
    known = (directions * ~held[numbers]).any(axis=1)  # excludes directions along held axes
    numbers, directions = numbers[known], directions[known]
    order = np.argsort(numbers, kind="stable")
    some, first, counts = np.unique(numbers[order], return_index=True, return_counts=True)
    one = directions[order[first]]
    axes = held[some].sum(axis=1)
    total = counts + axes
    found = values.each(np.copy)
    alone = total == 1
    g = Balls.exact(one[alone])
    here = found[some[alone]]
    along = contracted(here, g) * inverse_of(contracted(g, g))
    found = put(found, some[alone], here - along[:, None] * g)
    several = total >= 2
    left = Balls.exact(np.zeros((int(several.sum()), d)))
    if d == 3:
        second = np.zeros_like(one)
        twice = counts >= 2
        second[twice] = directions[order[first[twice] + 1]]
        second = np.where((axes > 0)[:, None], held[some].astype(np.float64), second)
        t = crossed(Balls.exact(one[several]), Balls.exact(second[several]))
        square = contracted(t, t)
        fine = (total[several] == 2) & (square.mid > 4 * square.rad)
        square = square.where(fine, Balls.exact(np.ones(len(fine))))
        along = contracted(found[some[several]], t) * inverse_of(square)
        left = (along[:, None] * t).where(fine[:, None])
    return put(found, some[several], left)


class _Units:
    """Sets of points that move as rigid bodies.

    Attributes:
        of_place: Index of the unit of each point; −1 for points without a unit.
    """

    def __init__(
        self,
        body: Body,
        places: Places,
        values: Floats,
        held: Flags,
        resting: Sequence[Longs],
    ) -> None:
        self._body, self._places = body, places
        d, n = body.dim, len(body.vertices)
        labels = np.arange(places.count)
        groups = [places.of_cells[~body.plastic]]
        groups += [places.of_facets[body.on(tag)].reshape(1, -1) for tag in body.rigid]
        groups += [places.of_cells[cells] for cells in resting]
        _join(labels, groups)
        inside = np.zeros(places.count, dtype=bool)
        for group in groups:
            inside[group] = True
        self.of_place = np.full(places.count, -1)
        roots, self.of_place[inside] = np.unique(labels[inside], return_inverse=True)
        self._plates = [
            int(self.of_place[group[0, 0]]) for group in groups[1 : 1 + len(body.rigid)]
        ]
        self._centres, self._free = np.zeros((len(roots), d)), np.zeros((len(roots), 3 * (d - 1)))
        self._turns: Floats = np.zeros((len(roots), 2 * d - 3))
        motions = Balls.exact(np.zeros((len(roots), d)))
        guided = np.zeros(places.count, dtype=bool)
        guides = np.flatnonzero(body.guided.any(axis=1))
        guided[places.of_facets[guides]] = True
        order = np.argsort(self.of_place[:n], kind="stable")
        ends = np.searchsorted(self.of_place[:n][order], np.arange(len(roots) + 1))
        for unit in range(len(roots)):
            mine = order[ends[unit] : ends[unit + 1]]
            free, centre = self._allowed(mine, held[mine], unit)
            stuck = guided[mine].any()
            if stuck:
                free[d:] = False
            found = self._fitted(mine, values[mine], free, centre)
            self._centres[unit], self._turns[unit] = centre, found[d:]
            motion = Balls.exact(found[None, :d])
            if stuck:
                mine_too = (self.of_place[places.of_facets[guides]] == unit).any(axis=1)
                directions = np.unique(_lines(body.guided[guides[mine_too]]), axis=0)
                numbers = np.zeros(len(directions), dtype=np.int64)
                motion = _across(motion, ~free[None, :d], numbers, directions)
                free[:d] &= (directions == 0).all(axis=0)  # axes along which it may move again
            motions = put(motions, np.array([unit]), motion)
            self._free[unit] = free
        self._motions = motions

    def _allowed(self, mine: Longs, held: Flags, unit: int) -> tuple[Flags, Floats]:
        """Return flags of the free components of a unit's motion, and the centre of rotation."""
        body, d = self._body, self._body.dim
        x = body.vertices[mine]
        fixed = held.any(axis=1)
        least, centre = held[fixed], x[np.argmax(fixed)]
        free = np.ones(3 * (d - 1), dtype=bool)
        free[:d] = ~held.any(axis=0)
        turns, most = np.eye(2 * d - 3), -1
        for about in _hinges(x[fixed], least, centre):
            arms = x[fixed] - about
            may = np.array([not (_turned(turn, arms)[least] != 0).any() for turn in turns])
            if may.sum() > most:
                most, centre, free[d:] = int(may.sum()), about, may
        for number, of in enumerate(self._plates):
            if of == unit and body.rigid_held[number].any():
                free[:d] &= ~body.rigid_held[number]
                free[d:] = False
        if body.is_revolved:
            free[:] = [False, not held[x[:, 0] > 0, 1].any(), False]
        return free, centre

    def _fitted(self, mine: Longs, v: Floats, free: Flags, centre: Floats) -> Floats:
        """Return the rigid motion closest to the velocities at vertices."""
        d, x = self._body.dim, self._body.vertices[mine]
        columns = _columns(x, centre, self._body.is_revolved) * free
        size = np.abs(columns).max(axis=(0, 1), initial=0.0)
        size[size == 0] = 1.0
        rows = (columns / size).reshape(-1, 3 * (d - 1))
        found = np.linalg.lstsq(rows, v.ravel(), rcond=None)[0] / size
        return np.asarray(found * free)

    def moved(self, at: Balls) -> Balls:
        """Return the coefficients, with rigid motions at the points of rigid bodies."""
        n, some = len(self._body.vertices), self.of_place >= 0
        if not some.any():
            return at
        vertices, edges = np.flatnonzero(some[:n]), np.flatnonzero(some[n:])
        found = put(at, vertices, self._at_vertices(vertices))
        ends = found[self._places.ends[edges]]
        return put(found, n + edges, (ends[:, 0] + ends[:, 1]) * Balls.exact(0.5))

    def _at_vertices(self, vertices: Longs) -> Balls:
        """Return the velocities of vertices that belong to units."""
        x, unit = self._body.vertices[vertices], self.of_place[vertices]
        arms = Balls.exact(x) - Balls.exact(self._centres[unit])
        turns = Balls.exact(self._turns[unit])
        if self._body.dim == 2:
            turning = turns * stacked([-arms[:, 1], arms[:, 0]], 1)
        else:
            turning = crossed(turns, arms)
        found = self._motions[unit] + turning
        return found * Balls.exact(x[:, :1]) if self._body.is_revolved else found

    def moved_with(self, bodies: "_Units", motions: Floats) -> None:
        """Add the motion of each body to the units that it contains.

        Args:
            bodies: Larger sets of points, which contain these units.
            motions: Motion of each body, including rotations.
        """
        d = self._body.dim
        first = np.zeros(len(self._centres), dtype=np.int64)
        first[self.of_place[self.of_place >= 0]] = bodies.of_place[self.of_place >= 0]
        turns = motions[first, d:]
        arms = self._centres - bodies._centres[first]
        moved = motions[first, :d]
        if not self._body.is_revolved:
            moved = moved + _turned(turns, arms)
        self._motions = self._motions + Balls.exact(moved * self._free[:, :d])
        self._turns = np.asarray(self._turns + turns * self._free[:, d:])

    def lifted(self, at: Balls, jumps: "Jumps", units: "_Units") -> Balls:
        """Return the coefficients after moving whole bodies out of penetrations.

        Args:
            at: The coefficients.
            jumps: Jumps of the coefficients in contact.
            units: Rigid units, which move with the bodies that contain them.
        """
        enters = jumps.enters(at)
        motions = self._lift(at, jumps, enters, np.ones(len(enters), dtype=bool))
        if motions is None:
            return at
        d = self._body.dim
        self._motions, self._turns = Balls.exact(motions[:, :d]), np.asarray(motions[:, d:])
        units.moved_with(self, motions)
        shift = self.moved(at.each(np.zeros_like))
        return units.moved(at + shift)

    def parted(self, at: Balls, jumps: "Jumps", enters: Floats, free: Flags) -> Balls:
        """Return the coefficients after moving rigid bodies out of the remaining penetrations.

        Args:
            at: The coefficients.
            jumps: Jumps of the coefficients in contact.
            enters: Penetrations (:meth:`Jumps.enters`) of the coefficients.
            free: Flags of the components along which single points may move.
        """
        motions = self._lift(at, jumps, enters, jumps.alone(free))
        if motions is None:
            return at
        d = self._body.dim
        self._motions = self._motions + Balls.exact(motions[:, :d])
        self._turns = np.asarray(self._turns + motions[:, d:])
        return self.moved(at)

    def _lift(self, at: Balls, jumps: "Jumps", enters: Floats, some: Flags) -> Floats | None:
        """Return motions that separate selected penetrating jumps; None if none are found.

        The motions cause no penetration at jumps that nearly penetrate.
        """
        if not self._free.any():
            return None
        near = enters > -1e3 * np.max(enters, initial=0.0)
        sides = [np.where(of >= 0, self.of_place[of], -1) for of in (jumps.first, jumps.second)]
        near &= some & (sides[0] != sides[1])
        rows, at_rows = jumps.rows(np.flatnonzero(near))
        bad = enters[at_rows] > 0
        most = 10_000_000  # largest number of matrix entries in a solve
        if not bad.any() or len(rows) * self._free.size > most:
            return None
        columns = np.zeros((len(rows), *self._free.shape))
        for side, unit, sign in zip((jumps.first, jumps.second), sides, (1.0, -1.0), strict=True):
            here = np.flatnonzero(unit[at_rows] >= 0)
            of = unit[at_rows[here]]
            x = self._middles()[side[at_rows[here]]]
            every = _columns(x, self._centres[of], self._body.is_revolved)
            columns[here, of] += sign * np.einsum("ni,nik->nk", rows[here], every)
        matrix = (columns * self._free).reshape(len(rows), -1)
        size = np.abs(matrix).max(axis=0, initial=0.0)
        size[size == 0] = 1.0
        matrix = matrix / size
        motion = np.zeros(matrix.shape[1])
        for _ in range(40):
            if not (matrix @ motion > -np.where(bad, 1.0, 0.5)).any():
                break
            active = matrix @ motion > -2.0
            wanted = np.full(int(active.sum()), -1.5)
            motion = np.linalg.lstsq(matrix[active], wanted, rcond=None)[0]
        gains = -(matrix @ motion)
        if (gains < np.where(bad, 0.25, 0.0)).any():
            return None
        least = DIGITS * float(np.abs(at.mid).max(initial=0.0))
        scale = 2 * float((np.maximum(enters[at_rows], least) / gains)[bad].max())
        return np.asarray((scale * motion / size).reshape(self._free.shape) * self._free)

    def _middles(self) -> Floats:
        """Return the coordinates of vertices and of midpoints of edges."""
        x = self._body.vertices
        return np.concatenate([x, x[self._places.ends].mean(axis=1)])

    def of_plates(self, body: Body) -> tuple[Balls, Floats, Floats]:
        """Return velocities, rotations and centres of the rigid surfaces."""
        at = np.array(self._plates, dtype=np.int64)
        return self._motions[at], self._turns[at], self._centres[at]


def _hinges(x: Floats, held: Flags, first: Floats) -> Iterator[Floats]:
    """Yield points about which a body may rotate although supports hold it.

    A rotation does not move a point along a held axis if the point's arm is parallel to this axis.
    Therefore a centre c is possible if all points held along an axis i have the coordinates c_j for
    j ≠ i.

    Args:
        x: Vertices that supports hold, shape (n, d).
        held: Flags of the axes along which supports hold the vertices, of the same shape.
        first: The first point to yield.
    """
    every = []
    for j, of_first in enumerate(first):
        there = [x[held[:, i], j] for i in range(len(first)) if i != j]
        same = {float(values[0]) for values in there if len(values) and np.ptp(values) == 0}
        every.append([float(of_first), *sorted(same - {float(of_first)})])
    yield from (np.array(place) for place in product(*every))


def _join(labels: Longs, groups: Sequence[Longs]) -> None:
    """Give all indices in a row of a group the same label, in place."""
    before = None
    while before is None or (labels != before).any():
        before = labels.copy()
        for group in groups:
            if group.size:
                least = labels[group].min(axis=1)
                for column in group.T:
                    np.minimum.at(labels, column, least)
        while (labels != labels[labels]).any():
            labels[:] = labels[labels]


def _turned(turn: Floats, arms: Floats) -> Floats:
    """Return rotation × arms, shape (n, d), for one rotation or for one rotation per arm."""
    if arms.shape[1] == 2:
        return np.asarray(turn[..., :1] * np.column_stack([-arms[:, 1], arms[:, 0]]))
    return np.asarray(np.cross(turn, arms), dtype=np.float64)
