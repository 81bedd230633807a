"""Compute annotations of a picture: load arrows and rigid obstacles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, move_of
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.problem.declared.loads import Bearing, Force, Load, Pressure, SpreadLoad


@dataclass(frozen=True)
class Arrows:
    """Start points and vectors of arrows, both of shape (num_arrows, 3)."""

    starts: Floats
    vectors: Floats


def load_arrows(
    surface: Surface,
    points: Floats,
    loads: Sequence[Load],
    shares: Sequence[float] | Floats = (),
) -> Arrows:
    """Return the arrows of all loads, distributed over their surfaces.

    An arrow that pushes ends on the surface; an arrow that pulls starts there.

    Args:
        surface: Surface with a mark ``load i`` for each load.
        points: Drawn positions of the surface's points.
        loads: The loads.
        shares: Relative lengths of each load's arrows, from −1 to 1; 1 by default.
    """
    starts, vectors = [np.zeros((0, 3))], [np.zeros((0, 3))]
    arrows = 24  # approximate largest number of arrows for a load
    # Length of arrows and their least distance, relative to the size of the bodies.
    arrow, apart = 0.1, 0.06
    # A short surface has at least this number of arrows, unless their distance falls below this
    # limit.
    least, nearest = 3, 0.025
    for i, load in enumerate(loads):
        chosen = np.flatnonzero(surface.marks[f"load {i}"])
        directions = _directions(load, surface, chosen)
        acts = directions.any(axis=1)
        share = float(shares[i]) if len(shares) else 1.0
        if not (acts.any() and share):
            continue
        chosen, directions = chosen[acts], directions[acts]
        normals, facets = surface.normals[chosen], surface.facets[chosen]
        total = np.linalg.norm(normals, axis=1).sum()
        spacing = max((total / arrows) ** (1 / (facets.shape[1] - 1)), apart * surface.size)
        across = np.ptp(surface.points[facets], axis=(0, 1)).max()
        spacing = min(spacing, max(across / least, nearest * surface.size))
        weights, facet = spread(surface.points[facets], spacing)
        ends = np.einsum("nc,nci->ni", weights, points[facets[facet]])
        d = directions[facet] / np.linalg.norm(directions[facet], axis=1, keepdims=True)
        d *= arrow * surface.size * share
        pushes = np.einsum("ni,ni->", d, normals[facet]) < 0
        starts.append(ends - d * pushes)
        vectors.append(d)
    return Arrows(np.concatenate(starts), np.concatenate(vectors))


def _directions(load: Load, surface: Surface, chosen: Longs) -> Floats:
    """Return the directions of a load at the midpoints of facets, shape (num_facets, 3).

    They are zero where the load does not act. They are also zero for a user-defined load given by a
    single number, since its direction is not known.
    """
    middles = surface.points[surface.facets[chosen]].mean(axis=1)
    normals = surface.normals[chosen]
    if isinstance(load, Pressure):
        return -np.sign(evaluate(load.value, middles, load.on))[:, None] * normals
    if isinstance(load, SpreadLoad) and load.scalar:
        return np.zeros_like(normals)
    # this list is empty if the load is only a moment
    values = list(np.atleast_1d(np.asarray(load.value, dtype=object)))
    if isinstance(load, Force) and not np.any(np.asarray(load.value, dtype=np.float64)):
        areas = np.linalg.norm(normals, axis=1)
        turn = np.array([0.0, 0.0, *np.atleast_1d(load.moment)])[-3:]
        return np.cross(turn, middles - np.average(middles, axis=0, weights=areas))
    found = np.column_stack([evaluate(value, middles, load.on) for value in [*values, 0.0][:3]])
    if isinstance(load, Bearing):
        found[np.einsum("ni,ni->n", found, normals) >= 0] = 0.0
    return found


def spread(corners: Floats, spacing: float) -> tuple[Floats, Longs]:
    """Return points on facets with approximately the given spacing.

    The space is divided into boxes of this size. In each box that a facet enters, the point
    nearest to the centre of the box is chosen.

    Returns:
        Weights of the corners of each point's facet, shape (num_points, 2 or 3), and this facet.
    """
    if corners.shape[1] == 2:
        s = (np.arange(48) + 0.5) / 48
        weights = np.column_stack([s, 1 - s])
    else:
        s, t = (np.indices((8, 8)).reshape(2, -1) + 0.5) / 8
        weights = np.column_stack([s, t, 1 - s - t])[s + t < 1]
    points = np.einsum("pc,fci->fpi", weights, corners).reshape(-1, 3)
    low, extent = corners.min(axis=(0, 1)), np.ptp(corners, axis=(0, 1))
    count = np.maximum(np.round(extent / spacing), 1)
    scaled = (points - low) / np.where(extent > 1e-6 * spacing, extent, np.inf) * count
    boxes = np.minimum(np.floor(scaled), count - 1)
    near = np.argsort(np.linalg.norm(scaled - boxes - 0.5, axis=1), kind="stable")
    chosen = near[np.unique(boxes[near], axis=0, return_index=True)[1]]
    return weights[chosen % len(weights)], chosen // len(weights)


@dataclass(frozen=True)
class Obstacles:
    """Distances to obstacles at the points of a grid around the bodies.

    Attributes:
        corner: First point of the grid.
        spacing: Spacing of the grid points in each direction.
        distances: Distance to each obstacle, negative inside, shape (n, n, n), or (n, n, 1) in the
            plane.
    """

    corner: Floats
    spacing: Floats
    distances: list[Floats]


def sample_obstacles(
    surface: Surface, points: Floats, obstacles: Sequence[Obstacle], travels: Sequence[float] = ()
) -> Obstacles:
    """Return the distances to obstacles near the bodies.

    Args:
        surface: The bodies.
        points: Drawn positions of the surface's points.
        obstacles: Obstacles that fit the mesh.
        travels: Share of its ``move`` by which each obstacle is drawn away from its start; 0 by
            default.
    """
    gdim = 2 if surface.plane else 3
    both = np.concatenate([points, surface.points])[:, :gdim]
    margin = 0.08  # margin around the bodies in which obstacles are drawn, relative to their size
    # The margins differ, because a grid point at the centre of an obstacle has no direction to it.
    margins = margin * surface.size * np.array([1.0, 1.01, 1.02])[:gdim]
    low, high = both.min(axis=0) - margins, both.max(axis=0) + 1.003 * margins
    # Number of grid points in each direction.
    samples = {2: 400, 3: 80}
    axes = [np.linspace(low[i], high[i], samples[gdim]) for i in range(gdim)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    shape = (*x.shape[:-1], 1)[:3]
    travels = travels or [0.0] * len(obstacles)
    moves = [
        travel * move_of(obstacle, gdim)
        for travel, obstacle in zip(travels, obstacles, strict=True)
    ]
    distances = [
        obstacle.towards(x.reshape(-1, gdim) - move)[0]
        for obstacle, move in zip(obstacles, moves, strict=True)
    ]
    return Obstacles(
        corner=np.array([*low, surface.points[0, 2]][:3]),
        spacing=np.array([*((high - low) / (samples[gdim] - 1)), 1.0][:3]),
        distances=[distance.reshape(shape) for distance in distances],
    )
