"""Mesh assemblies of boxes with cubes and tetrahedra; each rank creates its own part.

Every cube, with corners 1…8 = (000)(100)(110)(010)(001)(101)(111)(011), is divided into the
tetrahedra 1246 1456 4568 2346 3674 4678. The ends of each edge have exactly the given coordinates,
and points between them are rounded once. So surfaces are found by exact comparison and the vertices
of two touching surfaces coincide exactly.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.mesh import create_mesh, locate_entities_boundary, meshtags

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import geometry_dofmap, sent_to
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.machine_memory import has_memory
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Marker = Callable[[npt.NDArray[Any]], npt.NDArray[np.bool_]]

CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
TETRAHEDRA = np.array(
    [[1, 2, 4, 6], [1, 4, 5, 6], [4, 5, 6, 8], [2, 3, 4, 6], [3, 6, 7, 4], [4, 6, 7, 8]]
)


@dataclass(frozen=True)
class Box:
    """One body: a box of cubes.

    Attributes:
        name: Name of the volume.
        lower: Its corner with the smallest coordinates, shape (3,).
        upper: The opposite corner, shape (3,).
        counts: Number of cubes along each axis.
        keep: Which cubes to keep, by their indices along the axes, shape (3, num_cubes); None for
            all.
    """

    name: str
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    counts: tuple[int, int, int]
    keep: Marker | None = None

    @property
    def num_cubes(self) -> int:
        """Return the number of cubes, kept or not."""
        return math.prod(self.counts)

    @property
    def num_vertices(self) -> int:
        """Return the number of vertices of all cubes, kept or not."""
        return math.prod(count + 1 for count in self.counts)

    def points(self, vertices: Longs) -> Floats:
        """Return coordinates of vertices by index, the x axis fastest, shape (num_vertices, 3)."""
        shape = [count + 1 for count in self.counts]
        steps = np.stack(np.unravel_index(vertices, shape, order="F"), axis=1)
        lower, upper = np.array(self.lower), np.array(self.upper)
        inner = lower + (upper - lower) * steps / self.counts
        return np.where(steps == self.counts, upper, inner)

    def tetrahedra(self, cubes: Longs) -> Longs:
        """Return vertex indices of the tetrahedra of the kept cubes, shape (·, 4)."""
        steps = np.stack(np.unravel_index(cubes, self.counts, order="F"))
        if self.keep is not None:
            steps = steps[:, self.keep(steps)]
        i, j, k = steps[:, :, None] + CORNERS.T[:, None, :]
        corners = i + (self.counts[0] + 1) * (j + (self.counts[1] + 1) * k)
        return corners[:, TETRAHEDRA - 1].reshape(-1, 4)


@dataclass(frozen=True)
class Surface:
    """The exterior facets of some bodies with all vertices where ``where`` is true.

    Attributes:
        name: Name of the surface.
        bodies: Names of the volumes.
        where: Function that marks points of shape (3, num_points).
    """

    name: str
    bodies: tuple[str, ...]
    where: Marker


def structured_mesh(
    comm: MPI.Intracomm,
    boxes: Sequence[Box],
    surfaces: Sequence[Surface],
    rank_of: Callable[[Floats], Ints] | None = None,
) -> TaggedMesh:
    """Return a mesh of boxes that share no vertices, with named surfaces. Collective.

    Each rank creates an equal share of the cubes and of the vertices; DOLFINx then distributes the
    cells. Vertices of cubes that are not kept are not part of the mesh.

    Args:
        comm: Communicator of the mesh, which gets no ghost cells.
        boxes: The bodies.
        surfaces: Their named surfaces, which must not overlap.
        rank_of: Function that returns the ranks of cells from their middles, shape (num_cells, 3);
            None for DOLFINx's partitioner.

    Raises:
        InputError: If the mesh would not fit into the memory of the machines.
    """
    _check_size(comm, boxes)
    first_vertices = np.cumsum([0] + [box.num_vertices for box in boxes])
    tetrahedra = [
        box.tetrahedra(cubes)
        for box, cubes in zip(boxes, _shares(comm, [box.num_cubes for box in boxes]), strict=True)
    ]
    cells = [first + own for first, own in zip(first_vertices[:-1], tetrahedra, strict=True)]
    points = [
        box.points(vertices)
        for box, vertices in zip(
            boxes, _shares(comm, [box.num_vertices for box in boxes]), strict=True
        )
    ]
    domain = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    partitioner = None
    if rank_of is not None:
        corners = [box.points(own.ravel()) for box, own in zip(boxes, tetrahedra, strict=True)]
        partitioner = sent_to(rank_of(np.concatenate(corners).reshape(-1, 4, 3).mean(axis=1)))
    x = np.concatenate(points)
    mesh = create_mesh(comm, np.concatenate(cells), x=x, e=domain, partitioner=partitioner)

    nodes = mesh.geometry.input_global_indices[geometry_dofmap(mesh)[:, 0]]
    bodies = np.searchsorted(first_vertices, nodes, side="right").astype(np.int32)
    all_cells = np.arange(bodies.size, dtype=np.int32)
    volumes = {box.name: tag for tag, box in enumerate(boxes, start=1)}

    mesh.topology.create_connectivity(2, 3)
    cell_of = mesh.topology.connectivity(2, 3)
    facets, values = [], []
    for tag, surface in enumerate(surfaces, start=1):
        found = locate_entities_boundary(mesh, 2, surface.where)
        body = bodies[cell_of.array[cell_of.offsets[found]]]
        found = found[np.isin(body, [volumes[name] for name in surface.bodies])]
        facets.append(found)
        values.append(np.full(found.size, tag, dtype=np.int32))
    order = np.argsort(np.concatenate(facets))
    return TaggedMesh(
        mesh=mesh,
        cell_tags=meshtags(mesh, 3, all_cells, bodies),
        facet_tags=meshtags(mesh, 2, np.concatenate(facets)[order], np.concatenate(values)[order]),
        volumes=volumes,
        surfaces={surface.name: tag for tag, surface in enumerate(surfaces, start=1)},
    )


def _check_size(comm: MPI.Intracomm, boxes: Sequence[Box]) -> None:
    """Refuse meshes that are too large for memory, before they are allocated. Collective."""
    cubes = sum(box.num_cubes for box in boxes)
    # Least number of bytes for a tetrahedron while the mesh is created.
    least_memory = 200
    needed = cubes * len(TETRAHEDRA) * least_memory
    enough, _, available = has_memory(comm, needed / comm.size)
    if not enough:
        raise InputError(
            f"{float(cubes * len(TETRAHEDRA)):.3g} tetrahedra need more than the available "
            f"{available / 2**30:.3g} GiB of memory; choose a smaller n"
        )


def _shares(comm: MPI.Intracomm, sizes: Sequence[int]) -> list[Longs]:
    """Return this rank's part of consecutive ranges of given sizes, as local indices."""
    total = sum(sizes)
    start, stop = total * comm.rank // comm.size, total * (comm.rank + 1) // comm.size
    firsts = np.cumsum([0, *sizes[:-1]])
    return [
        np.arange(*np.clip((start - first, stop - first), 0, size), dtype=np.int64)
        for first, size in zip(firsts, sizes, strict=True)
    ]
