"""Write a gmsh mesh as a CalculiX model: quadratic tetrahedra, contact and a growing load.

Midside nodes lie at the middle of straight edges, as in the mesh that ``perfplast mesh`` makes.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.mesh import gmsh_session

Array = npt.NDArray[np.float64]
Longs = npt.NDArray[np.int64]

TO_C3D10 = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)
"""Index in gmsh's order of each node of a C3D10 element."""

FACES = ((0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3))
"""Corners of the faces S1 to S4."""

TETRAHEDRON, TRIANGLE = 11, 9
"""Gmsh's numbers of quadratic elements."""

STIFFNESS = 2000.0
"""Contact stiffness, in Young's moduli per unit of length.

The manual advises 5 to 50. With such values bodies overlap by 1 % to 3 % of the largest
displacement."""


@dataclass(frozen=True)
class Deck:
    """Materials, supports and load of a model.

    Attributes:
        yields: Yield stress of each body (MPa); None for an elastic body.
        held: Supported components, such as "13", of each supported surface.
        most: Load at time 1 (MPa for a pressure, N/mm³ for a force per volume).
        pressed: Surface under the pressure; empty if a force per volume acts.
        pulled: Body under a force per volume along y; empty if a pressure acts.
        young: Young's modulus (MPa).
        poisson: Poisson's ratio.
    """

    yields: Mapping[str, float | None]
    held: Mapping[str, str]
    most: float
    pressed: str = ""
    pulled: str = ""
    young: float = 210000.0
    poisson: float = 0.3


@dataclass(frozen=True, eq=False)
class Mesh:
    """The mesh of a deck.

    Attributes:
        points: Shape (num_nodes, 3); node k has the number k + 1.
        cells: Nodes of the elements of each body, by name, in the order of C3D10.
        surfaces: Nodes of the triangles of each surface, by name, corners first.
    """

    points: Array
    cells: dict[str, Longs]
    surfaces: dict[str, Longs]

    @property
    def first(self) -> dict[str, int]:
        """Return the number of the first element of each body."""
        counts = np.cumsum([1, *map(len, self.cells.values())])
        return {name: int(first) for name, first in zip(self.cells, counts, strict=False)}

    def faces(self, surface: str) -> Iterator[tuple[int, int]]:
        """Yield the number of each element at a surface, and the number of its face there."""
        wanted = np.sort(self.surfaces[surface][:, :3], axis=1)
        keys = set(map(tuple, listed(wanted)))
        for name, cells in self.cells.items():
            for k, face in enumerate(FACES, start=1):
                corners = np.sort(cells[:, face], axis=1)
                on = np.flatnonzero(np.all(np.isin(corners, wanted), axis=1))
                yield from (
                    (self.first[name] + int(row), k)
                    for row in on
                    if tuple(listed(corners[row])) in keys
                )


def listed(array: npt.NDArray[Any]) -> list[Any]:
    """Return the rows of an array as lists, with a type that type checkers accept."""
    rows: Any = array.tolist()
    return list(rows)


def read_mesh(path: Path) -> Mesh:
    """Read a gmsh file with linear tetrahedra, and return its mesh with added midside nodes."""
    with gmsh_session():
        gmsh.merge(str(path))
        gmsh.model.mesh.setOrder(2)
        tags, points, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        number[tags] = np.arange(len(tags))
        cells = _named(3, TETRAHEDRON, 10, number)
        surfaces = _named(2, TRIANGLE, 6, number)
    ordered = {name: rows[:, TO_C3D10] for name, rows in cells.items()}
    return Mesh(points.reshape(-1, 3), ordered, surfaces)


def _named(dim: int, kind: int, width: int, number: Longs) -> dict[str, Longs]:
    found: dict[str, list[Longs]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, group)
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            _, nodes = gmsh.model.mesh.getElementsByType(kind, entity)
            found.setdefault(name, []).append(number[nodes.astype(np.int64)].reshape(-1, width))
    return {name: np.concatenate(rows) for name, rows in found.items()}


def deck_text(mesh: Mesh, deck: Deck, contact: tuple[str, str]) -> str:
    """Return the text of the ``.inp`` file, which both programs read."""
    return "".join(_lines(mesh, deck, contact))


def _lines(mesh: Mesh, deck: Deck, contact: tuple[str, str]) -> Iterator[str]:
    yield "*NODE, NSET=NALL\n"
    for k, (x, y, z) in enumerate(listed(mesh.points), start=1):
        yield f"{k},{x:.12g},{y:.12g},{z:.12g}\n"
    for name, cells in mesh.cells.items():
        yield f"*ELEMENT, TYPE=C3D10, ELSET={name}\n"
        for k, nodes in enumerate(listed(cells + 1), start=mesh.first[name]):
            yield ",".join(map(str, [k, *nodes])) + "\n"
    for name in deck.held:
        yield f"*NSET, NSET={name}_nodes\n"
        yield from (f"{node + 1}\n" for node in listed(np.unique(mesh.surfaces[name])))
    for name in contact:
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT\n"
        yield from (f"{element},S{face}\n" for element, face in mesh.faces(name))
    for name, limit in deck.yields.items():
        yield f"*MATERIAL, NAME=of_{name}\n*ELASTIC\n{deck.young},{deck.poisson}\n"
        yield "*DENSITY\n1.\n" if name == deck.pulled else ""
        yield f"*PLASTIC\n{limit},0.\n" if limit is not None else ""
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL=of_{name}\n"
    yield "*SURFACE INTERACTION, NAME=touch\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
    yield f"{STIFFNESS * deck.young:g}\n"
    yield "*CONTACT PAIR, INTERACTION=touch, TYPE=SURFACE TO SURFACE\n"
    yield f"{contact[0]},{contact[1]}\n"
    yield "*BOUNDARY\n"
    for name, components in deck.held.items():
        yield from (f"{name}_nodes,{one},{one}\n" for one in components)
    yield "*STEP, INC=500\n*STATIC\n0.05,1.,1e-5,0.05\n*DLOAD\n"
    if deck.pressed:
        faces = mesh.faces(deck.pressed)
        yield from (f"{element},P{face},{deck.most:g}\n" for element, face in faces)
    else:
        yield f"{deck.pulled},GRAV,{deck.most:g},0.,1.,0.\n"
    yield "*NODE PRINT, NSET=NALL\nU\n"
    yield f"*CONTACT PRINT, SLAVE={contact[0]}, MASTER={contact[1]}\nCF\n*END STEP\n"


def work(mesh: Mesh, deck: Deck, u: Array) -> float:
    """Return α, the work of the load of factor 1 on displacements ``u``, shape (num_nodes, 3)."""
    if deck.pressed:
        nodes = mesh.surfaces[deck.pressed]
        a, b, c = (mesh.points[nodes[:, k]] for k in range(3))
        area = np.cross(b - a, c - a) / 2
        outside = np.sign(area @ (a.mean(axis=0) - mesh.points.mean(axis=0)))
        mean = u[nodes[:, 3:]].mean(axis=1)  # only midside nodes matter
        return float(-(outside[:, None] * area * mean).sum())
    nodes = mesh.cells[deck.pulled]
    edges = mesh.points[nodes[:, 1:4]] - mesh.points[nodes[:, :1]]
    volume = np.abs(np.linalg.det(edges)) / 6
    mean = u[nodes[:, 4:], 1].sum(axis=1) / 5 - u[nodes[:, :4], 1].sum(axis=1) / 20
    return float(volume @ mean)
