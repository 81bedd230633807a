"""Find points on the chords of a plane surface, or next to them as on a curve.

Two polygons that approximate one curve have their vertices on it, and differ between them. A point
counts as a point of the curve next to a chord if it lies on the bulging side, within the distance
of an arc that turns as the chords do.
"""

import numpy as np
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs


def bulges(ends: Floats, every: Floats) -> Floats:
    """Return by how much chords turn into their neighbours, to either side.

    Args:
        ends: Ends of some chords, shape (n, 2, 2).
        every: Ends of all chords of the surface, shape (m, 2, 2).

    Returns:
        Sines of the larger angle by which the surface bends away from the left of a chord, and from
        the right; 0 without a bend and next to corners. Shape (n, 2).
    """
    corner = 0.6  # sine of an angle that does not approximate a curve
    found = np.zeros((len(ends), 2))
    if not len(every):
        return found
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None]
    tree = cKDTree(every.reshape(-1, 2))
    for end in (0, 1):
        here = ends[:, end]
        apart, which = tree.query(here, k=2)
        # this chord and, except at an end of the surface, the next one
        near = apart <= _off_by_rounding(lengths)[:, None]
        far = every[which // 2, 1 - which % 2] - here[:, None]
        reach = np.where(near, np.linalg.norm(far, axis=2), 1.0)
        sine = np.einsum("nki,ni->nk", far, left) / reach
        ahead = np.einsum("nki,ni->nk", far, along if end else -along) > 0
        sine = np.where(near & ahead & (np.abs(sine) < corner), sine, 0.0)
        found[:, 0] = np.maximum(found[:, 0], -sine.min(axis=1))
        found[:, 1] = np.maximum(found[:, 1], sine.max(axis=1))
    return found


def chord_points(ends: Floats, bulging: Floats, points: Floats) -> tuple[Longs, Longs, Floats]:
    """Return chords with points on or next to them, and the positions between their ends.

    Points near the ends of a chord are ignored.

    Args:
        ends: Ends of the chords, shape (n, 2, 2).
        bulging: Their :func:`bulges`, shape (n, 2); 0 for points exactly on the chords only.
        points: Points, shape (m, 2).

    Returns:
        Chords, points and positions as shares of the chord, sorted by chord and position.
    """
    nothing = np.zeros(0, dtype=np.int64)
    if not len(ends) or not len(points):
        return nothing, nothing, np.zeros(0)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    near = cKDTree(points).query_ball_point(ends.mean(axis=1), lengths / 2)
    chord = np.repeat(np.arange(len(ends)), [len(some) for some in near])
    point = np.concatenate([np.asarray(some, dtype=np.int64) for some in near])
    offset = points[point] - ends[chord, 0]
    e, length = along[chord] / lengths[chord, None], lengths[chord]
    at = np.einsum("ni,ni->n", offset, e) / length
    off = (offset[:, 1] * e[:, 0] - offset[:, 0] * e[:, 1]) / length
    # Distance from an end of a chord, relative to the chord, at which a point equals the end.
    at_end = 1e-6
    # Largest distance of an arc that turns by a chord's angle at its ends, over that angle: an
    # eighth at its middle, or a quarter if its neighbour is far shorter.
    most = 1.25 * at * (1 - at)
    left, right = bulging[chord].T * most + _off_by_rounding(np.ones(len(at)))
    good = (off <= left) & (off >= -right) & (at > at_end) & (at < 1 - at_end)
    chord, point, at = chord[good], point[good], at[good]
    order = np.lexsort((at, chord))
    chord, point, at = chord[order], point[order], at[order]
    same = (np.diff(chord, prepend=-1) == 0) & (np.diff(at, prepend=-1.0) < at_end)
    return chord[~same], point[~same], at[~same]


def farthest(every: Floats, points: Floats) -> float | None:
    """Return the distance of points from the chords of a surface (length); 0 if all lie on it.

    Args:
        every: Ends of all its chords, shape (n, 2, 2).
        points: Points, shape (m, 2).

    Returns:
        None if a point is neither on a chord nor next to one.
    """
    if not len(every) or not len(points):
        return None
    points = np.unique(points, axis=0)
    lengths = np.linalg.norm(every[:, 1] - every[:, 0], axis=1)
    away, _ = cKDTree(every.reshape(-1, 2)).query(points)
    known = away <= _off_by_rounding(lengths).min()
    known[chord_points(every, np.zeros((len(every), 2)), points)[1]] = True
    chord, point, at = chord_points(every, bulges(every, every), points)
    beside = ~known[point]
    chord, point, at = chord[beside], point[beside], at[beside]
    known[point] = True
    if not known.all():
        return None
    on_chord = every[chord, 0] + at[:, None] * (every[chord, 1] - every[chord, 0])
    return float(np.linalg.norm(points[point] - on_chord, axis=1).max(initial=0.0))


def _off_by_rounding(lengths: Floats) -> Floats:
    """Return the rounding error of a point on a chord, or at its end, by the chord's length."""
    return 1e-8 * lengths
