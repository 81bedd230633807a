"""Tetrahedra that are made without gmsh's meshers: where their facets are, and files of them."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs

Booleans = npt.NDArray[np.bool_]
Place = Callable[[Floats], Booleans]
"""Whether facets are on a surface, from their corners of the shape (n, 3, 3)."""


def on(direction: int | Sequence[float], value: float) -> Place:
    """Facets in the plane x·direction = value; a number is that of an axis."""
    along = np.eye(3)[direction] if isinstance(direction, int) else np.array(direction)

    def there(facets: Floats) -> Booleans:
        return np.asarray(np.isclose(facets @ along, value).all(axis=1))

    return there


ON_DIAGONAL = on((1.0, -1.0, 0.0), 0.0)


def both(one: Place, other: Place) -> Place:
    """Facets that are in both places."""
    return lambda facets: one(facets) & other(facets)


def either(one: Place, other: Place) -> Place:
    """Facets that are in one of two places."""
    return lambda facets: one(facets) | other(facets)


def in_sector(middles: Floats) -> Booleans:
    """Which cells have y < x, from their middles of the shape (n, 3)."""
    return np.asarray(middles[:, 0] > middles[:, 1])


def prisms(near: Longs, far: Longs) -> Longs:
    """Tetrahedra of the prisms between triangles of the same order, shape (3 n, 4).

    Args:
        near: Numbers of their points, shape (n, 3); diagonals go from the earlier ones of these.
        far: The same of the other ends.
    """
    (a, b, c), (d, e, f) = near.T, far.T
    return np.concatenate(
        [np.column_stack(four) for four in ((a, b, c, f), (a, b, e, f), (a, d, e, f))]
    )


def right_handed(x: Floats, cells: Longs) -> Longs:
    """The same tetrahedra, of a positive volume each."""
    one, two, three = np.moveaxis(x[cells[:, 1:]] - x[cells[:, :1]], 1, 0)
    turned = np.einsum("ci,ci->c", np.cross(one, two), three) < 0
    return np.where(turned[:, None], cells[:, [1, 0, 2, 3]], cells)


def joined(bodies: Mapping[str, tuple[Floats, Longs]]) -> tuple[Floats, dict[str, Longs]]:
    """All points of bodies that share none, and the bodies' cells in their numbers."""
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
    """Write bodies, which are glued where they share points, in a new model of gmsh.

    Args:
        path: The .msh file to write.
        x: All points.
        bodies: By the names of volumes, the numbers of the points of their cells.
        surfaces: By name, the places whose outer facets have it; of which bodies, if not of all.
        order: Degree of the geometry, 1 or 2.
    """
    model = gmsh.model
    model.add(" ".join(bodies))
    tetrahedron, triangle = 4, 2  # gmsh's numbers
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
