"""Make two stacked blocks with separate meshes, in 2D or 3D."""

from collections.abc import Sequence
from itertools import permutations

from mpi4py import MPI

import basix.ufl
import numpy as np
import ufl
from dolfinx.mesh import CellType, create_mesh, locate_entities_boundary, meshtags

from perfplast_fenicsx import TaggedMesh
from perfplast_fenicsx.arrays import Floats, Longs

LOWER, UPPER = 1, 2


def block(
    counts: Sequence[int],
    lower: Sequence[float],
    upper: Sequence[float],
    angle: float,
    seed: int,
    moved_by: float,
) -> tuple[Floats, Longs]:
    """Return a block of simplices, rotated about a vertical axis, with moved inner points."""
    gdim = len(counts)
    grid = np.indices([count + 1 for count in counts]).reshape(gdim, -1).T
    share = grid / np.array(counts)
    inner = ((share > 0) & (share < 1))[:, :-1].all(axis=1)
    moved = (np.random.default_rng(seed).random((len(grid), gdim - 1)) - 0.5) / counts[:-1]
    share[inner, :-1] += moved_by * moved[inner]
    low, high = np.array(lower), np.array(upper)
    x = low + share * (high - low)
    if angle:
        centre = (low + high)[:2] / 2
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        x[:, :2] = (x[:, :2] - centre) @ turn.T + centre
    steps = np.cumprod([1, *[count + 1 for count in counts[:0:-1]]])[::-1]
    first = np.indices(counts).reshape(gdim, -1).T @ steps
    cells = []
    for order in permutations(range(gdim)):
        corners = np.cumsum([0, *steps[list(order)]])
        cells.append(first[:, None] + corners)
    return x, np.concatenate(cells)


def blocks_apart(
    comm: MPI.Intracomm,
    lower: Sequence[int],
    upper: Sequence[int],
    span: tuple[float, float] = (0.0, 1.0),
    angle: float = 0.0,
    height: float = 1.0,
    slope: float = 0.0,
    moved_by: float = 0.5,
) -> TaggedMesh:
    """Return the unit block, and a block on a part of its top, with given cell counts.

    The seam may be inclined along x; the ends of the blocks are not inclined. Inner points are
    moved by up to half of the given fraction of a cell. If no points are moved, blocks with equal
    counts match.
    """
    gdim = len(lower)
    wide = gdim - 1
    x, cells = block(lower, [0.0] * gdim, [1.0] * gdim, 0.0, 1, moved_by)
    begin, end = [span[0]] * wide + [height], [span[1]] * wide + [height + 1]
    y, more = block(upper, begin, end, angle, 2, moved_by)
    volume = np.repeat([LOWER, UPPER], [len(cells), len(more)]).astype(np.int32)
    cells = np.concatenate([cells, more + len(x)])
    x = np.concatenate([x, y])
    x[:, wide] += slope * (x[:, 0] - 0.5) * (1 - np.abs(x[:, wide] - 1))
    mine = slice(None) if comm.rank == 0 else slice(0)
    kind = CellType.triangle if gdim == 2 else CellType.tetrahedron
    domain = ufl.Mesh(basix.ufl.element("Lagrange", kind.name, 1, shape=(gdim,)))
    mesh = create_mesh(comm, cells[mine], x=x[mine], e=domain)
    of_cell = volume[mesh.topology.original_cell_index]
    mesh.topology.create_connectivity(gdim - 1, gdim)
    cell_of = mesh.topology.connectivity(gdim - 1, gdim)
    names = {
        "bottom": (LOWER, lambda z: np.isclose(z[wide], 0)),
        "lower_top": (LOWER, lambda z: np.isclose(z[wide], 1 + slope * (z[0] - 0.5))),
        "x0": (LOWER, lambda z: np.isclose(z[0], 0)),
        "upper_bottom": (UPPER, lambda z: np.isclose(z[wide], height + slope * (z[0] - 0.5))),
        "top": (UPPER, lambda z: np.isclose(z[wide], height + 1)),
    }
    if gdim == 3:
        names["y0"] = (LOWER, lambda z: np.isclose(z[1], 0))
    if not angle:
        names["x1"] = (LOWER, lambda z: np.isclose(z[0], 1))
        names["upper_x1"] = (UPPER, lambda z: np.isclose(z[0], span[1]))
        names["upper_x0"] = (UPPER, lambda z: np.isclose(z[0], span[0]))
        if gdim == 3:
            names["upper_y0"] = (UPPER, lambda z: np.isclose(z[1], span[0]))
    facets, values = [], []
    for tag, (body, where) in enumerate(names.values(), start=1):
        found = locate_entities_boundary(mesh, gdim - 1, where)
        found = found[of_cell[cell_of.array[cell_of.offsets[found]]] == body]
        facets.append(found)
        values.append(np.full(found.size, tag, dtype=np.int32))
    order = np.argsort(np.concatenate(facets))
    every = np.arange(len(of_cell), dtype=np.int32)
    return TaggedMesh(
        mesh=mesh,
        cell_tags=meshtags(mesh, gdim, every, of_cell),
        facet_tags=meshtags(
            mesh, gdim - 1, np.concatenate(facets)[order], np.concatenate(values)[order]
        ),
        volumes={"lower": LOWER, "upper": UPPER},
        surfaces={name: tag for tag, name in enumerate(names, start=1)},
    )
