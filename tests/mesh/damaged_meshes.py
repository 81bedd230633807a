"""Make damaged meshes from a valid mesh: arrays, written in gmsh's format 2.2.

The mesh has two stacked blocks in contact; in 2D, two rectangles.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import permutations, product
from pathlib import Path

import numpy as np
import numpy.typing as npt

Longs = npt.NDArray[np.int64]

NAMES = {"low": 11, "seam_a": 12, "seam_b": 13, "high": 14}
BODIES = {"a": 1, "b": 2}


@dataclass(frozen=True)
class Plain:
    """A mesh as stored in a file: nodes from 0, bodies 1 and 2, facets with tags."""

    points: npt.NDArray[np.float64]
    cells: Longs
    body: Longs
    facets: Longs
    tags: Longs

    @property
    def dim(self) -> int:
        return self.cells.shape[1] - 1

    def write(self, path: Path) -> None:
        """Return the mesh as text of a .msh file."""
        dim = self.dim
        names = [f'{dim} {tag} "{name}"' for name, tag in BODIES.items()]
        names += [f'{dim - 1} {tag} "{name}"' for name, tag in NAMES.items()]
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", f"{len(names)}"]
        lines += [*names, "$EndPhysicalNames", "$Nodes", f"{len(self.points)}"]
        x = np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1])))
        lines += [f"{n} {a:.17g} {b:.17g} {c:.17g}" for n, (a, b, c) in enumerate(x, 1)]
        lines += ["$EndNodes", "$Elements", f"{len(self.cells) + len(self.facets)}"]
        elements = [(tag, nodes) for tag, nodes in zip(self.tags, self.facets, strict=True)]
        elements += [(tag, nodes) for tag, nodes in zip(self.body, self.cells, strict=True)]
        kinds = {2: 1, 3: 2, 4: 4}
        for number, (tag, nodes) in enumerate(elements, 1):
            kind = kinds[len(nodes)]
            listed = " ".join(str(node + 1) for node in nodes)
            lines.append(f"{number} {kind} 2 {tag} {tag} {listed}")
        path.write_text("\n".join([*lines, "$EndElements", ""]))


def block(low: list[float], n: int, first: int, body: int, low_tag: int, high_tag: int) -> Plain:
    """Return a unit cube or square with n cells along each edge, and its last-axis ends."""
    dim = len(low)
    grid = np.array(list(product(range(n + 1), repeat=dim)))
    number = {tuple(place): i for i, place in enumerate(grid.tolist())}
    cells = []
    for corner in product(range(n), repeat=dim):
        for order in permutations(range(dim)):
            place = list(corner)
            nodes = [number[tuple(place)]]
            for axis in order:
                place[axis] += 1
                nodes.append(number[tuple(place)])
            cells.append(nodes)
    facets, tags = [], []
    for nodes in cells:
        for left_out in range(dim + 1):
            rest = nodes[:left_out] + nodes[left_out + 1 :]
            along = grid[rest, dim - 1]
            for at, tag in ((0, low_tag), (n, high_tag)):
                if (along == at).all():
                    facets.append(rest)
                    tags.append(tag)
    return Plain(
        np.array(low) + grid / n,
        np.array(cells) + first,
        np.full(len(cells), body),
        np.array(facets) + first,
        np.array(tags),
    )


def together(one: Plain, other: Plain) -> Plain:
    """Return both bodies in one mesh."""
    parts = [(getattr(one, key), getattr(other, key)) for key in one.__dataclass_fields__]
    return Plain(*map(np.concatenate, parts))


def blocks(dim: int, n: int = 2, shift: tuple[float, ...] = (), other: int | None = None) -> Plain:
    """Return two stacked bodies in contact, with a shift of the upper body."""
    lower = block([0.0] * dim, n, 0, 1, NAMES["low"], NAMES["seam_a"])
    place = np.zeros(dim)
    place[-1] = 1.0
    place[: len(shift)] += shift
    tags = (2, NAMES["seam_b"], NAMES["high"])
    return together(lower, block(list(place), other or n, len(lower.points), *tags))


def _moved(mesh: Plain, node: int, to: list[float]) -> Plain:
    points = mesh.points.copy()
    points[node] = to
    return replace(mesh, points=points)


def _node(mesh: Plain, at: list[float], body: int = 1) -> int:
    mine = np.unique(mesh.cells[mesh.body == body])
    return int(mine[np.argmin(np.linalg.norm(mesh.points[mine] - at, axis=1))])


def _with_cells(mesh: Plain, more: Longs, body: int = 1) -> Plain:
    body_of = np.concatenate([mesh.body, np.full(len(more), body)])
    return replace(mesh, cells=np.concatenate([mesh.cells, more]), body=body_of)


def _merged(mesh: Plain, one: int, other: int) -> Plain:
    """Merge two nodes."""
    cells, facets = (np.where(a == one, other, a) for a in (mesh.cells, mesh.facets))
    return replace(mesh, cells=cells, facets=facets)


def _swapped(mesh: Plain, one: int, other: int) -> Plain:
    points = mesh.points.copy()
    points[[one, other]] = points[[other, one]]
    return replace(mesh, points=points)


def _unglued(mesh: Plain, axis: int, only: int | None = None) -> Plain:
    """Separate the lower body along a plane through its middle, with nodes on either side."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    beyond = (mesh.body == 1) & (middle[:, axis] > 0.5)
    double = np.unique(mesh.cells[beyond])
    double = double[np.isclose(mesh.points[double, axis], 0.5)][:only]
    new = np.arange(len(mesh.points))
    new[double] = len(mesh.points) + np.arange(len(double))
    cells, facets = mesh.cells.copy(), mesh.facets.copy()
    cells[beyond] = new[cells[beyond]]
    centre = mesh.points[facets].mean(axis=1)
    far = (centre[:, axis] > 0.5) & np.isin(mesh.tags, [NAMES["low"], NAMES["seam_a"]])
    facets[far] = new[facets[far]]
    points = np.concatenate([mesh.points, mesh.points[double]])
    return replace(mesh, points=points, cells=cells, facets=facets)


