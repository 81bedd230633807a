"""Boxes in graded layers of cubes, each of six tetrahedra around one of its diagonals: Kuhn's.

Which diagonal it is may be said for each layer along each axis by itself, and cells of neighbouring
cubes fit whatever is said: the diagonal of a face depends on the layers along the two axes in its
plane, which both cubes have in common. Where layers along x and y are the same, facets lie in the
plane x = y.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs

Booleans = npt.NDArray[np.bool_]
Place = Callable[[Floats], Booleans]
"""Whether facets are on a surface, from their corners of the shape (n, 3, 3)."""


@dataclass(frozen=True)
class Layers:
    """Layers along an axis.

    Attributes:
        places: Where they begin and end, growing, shape (n + 1,).
        back: Of which of them diagonals start at the upper end, shape (n,).
    """

    places: Floats
    back: Booleans


def layers(places: Sequence[float] | Floats, signs: str = "+") -> Layers:
    """Layers along an axis, with ``+`` or ``-`` for the diagonals of each, or one for all."""
    signs = signs * (len(places) - 1) if len(signs) == 1 else signs
    return Layers(np.array(places, dtype=np.float64), np.array([sign == "-" for sign in signs]))


@dataclass(frozen=True)
class Kuhn:
    """One body of cubes.

    Attributes:
        layers: Along each axis.
        keep: From the middles of tetrahedra, shape (n, 3), which of them the body has; all by
            default.
    """

    layers: tuple[Layers, Layers, Layers]
    keep: Callable[[Floats], Booleans] | None = None

    def cells(self) -> tuple[Floats, Longs]:
        """Points (p, 3), and the numbers of those of tetrahedra (q, 4), right-handed."""
        counts = [len(along.back) for along in self.layers]
        cubes = np.array(list(product(*map(range, counts))))
        back = np.column_stack(
            [along.back[i] for along, i in zip(self.layers, cubes.T, strict=True)]
        )
        tetrahedra = []
        for order in permutations(range(3)):
            corners = np.vstack([np.zeros(3), np.cumsum(np.eye(3)[list(order)], axis=0)])
            steps = np.where(back[:, None, :], 1 - corners, corners).astype(np.int64)
            at = cubes[:, None, :] + steps
            odd = bool(np.linalg.det(corners[1:] - corners[:-1]) < 0)
            turned = (back.sum(axis=1) % 2 == 1) != odd
            at = np.where(turned[:, None, None], at[:, [1, 0, 2, 3]], at)
            tetrahedra.append(at)
        shape = [count + 1 for count in counts]
        steps = np.moveaxis(np.concatenate(tetrahedra), -1, 0)
        cells = np.asarray(np.ravel_multi_index(tuple(steps), shape), dtype=np.int64)
        every = np.meshgrid(*(along.places for along in self.layers), indexing="ij")
        x = np.stack(every, axis=-1).reshape(-1, 3)
        if self.keep is not None:
            cells = cells[self.keep(x[cells].mean(axis=1))]
        used, numbers = np.unique(cells, return_inverse=True)
        return x[used], numbers.reshape(cells.shape)


def write_bodies(
    path: str | Path,
    bodies: Mapping[str, tuple[Floats, Longs]],
    surfaces: Mapping[str, tuple[Sequence[str], Place]],
    order: int = 1,
) -> None:
    """Write bodies of tetrahedra that share no point as a .msh file, in a new model of gmsh.

    Args:
        path: The file to write.
        bodies: Points and cells by the names of volumes.
        surfaces: By name, of which bodies, and where.
        order: Degree of the geometry, 1 or 2.
    """
    model, shift, facets_of = gmsh.model, 0, {}
    model.add("bodies")
    tetrahedron, triangle = 4, 2  # gmsh's numbers
    for name, (x, cells) in bodies.items():
        body = model.addDiscreteEntity(3)
        model.mesh.addNodes(3, body, range(shift + 1, shift + len(x) + 1), x.ravel())
        model.mesh.addElementsByType(body, tetrahedron, [], (cells + 1 + shift).ravel())
        model.addPhysicalGroup(3, [body], name=name)
        facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
        facets, count = np.unique(facets, axis=0, return_counts=True)
        facets = facets[count == 1]
        facets_of[name] = (facets + 1 + shift, x[facets])
        shift += len(x)
    for name, (of, place) in surfaces.items():
        here = [numbers[place(corners)] for numbers, corners in map(facets_of.__getitem__, of)]
        surface = model.addDiscreteEntity(2)
        model.mesh.addElementsByType(surface, triangle, [], np.concatenate(here).ravel())
        model.addPhysicalGroup(2, [surface], name=name)
    model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))


def on(direction: int | Sequence[float], value: float) -> Place:
    """Facets in the plane x·direction = value; a number is that of an axis."""
    along = np.eye(3)[direction] if isinstance(direction, int) else np.array(direction)

    def there(facets: Floats) -> Booleans:
        return np.asarray(np.isclose(facets @ along, value).all(axis=1))

    return there


def both(one: Place, other: Place) -> Place:
    """Facets that are in both places."""
    return lambda facets: one(facets) & other(facets)
