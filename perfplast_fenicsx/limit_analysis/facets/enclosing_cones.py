"""Enclose directions in cones: v·b ≤ 0 for a few b implies v·n ≤ 0 for all directions n."""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints

NARROWEST = 0.02
"""Tangent of the smallest angle of a cone, so that its directions form a basis."""


def enclosing_cones(directions: Floats, known: npt.NDArray[np.bool_]) -> tuple[Floats, Ints]:
    """Return cones of at most d directions around given ones.

    One direction, or two in a plane, are taken as they are, except if their angle is too small.
    More directions in space are enclosed by the smallest of several triangles around their ends on
    a plane.

    Args:
        directions: Directions, shape (n, most, d); zero where there is none.
        known: Flags of the existing directions, shape (n, most).

    Returns:
        Unit vectors b, shape (n, d, d), and their number, shape (n,); −1 where the given directions
        do not lie on one side of a plane.
    """
    same = 1e-9  # tangents that differ by less are equal
    widest = 0.1  # least cosine between each direction and the mean
    n, _, d = directions.shape
    sizes = np.linalg.norm(directions, axis=2)
    known = known & (sizes > same)
    units = np.where(known[..., None], directions, 0.0) / np.where(known, sizes, 1.0)[..., None]
    mean = units.sum(axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    along = np.einsum("nki,ni->nk", units, mean)
    wide = (known & (along < widest)).any(axis=1)
    flat = units / np.where(known & (along >= widest), along, 1.0)[..., None] - mean[:, None]
    flat[~known | wide[:, None]] = 0.0
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", flat, flat))
    axes = np.swapaxes(axes, 1, 2)[:, ::-1][:, : d - 1]  # the widest first
    at = np.einsum("nki,nai->nka", flat, axes)
    spread = np.abs(at).max(axis=1, initial=0.0)
    count = np.where(known.any(axis=1), 1 + (spread > same).sum(axis=1), 0)
    ends = np.zeros((n, d, d - 1))
    low, high = at[..., 0].min(axis=1, initial=0.0), at[..., 0].max(axis=1, initial=0.0)
    short = np.maximum(NARROWEST - (high - low), 0.0) / 2
    ends[:, 0, 0], ends[:, 1, 0] = low - short, high + short
    ends[count == 1] = 0.0
    if d == 3:
        of = count == 3
        ends[of] = _triangles(at[of], known[of], spread[of])
    vectors = mean[:, None] + np.einsum("nka,nai->nki", ends, axes)
    vectors /= np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-300)
    return vectors, np.where(wide, -1, count).astype(np.int32)


def _triangles(at: Floats, known: npt.NDArray[np.bool_], spread: Floats) -> Floats:
    """Return corners of triangles around points of the plane, shape (n, 3, 2)."""
    scale = np.maximum(spread, NARROWEST / 2)
    points = at / scale[:, None]
    turn = np.linspace(0.0, 2 * np.pi / 3, 24, endpoint=False)  # triangles that are tried
    angle = turn[:, None] + np.arange(3) * (2 * np.pi / 3)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=2)  # (turns, 3, 2)
    reach = np.einsum("nka,tja->ntjk", points, out)
    reach = np.where(known[:, None, None], reach, -np.inf).max(axis=3)
    best = np.argmin(reach.sum(axis=2), axis=1)
    reach, out = reach[np.arange(len(at)), best], out[best]
    short = np.maximum(1.0 - reach.sum(axis=1), 0.0) / 3
    reach += short[:, None]
    after = [1, 2, 0]
    sides = np.stack([out, out[:, after]], axis=2)
    corners: Floats = np.linalg.solve(sides, np.stack([reach, reach[:, after]], axis=2)[..., None])[
        ..., 0
    ]
    return corners * scale[:, None]
