"""Divide straight lines in the plane where they meet, and find the faces between them.

Lines that cross, touch or overlap are cut at their common points. The module
merges points whose distance is a rounding error into the first of these points.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs

ROUNDING = 1e-9
"""Points up to this distance apart, relative to the size of all points, are merged."""


@dataclass(frozen=True)
class PlaneFace:
    """A bounded face between lines.

    Attributes:
        loops: Edges in order along its outer boundary and along the boundaries of its holes. The
            number e + 1 means edge e from its first to its second point, and -(e + 1) means edge e
            in the other direction.
        inside: Edges inside the face that do not divide it.
        point: A point inside the face, shape (2,).
        area: Area of the face without its holes.
    """

    loops: tuple[tuple[int, ...], ...]
    inside: tuple[int, ...]
    point: Floats
    area: float


@dataclass(frozen=True)
class Arrangement:
    """Edges that meet only at their ends, and the faces between them.

    Attributes:
        points: Ends of the edges, shape (num_points, 2).
        edges: Indices of the two points of each edge, shape (num_edges, 2).
        owners: Flags of the given lines that lie on each edge, shape (num_edges, num_owners).
        faces: The bounded faces.
        sides: Indices of the faces on the left and right of each edge, shape (num_edges, 2); -1 for
            the outside.
        outer: Outer loops of edges, one around each connected part.
    """

    points: Floats
    edges: Longs
    owners: npt.NDArray[np.bool_]
    faces: list[PlaneFace]
    sides: Longs
    outer: list[tuple[int, ...]]


def arrange(segments: Floats, owner: Sequence[int]) -> Arrangement:
    """Return the arrangement that straight lines form.

    Args:
        segments: Ends of the lines, shape (num_segments, 2, 2).
        owner: Index of the owner of each line, from 0.
    """
    points, edges, owners = _divided(segments, np.asarray(owner))
    loop_of, loops = _loops(points, edges)
    bridge = loop_of[:, 0] == loop_of[:, 1]
    kept = np.flatnonzero(~bridge)
    loop_of, short = _loops(points, edges[kept])
    loops = [[int(np.sign(e)) * (int(kept[abs(e) - 1]) + 1) for e in loop] for loop in short]
    corners = [_corners(edges, loop) for loop in loops]
    areas = [_area(points[loop]) for loop in corners]
    solid = [k for k, area in enumerate(areas) if area > 0]
    held: dict[int, list[int]] = {k: [] for k in solid}
    outer = []
    face_of_loop = {k: number for number, k in enumerate(solid)}
    for k, area in enumerate(areas):
        if area > 0:
            continue
        first = min(corners[k], key=lambda at: tuple(points[at]))
        around = _smallest_around(points, points[first], corners, areas, {*corners[k]})
        face_of_loop[k] = -1 if around is None else solid.index(around)
        if around is None:
            outer.append(tuple(loops[k]))
        else:
            held[around].append(k)
    sides = np.full((len(edges), 2), -1, dtype=np.int64)
    sides[kept] = np.array([face_of_loop[int(k)] for k in loop_of.ravel()]).reshape(-1, 2)
    inside: dict[int, list[int]] = {k: [] for k in solid}
    for edge in np.flatnonzero(bridge):
        middle = points[edges[edge]].mean(axis=0)
        around = _smallest_around(points, middle, corners, areas, set())
        if around is not None:
            inside[around].append(int(edge))
            sides[edge] = solid.index(around)
    faces = []
    for k in solid:
        rings = [corners[k], *(corners[hole] for hole in held[k])]
        faces.append(
            PlaneFace(
                tuple(tuple(loops[one]) for one in (k, *held[k])),
                tuple(inside[k]),
                _point_in(points, rings),
                areas[k] + sum(areas[hole] for hole in held[k]),
            )
        )
    return Arrangement(points, edges, owners, faces, sides, outer)


def within(polygon: Floats, points: Floats) -> npt.NDArray[np.bool_]:
    """Return which points lie inside a polygon, from the number of crossings of a ray.

    Args:
        polygon: Corners of the polygon in order, shape (n, 2).
        points: Points that are not on the polygon, shape (m, 2).
    """
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    x, y = points.T[..., None]
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    inside: npt.NDArray[np.bool_] = (spans & right).sum(axis=1) % 2 == 1
    return inside


def crossings(segments: Floats) -> Iterator[tuple[int, int, Floats]]:
    """Yield pairs of lines that meet but are not parallel, with their common point.

    Args:
        segments: Ends of the lines, shape (num_segments, 2, 2).
    """
    start, way = segments[:, 0], segments[:, 1] - segments[:, 0]
    lengths = np.linalg.norm(way, axis=1)
    tolerance = ROUNDING * _size(segments)
    between = start[None] - start[:, None]
    turn = way[:, None, 0] * way[None, :, 1] - way[:, None, 1] * way[None, :, 0]
    flat = np.abs(turn) <= ROUNDING * lengths[:, None] * lengths
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (between[..., 0] * way[None, :, 1] - between[..., 1] * way[None, :, 0]) / turn
    slack = tolerance / lengths[:, None]
    on = ~flat & (t >= -slack) & (t <= 1 + slack)
    for i, j in np.argwhere(np.triu(on & on.T, 1)):
        yield int(i), int(j), start[i] + t[i, j] * way[i]


def _size(segments: Floats) -> float:
    return float(np.linalg.norm(np.ptp(segments.reshape(-1, 2), axis=0)))


def _divided(segments: Floats, owner: Longs) -> tuple[Floats, Longs, npt.NDArray[np.bool_]]:
    """Return points, the edges between them, and the owners of each edge."""
    tolerance = ROUNDING * _size(segments)
    met = np.array([point for _, _, point in crossings(segments)]).reshape(-1, 2)
    points = np.concatenate([segments.reshape(-1, 2), met])
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    points = points[np.sort(first)]  # the first point of each group of merged points
    found: dict[tuple[int, int], set[int]] = {}
    starts, ways = segments[:, 0], segments[:, 1] - segments[:, 0]
    for k, own in enumerate(owner):
        start, way = starts[k], ways[k]
        length = float(np.linalg.norm(way))
        along = (points - start) @ way / length
        off = np.abs((points - start) @ (np.array([-way[1], way[0]]) / length))
        on = (off <= tolerance) & (along >= -tolerance) & (along <= length + tolerance)
        places = sorted(map(int, np.flatnonzero(on)), key=along.__getitem__)
        for a, b in pairwise(places):
            found.setdefault((min(a, b), max(a, b)), set()).add(int(own))
    edges = np.array(list(found), dtype=np.int64).reshape(-1, 2)
    owners = np.zeros((len(edges), int(owner.max(initial=-1)) + 1), dtype=bool)
    for number, all_own in enumerate(found.values()):
        owners[number, list(all_own)] = True
    return points, edges, owners


def _loops(points: Floats, edges: Longs) -> tuple[Longs, list[list[int]]]:
    """Return the loops on both sides of each edge, and the edges of each loop.

    A loop has a face on its left.

    Returns:
        Indices of the loops on the left and right of each edge, shape (num_edges, 2); and the
        signed edges of each loop.
    """
    count = len(edges)
    starts = np.concatenate([edges[:, 0], edges[:, 1]])
    ends = np.concatenate([edges[:, 1], edges[:, 0]])
    way = points[ends] - points[starts]
    angles = np.arctan2(way[:, 1], way[:, 0])
    leaving: dict[int, list[int]] = {}
    for half in np.lexsort((angles, starts)):
        leaving.setdefault(int(starts[half]), []).append(int(half))
    place = {half: (at, k) for at, some in leaving.items() for k, half in enumerate(some)}
    following = np.zeros(2 * count, dtype=np.int64)
    for half in range(2 * count):
        at, k = place[(half + count) % (2 * count)]
        following[half] = leaving[at][k - 1]
    loop_of = np.full(2 * count, -1, dtype=np.int64)
    loops: list[list[int]] = []
    for half in range(2 * count):
        if loop_of[half] >= 0:
            continue
        loop, now = [], half
        while loop_of[now] < 0:
            loop_of[now] = len(loops)
            loop.append(now + 1 if now < count else -(now - count + 1))
            now = int(following[now])
        loops.append(loop)
    return loop_of.reshape(2, count).T.copy(), loops


def _corners(edges: Longs, loop: Sequence[int]) -> list[int]:
    """Return the indices of the points on a loop in order."""
    return [int(edges[abs(e) - 1][0 if e > 0 else 1]) for e in loop]


def _area(corners: Floats) -> float:
    x, y = (corners - corners[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _smallest_around(
    points: Floats,
    point: Floats,
    corners: Sequence[list[int]],
    areas: Sequence[float],
    own: set[int],
) -> int | None:
    """Return the index of the smallest loop that contains a point and has no corner in ``own``.

    Return None if there is no such loop.
    """
    found = None
    for k, (loop, area) in enumerate(zip(corners, areas, strict=True)):
        if area <= 0 or own & {*loop} or (found is not None and area >= areas[found]):
            continue
        if within(points[loop], point[None])[0]:
            found = k
    return found


def _point_in(points: Floats, rings: Sequence[list[int]]) -> Floats:
    """Return a point inside a face, which may have holes."""
    around = rings[0]
    k = min(range(len(around)), key=lambda at: tuple(points[around[at]]))
    v, a, b = (points[around[at % len(around)]] for at in (k, k - 1, k + 1))
    others = points[[at for ring in rings for at in ring]]
    to_base = np.linalg.solve(np.column_stack([a - v, b - v]), (others - v).T)
    near = 1e-12  # this tolerance excludes the corners of the triangle
    inside = (to_base >= -near).all(axis=0) & (to_base.sum(axis=0) < 1 - near)
    inside &= to_base.sum(axis=0) > near
    if not inside.any():
        return np.asarray((a + v + b) / 3)
    nearest = others[inside][np.argmin(to_base[:, inside].sum(axis=0))]
    return np.asarray((v + nearest) / 2)