def _mixed(dim: int) -> Plain:
    """Mesh the halves of the lower body separately, so they do not match."""
    lower = block([0.0] * dim, 2, 0, 1, NAMES["low"], NAMES["seam_a"])
    place = [1.0, *[0.0] * (dim - 1)]
    beside = block(place, 3, len(lower.points), 1, NAMES["low"], NAMES["seam_a"])
    both = together(lower, beside)
    tags = (2, NAMES["seam_b"], NAMES["high"])
    upper = block([0.0] * (dim - 1) + [1.0], 2, len(both.points), *tags)
    return together(both, upper)


def _twisted(dim: int) -> Plain:
    """Bend a body until its ends overlap."""
    long = block([0.0] * dim, 6, 0, 1, NAMES["low"], NAMES["seam_a"])
    angle = 6.8 * long.points[:, -1]
    radius = 2.0 + long.points[:, 0]
    ring = [radius * np.cos(angle), radius * np.sin(angle)]
    points = np.column_stack([*ring, long.points[:, 1]] if dim == 3 else ring)
    away = [30.0, *[0.0] * (dim - 1)]
    tags = (2, NAMES["seam_b"], NAMES["high"])
    return together(replace(long, points=points), block(away, 1, len(points), *tags))


def inverted(mesh: Plain) -> Plain:
    """Reverse the orientation of every other cell."""
    cells = mesh.cells.copy()
    cells[::2, :2] = cells[::2, 1::-1]
    return replace(mesh, cells=cells)


Make = Callable[[int], Plain]


def _inside(dim: int, size: float) -> Plain:
    """Make the upper body small, and place it inside the lower body."""
    mesh = blocks(dim, 1)
    points = mesh.points.copy()
    mine = np.unique(mesh.cells[mesh.body == 2])
    points[mine] = 0.6 + size * (points[mine] - points[mine].min(axis=0))
    return replace(mesh, points=points)


def _up(dim: int, by: float) -> tuple[float, ...]:
    return (*[0.0] * (dim - 1), by)


DAMAGED: dict[str, tuple[Make, str]] = {
    "inner node far out": (
        lambda d: _moved(blocks(d), _node(blocks(d), [0.5] * d), [1.4] * d),
        "folded",
    ),
    "inner node just out": (
        lambda d: _moved(blocks(d), _node(blocks(d), [0.5] * d), [1.02] + [0.5] * (d - 1)),
        "folded",
    ),
    "inner node across a cell": (
        lambda d: _moved(
            blocks(d, 3), _node(blocks(d, 3), [1 / 3] * d), [0.72] + [1 / 3] * (d - 1)
        ),
        "folded",
    ),
    "corner pushed in": (
        lambda d: _moved(blocks(d), _node(blocks(d), [0.0] * d), [0.8] * d),
        "folded",
    ),
    "two nodes exchanged": (
        lambda d: _swapped(
            blocks(d), _node(blocks(d), [0.5] * d), _node(blocks(d), [0.0] + [0.5] * (d - 1))
        ),
        "folded",
    ),
    "far nodes exchanged": (
        lambda d: _swapped(blocks(d), _node(blocks(d), [0.0] * d), _node(blocks(d), [1.0] * d)),
        "folded",
    ),
    "a cell twice": (lambda d: _with_cells(blocks(d), blocks(d).cells[:1]), "more than two|folded"),
    "all cells twice": (
        lambda d: _with_cells(blocks(d), blocks(d).cells[blocks(d).body == 1]),
        "more than two|folded",
    ),
    "a cell across others": (
        lambda d: _with_cells(
            blocks(d),
            np.array([[_node(blocks(d), list(p)) for p in np.vstack([np.zeros(d), np.eye(d)])]]),
        ),
        "folded|overlaps itself",
    ),
    "a body twice": (lambda d: blocks(d, 2, _up(d, -1.0)), "'a' and 'b' overlap"),
    "half in each other": (lambda d: blocks(d, 2, _up(d, -0.5)), "'a' and 'b' overlap"),
    "a little in each other": (lambda d: blocks(d, 2, _up(d, -0.02)), "'a' and 'b' overlap"),
    "crossing": (lambda d: blocks(d, 2, (0.5,) * (d - 1) + (-0.5,)), "'a' and 'b' overlap"),
    "other cells": (lambda d: blocks(d, 2, _up(d, -0.25), 5), "'a' and 'b' overlap"),
    "one inside the other": (lambda d: _inside(d, 0.05), "'a' and 'b' overlap"),
    "a ring over its own end": (_twisted, "'a' overlaps itself"),
    "not glued": (lambda d: _unglued(blocks(d), 0), "'a' has an internal cut"),
    "not glued across": (lambda d: _unglued(blocks(d, 4), d - 1), "'a' has an internal cut"),
    "a few not glued": (
        lambda d: _unglued(blocks(d, 4), 0, 4 if d == 2 else 20),
        "'a' has an internal cut",
    ),
    "halves do not match": (_mixed, "'a' has an internal cut"),
    "glued to a wrong node": (
        lambda d: _merged(
            blocks(d),
            _node(blocks(d), [0.5] * (d - 1) + [1.0], 2),
            _node(blocks(d), [0.0] * (d - 1) + [1.0], 1),
        ),
        "folded|overlap|degenerate",
    ),
}
"""The kind of damage, by the dimension, and words of the message."""
