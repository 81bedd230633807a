"""Make parts of bodies with planes of symmetry, on meshes that are mirror images of each other."""

from collections.abc import Callable, Mapping
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.mesh import (
    CellType,
    GhostMode,
    create_cell_partitioner,
    create_mesh,
    locate_entities_boundary,
    meshtags,
)

from perfplast_fenicsx import TaggedMesh

Floats = npt.NDArray[np.float64]
Longs = npt.NDArray[np.int64]
On = Callable[[Floats], npt.NDArray[np.bool_]]


def square_tube(comm: MPI.Intracomm, n: int, quarter: bool, turned: float = 0.0) -> TaggedMesh:
    """Return a quarter or an eighth of a tube with square sections x = ±1 and x = ±2. Collective.

    The body ``body`` has the planes of symmetry ``y0`` and, for a quarter, ``x0``, or otherwise
    ``diagonal``; ``inner`` is its inner face.

    Args:
        comm: The ranks.
        n: Number of cells through the wall.
        quarter: Whether to return a quarter; otherwise an eighth.
        turned: Angle by which the body is rotated.
    """
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    x = 1 + i / n
    points, number = np.stack([x, x * (j / n)], axis=1), np.arange(len(i)).reshape(n + 1, n + 1)
    a, b, d, c = (
        number[rows, columns].ravel()
        for rows in (slice(None, -1), slice(1, None))
        for columns in (slice(None, -1), slice(1, None))
    )
    cells = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    places: dict[str, On] = {
        "y0": lambda x: np.isclose(x[1], 0),
        "inner": lambda x: np.isclose(np.maximum(x[0], x[1]), 1),
    }
    if quarter:
        points, cells, _ = with_image(points, cells, np.arange(len(points)))
        places["x0"] = lambda x: np.isclose(x[0], 0)
    else:
        places["diagonal"] = lambda x: np.isclose(x[0], x[1])
    return built(comm, points, cells, places, turned)


def cube(comm: MPI.Intracomm, n: int, octant: bool, turned: float = 0.0) -> TaggedMesh:
    """Return an octant of a cube of edge 2, or its half on one side of x = y. Collective.

    The body ``body`` has the planes of symmetry ``y0``, ``bottom``, and ``x0`` or otherwise
    ``diagonal``; ``top`` is the face z = 1.

    Args:
        comm: The ranks.
        n: Number of cells along an edge.
        octant: Whether to return an octant; otherwise half of one.
        turned: Angle by which the body is rotated about z.
    """
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    half = j <= i
    number = np.zeros((n + 1, n + 1), dtype=np.int64)
    number[i[half], j[half]] = np.arange(half.sum())
    a, b = i[half & (i < n)], j[half & (i < n)]
    cells: Longs = np.stack([number[a, b], number[a + 1, b], number[a + 1, b + 1]], axis=1)
    a, b = a[b < a], b[b < a]
    above = np.stack([number[a, b], number[a + 1, b + 1], number[a, b + 1]], axis=1)
    points: Floats = np.stack([i[half], j[half]], axis=1) / n
    cells = np.concatenate([cells, above])
    rank: Longs = np.arange(len(points))
    places: dict[str, On] = {
        "y0": lambda x: np.isclose(x[1], 0),
        "bottom": lambda x: np.isclose(x[2], 0),
        "top": lambda x: np.isclose(x[2], 1),
    }
    if octant:
        points, cells, rank = with_image(points, cells, rank)
        places["x0"] = lambda x: np.isclose(x[0], 0)
    else:
        places["diagonal"] = lambda x: np.isclose(x[0], x[1])
    levels = np.repeat(np.arange(n + 1), len(points)) / n
    cells = np.take_along_axis(cells, np.argsort(rank[cells], axis=1), axis=1)
    parts = []
    for layer in range(n):
        near, far = layer * len(points) + cells, (layer + 1) * len(points) + cells
        (a, b, c), (d, e, f) = near.T, far.T
        parts += [np.stack(four, axis=1) for four in ((a, b, c, f), (a, b, e, f), (a, d, e, f))]
    points = np.column_stack([np.tile(points, (n + 1, 1)), levels])
    return built(comm, points, np.concatenate(parts), places, turned)


def with_image(points: Floats, cells: Longs, rank: Longs) -> tuple[Floats, Longs, Longs]:
    """Return triangles with their mirror image beyond x = y, and a number that images share."""
    beyond = ~np.isclose(points[:, 0], points[:, 1])
    image = np.where(beyond, len(points) + np.cumsum(beyond) - 1, np.arange(len(points)))
    both = np.concatenate([points, points[beyond][:, ::-1]])
    return both, np.concatenate([cells, image[cells]]), np.concatenate([rank, rank[beyond]])


def sharing_facets() -> Any:
    """Return a partitioner that gives ranks ghost cells across facets."""
    try:
        return create_cell_partitioner(GhostMode.shared_facet)
    except TypeError:  # DOLFINx 0.11 requires the largest number of cells at a facet
        return create_cell_partitioner(GhostMode.shared_facet, 2)


def built(
    comm: MPI.Intracomm, points: Floats, cells: Longs, places: Mapping[str, On], turned: float
) -> TaggedMesh:
    """Return the mesh of a body, whose surfaces refer to unrotated points. Collective."""
    d = points.shape[1]
    along, across = np.cos(turned), np.sin(turned)
    turn = np.eye(d)
    turn[:2, :2] = [[along, -across], [across, along]]
    shape = CellType.triangle if d == 2 else CellType.tetrahedron
    domain = ufl.Mesh(basix.ufl.element("Lagrange", shape.name, 1, shape=(d,)))
    own = slice(None) if comm.rank == 0 else slice(0)
    mesh = create_mesh(
        comm,
        cells[own],
        x=(points @ turn.T)[own],
        e=domain,
        partitioner=sharing_facets(),
    )
    mesh.topology.create_connectivity(d - 1, d)
    back = np.eye(3)
    back[:d, :d] = turn.T
    facets = [
        locate_entities_boundary(mesh, d - 1, lambda x, on=on: on(back @ x))
        for on in places.values()
    ]
    tags = np.repeat(np.arange(1, len(facets) + 1), [len(some) for some in facets])
    numbers, first = np.unique(np.concatenate(facets), return_index=True)
    index_map = mesh.topology.index_map(d)
    every = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    return TaggedMesh(
        mesh,
        meshtags(mesh, d, every, np.ones(len(every), dtype=np.int32)),
        meshtags(mesh, d - 1, numbers.astype(np.int32), tags[first].astype(np.int32)),
        {"body": 1},
        {name: tag for tag, name in enumerate(places, start=1)},
    )
