"""Sweep a plane section around a square, with a mitre at the corner, into tetrahedra.

The section lies in (x, z), x ≥ 0. The sweep goes from the plane y = 0 along y to the plane x = y.
From there its mirror image goes along x to the plane x = 0, which gives a quarter of a body about
the axis z; without this image the result is an eighth. So edges of a square are lines of the sweep,
and the cells around a point of the section extend along these edges.
"""

import math
from collections.abc import Sequence

import gmsh
import numpy as np

from meshes.tetrahedra import prisms, right_handed
from perfplast_fenicsx.arrays import Floats, Longs


def mitred(
    points: Floats, triangles: Longs, layers: Sequence[float], first: Floats, eighth: bool = False
) -> tuple[Floats, Longs]:
    """Return points and tetrahedra of a quarter or of an eighth.

    Args:
        points: Points (x, z) of the section, shape (n, 2).
        triangles: Cells of the section, shape (m, 3).
        layers: Values of y/x between layers, from 0 to 1.
        first: A number for each point of the section. A diagonal goes to the plane of the mitre
            from the end with the smaller number.
        eighth: Whether the sweep ends at the plane of the mitre.

    Returns:
        Arrays of shapes (p, 3) and (q, 4).
    """
    image = [] if eighth else [2 - layer for layer in layers[-2::-1]]
    along = np.array([*layers, *image])
    x, z = points.T
    parts = [np.minimum(1.0, 2 - along)[:, None] * x, np.minimum(1.0, along)[:, None] * x]
    places = np.stack([*parts, np.broadcast_to(z, parts[0].shape)], axis=-1).reshape(-1, 3)
    numbers = np.arange(len(places)).reshape(len(along), -1)
    on_axis = np.isclose(x, 0.0)
    numbers[:, on_axis] = numbers[0, on_axis]

    rank = np.argsort(np.argsort(first))
    sorted_ = np.take_along_axis(triangles, np.argsort(rank[triangles], axis=1), axis=1)
    cells = []
    for layer, here in enumerate(along[:-1]):
        near, far = (layer, layer + 1) if here < 1 else (layer + 1, layer)
        cells.append(prisms(numbers[near][sorted_], numbers[far][sorted_]))
    every = np.concatenate(cells)
    kept = every[(np.diff(np.sort(every, axis=1), axis=1) > 0).all(axis=1)]
    used, cells_of_used = np.unique(kept, return_inverse=True)
    return places[used], right_handed(places[used], cells_of_used.reshape(kept.shape))


def straight_fan(centre: Sequence[float], radius: float, turns: Sequence[float]) -> list[int]:
    """Add the plane cells of a fan; each extends from the centre to the radius.

    Args:
        centre: Centre (x, z) of the fan.
        radius: Radius of all cells.
        turns: Angles between the cells, from the direction of x (degrees).

    Returns:
        Tags of the cells' surfaces.
    """
    occ = gmsh.model.occ
    middle = occ.addPoint(*centre, 0.0)
    ends = [
        occ.addPoint(
            centre[0] + radius * math.cos(math.radians(turn)),
            centre[1] + radius * math.sin(math.radians(turn)),
            0.0,
        )
        for turn in turns
    ]
    spokes = [occ.addLine(middle, end) for end in ends]
    chords = [occ.addLine(*ends[i : i + 2]) for i in range(len(ends) - 1)]
    return [
        occ.addPlaneSurface([occ.addCurveLoop([spokes[i], chord, spokes[i + 1]])])
        for i, chord in enumerate(chords)
    ]
