"""Define ground that a case draws by coordinates: regions, strata and lines in the plane."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError, check_magnitude, place_of
from perfplast_fenicsx.geometry.ground_outline import (
    SIDES,
    Outline,
    Shape,
    faces_inside,
    script_of,
    segments_of,
)
from perfplast_fenicsx.geometry.part_names import LEFT, RIGHT, plain_name
from perfplast_fenicsx.geometry.plane_arrangement import (
    ROUNDING,
    arrange,
    crossings,
)

NEARLY = 1e-5
"""A corner is refused if it is closer to a side than this, relative to the size of the ground, but
does not lie on the side."""


@dataclass(frozen=True)
class Region:
    """A part of the ground, or of a structure in it: a polygonal body.

    Regions A and B that share a side, or a part of a side, are glued along it. To separate them,
    give a ``[[contact]]`` between ``A_joint_1`` and ``B_joint_1``, or between the sides of a named
    ``[[line]]``.

    Args:
        name: Name of the body; lower-case letters, digits and _.
        points: Corners [x, y] in order, clockwise or counterclockwise (length).
        opening: Whether the region is cut out of the ground, as for a tunnel. The boundary of an
            opening is a surface with this name.
    """

    name: str
    points: list[list[float]]
    opening: bool = False


@dataclass(frozen=True)
class Stratum:
    """A layer of ground: a body from its top down to the top of the next stratum, or to ``bottom``.

    The case lists strata from the surface downwards. Where two tops coincide, the upper stratum has
    no thickness and is not present.

    Args:
        name: Name of the body; lower-case letters, digits and _.
        top: Upper boundary as points [x, y] from the left to the right end of the ground (length).
            At a vertical step two points have the same x.
        bottom: Lower boundary of the last stratum: a height y, or points as for the top (length).
    """

    name: str
    top: list[list[float]]
    bottom: float | list[list[float]] | None = None


@dataclass(frozen=True)
class DrawnLine:
    """A line that mesh edges follow; it can name a part of a boundary, or be a crack.

    On the boundary of the ground the line is a surface for loads, supports and contacts. Between
    regions A and B the line is a joint, whose sides are named ``A_NAME`` and ``B_NAME``. Inside one
    region the line only divides cells, unless it is a crack.

    Args:
        name: Name of the surface; lower-case letters, digits and _.
        points: Corners [x, y] of the line in order (length).
        crack: Whether the line is an open crack, on whose sides only water acts. Two regions whose
            common boundary is longer than the crack are glued outside the crack. Inside one region
            the sides are named ``NAME_left`` and ``NAME_right``, as seen from the first point of
            the line to the last.
        water: Height y of the water level in the crack (length); the water presses on both sides.
    """

    name: str
    points: list[list[float]]
    crack: bool = False
    water: float | None = None


@dataclass(frozen=True)
class DrawnGround:
    """The drawn ground, after checks of all its parts.

    Args:
        regions: The regions; at least one is required if there are no strata.
        strata: The strata, from the surface downwards.
        lines: The named lines.
        kinks: Additional lines that mesh edges follow because loads have kinks along them; parts
            outside the ground are ignored.
        notes: Remarks on the drawing, one sentence each.

    Raises:
        InputError: If names are missing or repeated; if polygons intersect themselves, have no
            area, overlap or leave gaps; if strata cross; or if lines are outside the ground.
    """

    regions: Sequence[Region] = ()
    strata: Sequence[Stratum] = ()
    lines: Sequence[DrawnLine] = ()
    kinks: Sequence[Floats] = field(default=(), compare=False)
    notes: Sequence[str] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        self._check_names()
        _check_strata(self.strata)
        shapes = self._shapes()
        chains = [points_of(line.points, f"the line '{line.name}'") for line in self.lines]
        _check_near([*((s.name, s.corners, True) for s in shapes), *self._named_chains(chains)])
        _check_apart(shapes)
        _check_lines(self, shapes)
        taken = {*(name for name, _ in self.shapes), *(line.name for line in self.lines), *SIDES}
        for line, sides in self.cracks():
            for side in {*sides} & taken:
                raise InputError(
                    f"the crack '{line.name}' has a side '{side}', but a region, stratum or line "
                    "also has this name; rename one of them."
                )

    @property
    def shapes(self) -> list[tuple[str, Floats]]:
        """Return the name and the corners, shape (num_corners, 2), of each body."""
        return [(one.name, one.corners) for one in self._shapes() if not one.opening]

    def with_kinks(self, kinks: Sequence[Floats]) -> "DrawnGround":
        """Return the same ground with ``kinks`` as the additional lines that mesh edges follow."""
        return replace(self, kinks=kinks)

    def outline(self) -> "Outline":
        """Return the outline: the ground divided by all its lines."""
        return Outline.of(self._shapes(), self._all_chains())

    def cracks(self) -> list[tuple[DrawnLine, list[str]]]:
        """Return the lines that are cracks, each with the names of its sides."""
        outline, found = self.outline(), []
        for number, line in enumerate(self.lines):
            if line.crack:
                bodies = np.unique(outline.body[outline.edges_of(number)])
                sides = [f"{outline.names[k]}_{line.name}" for k in bodies]
                if len(bodies) == 1:
                    sides = [f"{line.name}{end}" for end in (LEFT, RIGHT)]
                found.append((line, sides))
        return found

    def script(self) -> str:
        """Return a gmsh script that draws the ground and names its bodies and surfaces."""
        outline = self.outline()
        inside = {
            line.name: points_of(line.points, f"the line '{line.name}'")
            for number, line in enumerate(self.lines)
            if line.crack and len(np.unique(outline.body[outline.edges_of(number)])) == 1
        }
        return script_of(outline, [line.name for line in self.lines], inside)

    def remarks(self) -> list[str]:
        """Return remarks for the user, one sentence each."""
        outline = self.outline()
        told = [
            f"the line '{line.name}' lies inside '{outline.names[outline.body[k, 0]]}': mesh edges "
            "follow it, but it names no surface"
            for number, line in enumerate(self.lines)
            for k in np.flatnonzero(outline.plan.owners[:, outline.first_line + number])[:1]
            if outline.body[k, 0] == outline.body[k, 1] and not line.crack
        ]
        return [*self.notes, *told, *([outline.unnamed] if outline.unnamed else [])]

    def _shapes(self) -> list[Shape]:
        shapes = [
            Shape(one.name, _polygon(one.points, f"the region '{one.name}'"), one.opening)
            for one in self.regions
        ]
        tops = [points_of(one.top, f"the top of '{one.name}'") for one in self.strata]
        if self.strata:
            tops.append(_bottom(self.strata[-1], tops[0]))
        below = tops[1:]
        return shapes + [
            Shape(one.name, np.concatenate([upper, lower[::-1]]))
            for one, upper, lower in zip(self.strata, tops[:-1], below, strict=True)
        ]

    def _named_chains(self, chains: Sequence[Floats]) -> list[tuple[str, Floats, bool]]:
        named = zip(self.lines, chains, strict=True)
        return [(line.name, chain, False) for line, chain in named]

    def _all_chains(self) -> list[list[Floats]]:
        lines = [[points_of(one.points, f"the line '{one.name}'")] for one in self.lines]
        return [*lines, list(self.kinks)]

    def _check_names(self) -> None:
        bodies = [*(one.name for one in self.regions), *(one.name for one in self.strata)]
        lines = [one.name for one in self.lines]
        for name in [*bodies, *lines]:
            if not name or plain_name(name) != name or name[0].isdigit():
                better = plain_name(name) or "clay"
                better = f"r_{better}" if better[0].isdigit() else better
                raise InputError(
                    f"name = '{name}' is not a valid name of a body or surface; use lower-case "
                    f"letters, digits and _, such as '{better}'."
                )
            if [*bodies, *lines].count(name) > 1:
                raise InputError(
                    f"the name '{name}' is given {[*bodies, *lines].count(name)} times; give each "
                    "region, stratum and line a different name."
                )
        for name in bodies:
            if name in SIDES:
                raise InputError(
                    f"a body has the name '{name}', which is reserved for a side of the ground; "
                    "rename the body."
                )
        if all(one.opening for one in self.regions) and not self.strata:
            raise InputError(
                "there is no ground, because every region is an opening; draw the ground."
            )


def points_of(given: Sequence[Sequence[float]], what: str, least: int = 2) -> Floats:
    """Return checked points as an array, shape (n, 2).

    Args:
        given: Points [x, y].
        what: Name of the object with these points, for messages.
        least: Least number of points.

    Raises:
        InputError: If there are too few points, if a point is not two finite numbers, or if two
            successive points are equal.
    """
    for at in given:
        if len(at) != 2 or not np.isfinite(at).all():
            raise InputError(
                f"{what} contains {list(at)}, which is not a point; give two finite "
                "numbers, [x, y]."
            )
        for value in at:
            check_magnitude(f"a coordinate of {what}", value)
    points = np.array(given, dtype=np.float64).reshape(-1, 2)
    if len(points) < least:
        raise InputError(f"{what} has {len(points)} points; give at least {least}.")
    same = np.flatnonzero((points[1:] == points[:-1]).all(axis=1))
    if same.size:
        raise InputError(
            f"{what} contains the point {place_of(points[same[0]])} twice in a row; remove one of "
            "the two."
        )
    return points


def _polygon(given: Sequence[Sequence[float]], what: str) -> Floats:
    """Return the corners of a polygon, without the last one if it repeats the first.

    Raises:
        InputError: If the polygon intersects or touches itself, or has no area.
    """
    points = points_of(given, what, 3)
    if (points[0] == points[-1]).all():
        points = points[:-1]
    following = np.roll(points, -1, axis=0)
    segments = np.stack([points, following], axis=1)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    count = len(points)
    for i, j, place in crossings(segments):
        if j - i not in (1, count - 1):
            raise InputError(
                f"{what} crosses or touches itself at {place_of(place)}; correct its corners, or"
                " draw two regions."
            )
    x, y = (points - points[0]).T
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    if len(points) < 3 or area <= ROUNDING * size**2:
        raise InputError(
            f"{what} has no area; give at least three corners that do not lie on one line."
        )
    return points


def _bottom(last: Stratum, top: Floats) -> Floats:
    """Return the lower boundary of the last stratum."""
    if last.bottom is None:
        raise InputError(
            f"the last stratum, '{last.name}', has no bottom; give bottom as a height "
            "or a list of points."
        )
    if isinstance(last.bottom, float | int):
        level = float(last.bottom)
        return points_of([[top[0, 0], level], [top[-1, 0], level]], f"the bottom of '{last.name}'")
    return points_of(last.bottom, f"the bottom of '{last.name}'")


def _check_strata(strata: Sequence[Stratum]) -> None:
    """Raise an error for strata that are not valid or do not fit on each other.

    Raises:
        InputError: If a stratum other than the last has a bottom, if points are not ordered from
            left to right, or if strata cross, are empty or have different ends.
    """
    if not strata:
        return
    for one in strata[:-1]:
        if one.bottom is not None:
            raise InputError(
                f"the stratum '{one.name}' has a bottom, but its lower boundary is the top of the "
                f"next stratum; give bottom only for the last stratum, '{strata[-1].name}'."
            )
    named = [
        (f"the top of '{one.name}'", points_of(one.top, f"the top of '{one.name}'"))
        for one in strata
    ]
    named.append((f"the bottom of '{strata[-1].name}'", _bottom(strata[-1], named[0][1])))
    first, ends = named[0][0], named[0][1][[0, -1], 0]
    size = float(np.ptp(np.concatenate([chain for _, chain in named]), axis=0).max())
    for what, chain in named:
        back = np.flatnonzero(np.diff(chain[:, 0]) < 0)
        if back.size:
            raise InputError(
                f"{what} is not ordered from left to right between {place_of(chain[back[0]])} and "
                f"{place_of(chain[back[0] + 1])}; give its points from left to right, or draw a "
                "[[region]]."
            )
        if np.abs(chain[[0, -1], 0] - ends).max() > ROUNDING * size:
            raise InputError(
                f"{what} goes from x = {chain[0, 0]:.6g} to {chain[-1, 0]:.6g}, but {first} from "
                f"{ends[0]:.6g} to {ends[1]:.6g}; extend the shorter one to both ends of the "
                "ground: where a stratum is not present, its top follows the top of the next "
                "stratum."
            )
    for (above, upper), (below, lower) in pairwise(named):
        places = np.unique(np.concatenate([upper[:, 0], lower[:, 0]]))
        left, width = places[:-1], np.diff(places)
        thirds = left[:, None] + width[:, None] * np.array([1, 2]) / 3
        gap = np.interp(thirds, *upper.T) - np.interp(thirds, *lower.T)
        at_ends = np.stack([2 * gap[:, 0] - gap[:, 1], 2 * gap[:, 1] - gap[:, 0]], axis=1)
        worst = np.unravel_index(np.argmin(at_ends), at_ends.shape)
        if at_ends[worst] < -10 * ROUNDING * size:
            x = places[worst[0] + worst[1]]
            raise InputError(
                f"{below} is {-at_ends[worst]:.6g} above {above} at x = {x:.6g}; list the strata "
                "from the surface downwards, and do not let them cross."
            )
        if at_ends.max() <= 10 * ROUNDING * size:
            raise InputError(
                f"{above} and {below} are the same line, so the stratum between them "
                "is empty; remove it."
            )


def _check_near(chains: Sequence[tuple[str, Floats, bool]]) -> None:
    """Raise an error for a corner that is close to a side of a shape or line, but not on it.

    Args:
        chains: Name and points of each chain, and whether the chain is closed.

    Raises:
        InputError: If there is such a corner; the message has both names and the place.
    """
    size = float(np.linalg.norm(np.ptp(np.concatenate([c for _, c, _ in chains]), axis=0)))
    for name, points, _ in chains:
        for other, corners, closed in chains:
            ends = np.roll(corners, -1, axis=0)
            start, end = (corners, ends) if closed else (corners[:-1], corners[1:])
            way = end - start
            squares = np.maximum(np.einsum("si,si->s", way, way), np.finfo(float).tiny)
            shares = np.einsum("psi,si->ps", points[:, None] - start, way) / squares
            nearest = start + shares.clip(0, 1)[..., None] * way
            apart = np.linalg.norm(points[:, None] - nearest, axis=2)
            near = (apart > ROUNDING * size) & (apart < NEARLY * size)
            if near.any():
                p, s = np.argwhere(near)[0]
                whose = f"another part of '{name}'" if name == other else f"'{other}'"
                more = "" if name == other else f", or add this corner to {whose}"
                raise InputError(
                    f"'{name}' has a corner at {place_of(points[p])}, which is {apart[p, s]:.3g}"
                    f" away from {whose} at {place_of(nearest[p, s])}; give both points the"
                    f" same coordinates{more}."
                )


def _check_apart(shapes: Sequence[Shape]) -> None:
    """Raise an error for bodies that overlap, leave gaps or are completely covered by openings.

    Raises:
        InputError: If bodies overlap or leave gaps, or if openings cover a body; the message has
            the names and the area.
    """
    parts, owner = segments_of(shapes)
    plan = arrange(np.concatenate(parts), owner)
    inside = faces_inside(shapes, plan)
    opening = np.array([one.opening for one in shapes])
    for number, face in enumerate(plan.faces):
        bodies = [shapes[k].name for k in np.flatnonzero(inside[:, number] & ~opening)]
        if inside[opening, number].any():
            continue
        if len(bodies) > 1:
            raise InputError(
                f"'{bodies[0]}' and '{bodies[1]}' overlap in an area of {face.area:.4g} around "
                f"{place_of(face.point)}; let them share a side, or cut the overlap off one of "
                "them."
            )
        if not bodies:
            around = sorted({abs(e) - 1 for loop in face.loops for e in loop})
            names = [shapes[k].name for k in np.flatnonzero(plan.owners[around].any(axis=0))]
            raise InputError(
                f"there is a gap between {' and '.join(map(repr, names))}, with an area of "
                f"{face.area:.4g}, around {place_of(face.point)}; close it, or draw it as "
                "a [[region]] with opening = true."
            )
    of_shape = [
        float(sum(f.area for f, at in zip(plan.faces, row, strict=True) if at)) for row in inside
    ]
    for one, row, area in zip(shapes, inside, of_shape, strict=True):
        left = row & ~inside[opening].any(axis=0)
        if not one.opening and not left.any():
            raise InputError(
                f"openings cover the whole area {area:.4g} of '{one.name}'; remove this region or "
                "correct the openings."
            )


def _check_lines(ground: DrawnGround, shapes: Sequence[Shape]) -> None:
    """Raise an error for misplaced cracks, and lines outside the ground or of more than one kind.

    Over its whole length, a line must lie on the boundary, between regions or inside a region.

    Raises:
        InputError: If there is such a line; the message has its name and a place.
    """
    if not ground.lines:
        return
    outline = ground.outline()
    plan = outline.plan
    for number, line in enumerate(ground.lines):
        edges = np.flatnonzero(plan.owners[:, outline.first_line + number])
        body = outline.body[edges]
        kind = (body >= 0).sum(axis=1)
        middles = plan.points[plan.edges[edges]].mean(axis=1)
        if (kind == 0).any():
            raise InputError(
                f"the line '{line.name}' is outside the ground at "
                f"{place_of(middles[np.argmax(kind == 0)])}; draw it on the boundary, between "
                "regions or inside one region."
            )
        kind += (kind == 2) & (body[:, 0] == body[:, 1])
        if len(np.unique(kind)) > 1:
            kinds = (
                "",
                "on the boundary of the ground",
                "between two regions",
                "inside one region",
            )
            a, b = np.argmax(kind == kind.min()), np.argmax(kind == kind.max())
            raise InputError(
                f"the line '{line.name}' is {kinds[kind[a]]} at {place_of(middles[a])} and "
                f"{kinds[kind[b]]} at {place_of(middles[b])}; draw a separate line for each part."
            )
        if line.crack:
            _check_crack(line.name, outline, edges)


def _check_crack(name: str, outline: Outline, edges: Longs) -> None:
    """Raise an error for a crack on the ground's boundary, or in a region and touching another.

    Raises:
        InputError: If the crack is not valid; the message has its name and a place.
    """
    plan, body = outline.plan, outline.body
    place = place_of(plan.points[plan.edges[edges]].mean(axis=1)[0])
    if (body[edges] < 0).any():
        raise InputError(
            f"the crack '{name}' is on the boundary of the ground at {place}; draw it inside a "
            "region, or between two regions."
        )
    if (body[edges, 0] != body[edges, 1]).any():
        return
    own = int(body[edges[0], 0])
    here = np.unique(plan.edges[edges])
    around = np.isin(plan.edges, here)
    others = ((body >= 0) & (body != own)).any(axis=1)
    wrong = np.flatnonzero(np.any(around, axis=1) & others)
    if len(wrong):
        at = place_of(plan.points[np.intersect1d(plan.edges[wrong[0]], here)[0]])
        bodies = {*body[wrong].ravel().tolist(), own} - {-1}
        names = sorted(outline.names[k] for k in bodies)
        raise InputError(
            f"the crack '{name}' meets the boundary between {' and '.join(map(repr, names))} at "
            f"{at}; end the crack before this boundary, or draw it between two regions."
        )
