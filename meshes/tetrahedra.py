"""Handle tetrahedra that gmsh's meshers did not make: place their facets, and write files."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs

Booleans = npt.NDArray[np.bool_]
Place = Callable[[Floats], Booleans]
"""Function that returns which facets are on a surface, from their corners of shape (n, 3, 3)."""


def on(direction: int | Sequence[float], value: float) -> Place:
    """Return a test for facets in the plane x·direction = value; an integer means an axis."""
    along = np.eye(3)[direction] if isinstance(direction, int) else np.array(direction)

    def there(facets: Floats) -> Booleans:
        return np.asarray(np.isclose(facets @ along, value).all(axis=1))

    return there


ON_DIAGONAL = on((1.0, -1.0, 0.0), 0.0)


def both(one: Place, other: Place) -> Place:
    """Return a test for facets that are in both places."""
    return lambda facets: one(facets) & other(facets)


def either(one: Place, other: Place) -> Place:
    """Return a test for facets that are in at least one of two places."""
    return lambda facets: one(facets) | other(facets)


def in_sector(middles: Floats) -> Booleans:
    """Return which cells have y < x, from their middles of shape (n, 3)."""
    return np.asarray(middles[:, 0] > middles[:, 1])


def prisms(near: Longs, far: Longs) -> Longs:
    """Return the tetrahedra of prisms between two sets of triangles, shape (3 n, 4).

    Args:
        near: Point indices of the first triangles, shape (n, 3); diagonals start at their earlier
            points.
        far: Point indices of the second triangles, in the same order.
    """
    (a, b, c), (d, e, f) = near.T, far.T
    return np.concatenate(
        [np.column_stack(four) for four in ((a, b, c, f), (a, b, e, f), (a, d, e, f))]
    )


def right_handed(x: Floats, cells: Longs) -> Longs:
    """Return the same tetrahedra, each with positive volume."""
    one, two, three = np.moveaxis(x[cells[:, 1:]] - x[cells[:, :1]], 1, 0)
    turned = np.einsum("ci,ci->c", np.cross(one, two), three) < 0
    return np.where(turned[:, None], cells[:, [1, 0, 2, 3]], cells)


def joined(bodies: Mapping[str, tuple[Floats, Longs]]) -> tuple[Floats, dict[str, Longs]]:
    """Return all points of bodies without common points, and the cells with indices of these."""
    firsts = np.cumsum([0, *(len(x) for x, _ in bodies.values())])
    cells = {
        name: mine + first for (name, (_, mine)), first in zip(bodies.items(), firsts, strict=False)
    }
    return np.concatenate([x for x, _ in bodies.values()]), cells


def write_tetrahedra(
    path: str | Path,
    x: Floats,
    bodies: Mapping[str, Longs],
    surfaces: Mapping[str, Place | tuple[Sequence[str], Place]],
    order: int = 1,
) -> None:
    """Write bodies in a new gmsh model; bodies that share points are glued together.

    Args:
        path: The .msh file to write.
        x: Coordinates of all points.
        bodies: Point indices of the cells, by the name of the volume.
        surfaces: Places of outer facets by surface name, optionally with the names of their bodies.
        order: Degree of the geometry, 1 or 2.
    """
    model = gmsh.model
    model.add(" ".join(bodies))
    tetrahedron, triangle = 4, 2  # gmsh's element types
    new = np.ones(len(x), dtype=np.bool_)
    for name, cells in bodies.items():
        body = model.addDiscreteEntity(3)
        own = np.unique(cells)
        own = own[new[own]]
        new[own] = False
        model.mesh.addNodes(3, body, own + 1, x[own].ravel())
        model.mesh.addElementsByType(body, tetrahedron, [], (cells + 1).ravel())
        model.addPhysicalGroup(3, [body], name=name)
    every = np.concatenate(list(bodies.values()))
    facets = np.sort(np.concatenate([np.delete(every, i, axis=1) for i in range(4)]), axis=1)
    of = np.tile(np.repeat(list(bodies), [len(cells) for cells in bodies.values()]), 4)
    facets, first, count = np.unique(facets, axis=0, return_index=True, return_counts=True)
    outer = count == 1
    facets, of = facets[outer], of[first[outer]]
    for name, told in surfaces.items():
        names, place = (tuple(bodies), told) if callable(told) else told
        here = facets[np.isin(of, names) & place(x[facets])]
        surface = model.addDiscreteEntity(2)
        model.mesh.addElementsByType(surface, triangle, [], (here + 1).ravel())
        model.addPhysicalGroup(2, [surface], name=name)
    model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))
