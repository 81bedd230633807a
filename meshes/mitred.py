"""Bodies whose plane section is swept around a square, with a mitre where it turns: tetrahedra.

The section lies in (x, z), x ≥ 0. It is swept from the plane y = 0 along y to the plane x = y,
and from there, as its own mirror image, along x to the plane x = 0: a quarter of a body about the
axis z; or not from there, which is an eighth. So edges of a square are lines of the sweep, and what
stands around an end of a line of the section stands around each of its edges.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs

Booleans = npt.NDArray[np.bool_]
Place = Callable[[Floats], Booleans]
"""Whether facets are on a surface, from their corners of the shape (n, 3, 3)."""


def mitred(
    points: Floats, triangles: Longs, layers: Sequence[float], first: Floats, eighth: bool = False
) -> tuple[Floats, Longs]:
    """Points and tetrahedra of a quarter, or of an eighth.

    Args:
        points: Of the section (x, z), shape (n, 2).
        triangles: Its cells, shape (m, 3).
        layers: Where y/x has layers, from 0 to 1.
        first: A number for each point of the section; diagonals go to the plane of the mitre from
            the end whose number is smaller.
        eighth: Whether the sweep ends at the plane of the mitre.

    Returns:
        Shapes (p, 3) and (q, 4).
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
        (a, b, c), (d, e, f) = numbers[near][sorted_].T, numbers[far][sorted_].T
        cells += [np.column_stack(four) for four in ((a, b, c, f), (a, b, e, f), (a, d, e, f))]
    every = np.concatenate(cells)
    kept = every[(np.diff(np.sort(every, axis=1), axis=1) > 0).all(axis=1)]
    used, cells_of_used = np.unique(kept, return_inverse=True)
    return places[used], _right_handed(places[used], cells_of_used.reshape(kept.shape))


def _right_handed(x: Floats, cells: Longs) -> Longs:
    one, two, three = np.moveaxis(x[cells[:, 1:]] - x[cells[:, :1]], 1, 0)
    turned = np.einsum("ci,ci->c", np.cross(one, two), three) < 0
    return np.where(turned[:, None], cells[:, [1, 0, 2, 3]], cells)


def on(axis: int, value: float, within: float = math.inf) -> Place:
    """Facets in the plane x_axis = value, and in the square |x|, |y| < within."""

    def there(facets: Floats) -> Booleans:
        in_square = facets[:, :, :2].mean(axis=1).max(axis=1) < within
        return np.asarray(np.isclose(facets[:, :, axis], value).all(axis=1) & in_square)

    return there


def on_mitre(facets: Floats) -> Booleans:
    """Facets in the plane x = y."""
    return np.asarray(np.isclose(facets[:, :, 0], facets[:, :, 1]).all(axis=1))


def write_body(
    path: str | Path,
    bodies: Mapping[str, Longs],
    x: Floats,
    surfaces: Mapping[str, Sequence[Place]],
    order: int = 1,
) -> None:
    """Write a body of tetrahedra, or glued ones, as a .msh file, in a new model of gmsh.

    Args:
        path: The file to write.
        bodies: Names, and numbers of the points of the cells, as :func:`mitred` returns them.
        x: Points.
        surfaces: Names, and the places whose outer facets have them.
        order: Degree of the geometry, 1 or 2.
    """
    cells = np.concatenate(list(bodies.values()))
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    facets, count = np.unique(facets, axis=0, return_counts=True)
    facets = facets[count == 1]
    model = gmsh.model
    model.add(" ".join(bodies))
    entities = [model.addDiscreteEntity(3) for _ in bodies]
    model.mesh.addNodes(3, entities[0], range(1, len(x) + 1), x.ravel())
    tetrahedron, triangle = 4, 2  # gmsh's numbers
    for body, (name, mine) in zip(entities, bodies.items(), strict=True):
        model.mesh.addElementsByType(body, tetrahedron, [], (mine + 1).ravel())
        model.addPhysicalGroup(3, [body], name=name)
    for name, places in surfaces.items():
        here = facets[np.logical_or.reduce([place(x[facets]) for place in places])]
        surface = model.addDiscreteEntity(2)
        model.mesh.addElementsByType(surface, triangle, [], (here + 1).ravel())
        model.addPhysicalGroup(2, [surface], name=name)
    model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))


def straight_fan(centre: Sequence[float], radius: float, turns: Sequence[float]) -> list[int]:
    """Add the plane cells of a fan: each reaches from the centre to the radius.

    Args:
        centre: (x, z).
        radius: Of all.
        turns: Angles from the direction x on (degrees).

    Returns:
        Tags of their surfaces.
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
