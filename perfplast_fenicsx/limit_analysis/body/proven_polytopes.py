"""Measure a polytope inside and one around a convex set of load factors, along rays from zero."""

import numpy as np
from scipy.spatial import ConvexHull

from perfplast_fenicsx.arrays import Floats


def rays_at(angles: Floats) -> Floats:
    """Return the unit vectors of directions that are given by angles.

    Args:
        angles: Angles (degrees), shape (n, 1) for two numbers and (n, 2) for three. The first angle
            is measured from the first axis towards the second, and the second angle from the plane
            of these axes towards the third axis.

    Returns:
        Shape (n, 2) or (n, 3).
    """
    turn = np.radians(np.asarray(angles, dtype=float))
    level = np.column_stack([np.cos(turn[:, 0]), np.sin(turn[:, 0])])
    if turn.shape[1] == 1:
        return level
    rise = turn[:, 1]
    return np.column_stack([level * np.cos(rise)[:, None], np.sin(rise)])


def spread(signed: tuple[bool, ...], step: float) -> Floats:
    """Return directions at equal steps of their angles.

    Args:
        signed: For each of two or three axes, whether negative numbers are allowed.
        step: Step of each angle (degrees), a divisor of 90.

    Returns:
        Angles as for :func:`rays_at`, shape (n, 1) or (n, 2), in increasing order.
    """
    first, second, *third = signed
    start = -90.0 if second and not first else 0.0
    quarters = 1 + first + second + (first and second)
    turns = start + np.arange(0.0, 90.0 * quarters + step / 2, step)
    if not third:
        return turns[:, None]
    rises = np.arange(-90.0 if third[0] else 0.0, 90.0 + step / 2, step)
    return np.stack(np.meshgrid(turns, rises, indexing="ij"), axis=-1).reshape(-1, 2)


def to_begin_with(signed: tuple[bool, ...]) -> Floats:
    """Return the first directions: along the axes, and midway between all axes.

    Args:
        signed: See :func:`spread`.

    Returns:
        Angles as for :func:`rays_at`, shape (n, 1) or (n, 2).
    """
    number = len(signed)
    ends = [(1.0, -1.0)[: 1 + two] for two in signed]
    axes = [end * np.eye(number)[i] for i in range(number) for end in ends[i]]
    middles = np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, number) / np.sqrt(number)
    rays = np.vstack([axes, middles]) + 0.0  # avoids −0, whose angle would be −180
    turns = np.degrees(np.arctan2(rays[:, 1], rays[:, 0]))
    turns = np.where(signed[0] & (turns < 0), turns + 360, turns)
    return np.column_stack([turns, *[np.degrees(np.arcsin(rays[:, i])) for i in range(2, number)]])


def outer_along(sides: Floats, rays: Floats) -> Floats:
    """Return the distances at which rays leave the common part of half-spaces; inf if they do not.

    Args:
        sides: Half-spaces n·x ≤ r with rows (n, r), shape (m, d + 1).
        rays: Rays, shape (n, d).
    """
    along = rays @ sides[:, :-1].T
    with np.errstate(divide="ignore"):
        at = np.where(along > 0, sides[:, -1] / along, np.inf)
    return at.min(axis=1, initial=np.inf)


def inner_along(points: Floats, rays: Floats) -> Floats:
    """Return the reach of the convex hull of points along rays; −inf if a ray misses the hull.

    Args:
        points: Points, shape (m, d), in any order. If all are in one plane (or on one line), only
            points on a ray count.
        rays: Rays, shape (n, d).
    """
    touches = 1e-12  # relative distance by which a ray may miss a corner because of rounding
    sizes = np.linalg.norm(points, axis=1)
    on = rays @ points.T >= sizes * (1 - touches)
    found = np.where(on, sizes, -np.inf).max(axis=1, initial=-np.inf)
    dimension = rays.shape[1]
    if len(points) <= dimension:
        return found
    flat = 1e-9 * np.ptp(points, axis=0).max()
    if np.linalg.matrix_rank(points[1:] - points[0], tol=flat) < dimension:
        return found
    faces = ConvexHull(points).equations  # outward normals n and offsets: n·x + offset ≤ 0
    along, offset = rays @ faces[:, :-1].T, faces[:, -1]
    slack = touches * sizes.max()
    with np.errstate(divide="ignore", invalid="ignore"):
        leaves = np.where(along > touches, -offset / along, np.inf).min(axis=1)
        enters = np.where(along < -touches, (slack - offset) / along, -np.inf).max(axis=1)
    beside = ((np.abs(along) <= touches) & (offset > slack)).any(axis=1)
    met = (enters <= leaves) & (leaves >= 0) & ~beside
    return np.where(met, np.maximum(found, leaves), found)


def farthest_apart(
    points: Floats, sides: Floats, signed: tuple[bool, ...], asked: Floats
) -> tuple[float, Floats | None]:
    """Return the largest distance between hull and half-spaces along rays, and a new direction.

    Args:
        points: See :func:`inner_along`.
        sides: See :func:`outer_along`.
        signed: See :func:`spread`.
        asked: Angles of earlier directions, shape (k, d − 1).

    Returns:
        The relative distance; inf if the hull or the half-spaces are missing on a ray. The second
        value contains the angles (degrees) at which both are farthest apart, among directions about
        1° or more away from all earlier ones, shape (d − 1,); None if there are no such angles.
    """
    number = len(signed)
    angles = spread(signed, 0.5 if number == 2 else 3.0)
    rays = rays_at(angles)
    inner, outer = inner_along(points, rays), outer_along(sides, rays)
    known = np.isfinite(outer) & (inner > 0)
    apart = np.where(known, outer / np.where(known, inner, 1.0) - 1.0, np.inf)
    nearest = (rays @ rays_at(asked).T).max(axis=1)
    new = nearest <= np.cos(np.radians(0.99))  # least distance of two directions (degrees)
    best = int(np.argmax(np.where(new, apart, -np.inf)))
    return float(apart.max()), angles[best] if new[best] else None
