"""Build structured sample meshes: ``two_blocks``, ``punch``, ``l_plate``, ``stacked_blocks``.

Each assembly consists of boxes, which are divided into cubes and tetrahedra; each rank creates a
part of the cells. Every cube, with corners 1…8 = (000)(100)(110)(010)(001)(101)(111)(011), is
divided into the tetrahedra 1246 1456 4568 2346 3674 4678. Points at the ends of each edge of a box
have exactly the given coordinates, and points between them are rounded only once. The module
therefore finds surfaces by exact comparison, and the vertices of two touching surfaces coincide
exactly.
"""

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.mesh import create_mesh, locate_entities_boundary, meshtags

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import geometry_dofmap, sent_to
from perfplast_fenicsx.errors import InputError, nearest
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
    """One body: a box that is divided into cubes.

    Attributes:
        name: Name of the volume.
        lower: Corner of the box with the smallest coordinates, shape (3,).
        upper: The opposite corner, shape (3,).
        counts: Number of cubes along each axis.
        keep: Function that returns which cubes to keep, from their indices along the axes, shape
            (3, num_cubes); None keeps all.
    """

    name: str
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    counts: tuple[int, int, int]
    keep: Marker | None = None

    @property
    def num_cubes(self) -> int:
        """Return the number of cubes in the box, including those that are not kept."""
        return math.prod(self.counts)

    @property
    def num_vertices(self) -> int:
        """Return the number of vertices of all cubes, including those that are not kept."""
        return math.prod(count + 1 for count in self.counts)

    def points(self, vertices: Longs) -> Floats:
        """Return coordinates of vertices from indices (x varies fastest), shape (·, 3)."""
        shape = [count + 1 for count in self.counts]
        steps = np.stack(np.unravel_index(vertices, shape, order="F"), axis=1)
        lower, upper = np.array(self.lower), np.array(self.upper)
        inner = lower + (upper - lower) * steps / self.counts
        return np.where(steps == self.counts, upper, inner)

    def tetrahedra(self, cubes: Longs) -> Longs:
        """Return the vertex indices of all tetrahedra in the kept cubes, shape (·, 4)."""
        steps = np.stack(np.unravel_index(cubes, self.counts, order="F"))
        if self.keep is not None:
            steps = steps[:, self.keep(steps)]
        i, j, k = steps[:, :, None] + CORNERS.T[:, None, :]
        corners = i + (self.counts[0] + 1) * (j + (self.counts[1] + 1) * k)
        return corners[:, TETRAHEDRA - 1].reshape(-1, 4)


@dataclass(frozen=True)
class Surface:
    """The exterior facets of ``bodies`` whose vertices all satisfy ``where``.

    Attributes:
        name: Name of the surface.
        bodies: Names of the volumes.
        where: Function of points, shape (3, num_points), that returns a flag for each point.
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
    """Return a mesh of boxes that share no vertex, with named surfaces. Collective.

    Each rank creates an equal share of the cubes and of the vertices; then DOLFINx distributes the
    cells. Vertices that belong to no kept cube are not part of the mesh.

    Args:
        comm: Communicator of the mesh. The mesh has no ghost cells.
        boxes: The bodies.
        surfaces: The named surfaces of the bodies, which must not overlap.
        rank_of: Function that returns the ranks of cells from their centres, shape (num_cells, 3);
            None uses DOLFINx's partitioner.

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
    """Raise an error if a mesh is too large for the memory, before its allocation. Collective."""
    cubes = sum(box.num_cubes for box in boxes)
    # least number of bytes per tetrahedron during the creation of the mesh
    least_memory = 200
    needed = cubes * len(TETRAHEDRA) * least_memory
    enough, _, available = has_memory(comm, needed / comm.size)
    if not enough:
        raise InputError(
            f"{float(cubes * len(TETRAHEDRA)):.3g} tetrahedra need more than the "
            f"{available / 2**30:.3g} GiB of available memory; give a smaller n."
        )


def _shares(comm: MPI.Intracomm, sizes: Sequence[int]) -> list[Longs]:
    """Return this rank's share of consecutive ranges, as indices in each range."""
    total = sum(sizes)
    start, stop = total * comm.rank // comm.size, total * (comm.rank + 1) // comm.size
    firsts = np.cumsum([0, *sizes[:-1]])
    return [
        np.arange(*np.clip((start - first, stop - first), 0, size), dtype=np.int64)
        for first, size in zip(firsts, sizes, strict=True)
    ]


def two_blocks(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return a block (0,3)×(0,1)×(0,1) with an equal block on top; ``n`` cubes per unit length.

    Collective.

    Volumes ``lower`` and ``upper``; surfaces ``left`` (x = 0, both bodies), ``top`` (z = 2 and x ≥
    1.5; for odd n without the cubes that reach below x = 1.5), ``upper_bottom`` and ``lower_top``
    (z = 1).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length, at least 1.

    Raises:
        InputError: If ``n`` is not a positive integer.
    """
    _check_n("two_blocks", n)
    counts = (3 * n, n, n)
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (3.0, 1.0, 1.0), counts),
            Box("upper", (0.0, 0.0, 1.0), (3.0, 1.0, 2.0), counts),
        ],
        [
            Surface("left", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("top", ("upper",), lambda x: (x[2] == 2) & (x[0] >= 1.5)),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == 1),
            Surface("lower_top", ("lower",), lambda x: x[2] == 1),
        ],
    )


def punch(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return a quarter of a square punch, (0,½)²×(1,1½), on a base (0,1)³. Collective.

    Volumes ``base`` and ``punch``; surfaces ``x0``, ``y0`` (both bodies), ``bottom`` (z = 0),
    ``top`` (z = 1½), ``punch_bottom``, and ``base_top``, which covers only the base under the punch
    (z = 1, x ≤ ½, y ≤ ½).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length; an even number.

    Raises:
        InputError: If ``n`` is not a positive even number.
    """
    _check_n("punch", n)
    if n % 2:
        raise InputError(
            f"builder 'punch' has n = {n}; n must be even, because the punch is ½ wide."
        )
    half = n // 2
    return structured_mesh(
        comm,
        [
            Box("base", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (n, n, n)),
            Box("punch", (0.0, 0.0, 1.0), (0.5, 0.5, 1.5), (half, half, half)),
        ],
        [
            Surface("x0", ("base", "punch"), lambda x: x[0] == 0),
            Surface("y0", ("base", "punch"), lambda x: x[1] == 0),
            Surface("bottom", ("base",), lambda x: x[2] == 0),
            Surface("top", ("punch",), lambda x: x[2] == 1.5),
            Surface("punch_bottom", ("punch",), lambda x: x[2] == 1),
            Surface("base_top", ("base",), lambda x: (x[2] == 1) & (x[0] <= 0.5) & (x[1] <= 0.5)),
        ],
    )


def l_plate(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return an L-shaped plate, (0,10)²×(0,1) without (0,5)²×(0,1). Collective.

    Volume ``plate``; surfaces ``x0``, ``y0``, ``z0``, ``z1`` and ``top`` (y = 10).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length; the published mesh of level k has n = 2^k.

    Raises:
        InputError: If ``n`` is not a positive integer.
    """
    _check_n("l_plate", n)

    def in_plate(cube: Longs) -> npt.NDArray[np.bool_]:
        return (cube[0] >= 5 * n) | (cube[1] >= 5 * n)

    return structured_mesh(
        comm,
        [Box("plate", (0.0, 0.0, 0.0), (10.0, 10.0, 1.0), (10 * n, 10 * n, n), in_plate)],
        [
            Surface("x0", ("plate",), lambda x: x[0] == 0),
            Surface("y0", ("plate",), lambda x: x[1] == 0),
            Surface("z0", ("plate",), lambda x: x[2] == 0),
            Surface("z1", ("plate",), lambda x: x[2] == 1),
            Surface("top", ("plate",), lambda x: x[1] == 10),
        ],
    )


def stacked_blocks(
    comm: MPI.Intracomm, n: int, heights: Sequence[float] = (1.0, 1.0)
) -> TaggedMesh:
    """Return two blocks with the cross-section 1×1 on top of each other. Collective.

    Volumes ``lower`` and ``upper``; surfaces ``x0``, ``y0`` (both bodies), ``bottom``, ``top``,
    ``upper_bottom`` and ``lower_top``.

    Args:
        comm: Communicator of the mesh.
        n: Number of cubes along each edge of each block, at least 1; cubes are stretched to the
            height.
        heights: Heights of the lower and the upper block, from 1e-6 to 1e6.

    Raises:
        InputError: If ``n`` is not a positive integer, or if a height is out of range.
    """
    _check_n("stacked_blocks", n)
    if not (
        isinstance(heights, Sequence)
        and len(heights) == 2
        and all(isinstance(h, Real) and 1e-6 <= h <= 1e6 for h in heights)
    ):
        raise InputError(
            f"builder 'stacked_blocks' has heights = {heights!r}; give two numbers from 1e-6 to "
            "1e6, because the blocks are 1 wide."
        )
    middle, top = float(heights[0]), float(heights[0]) + float(heights[1])
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, middle), (n, n, n)),
            Box("upper", (0.0, 0.0, middle), (1.0, 1.0, top), (n, n, n)),
        ],
        [
            Surface("x0", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("y0", ("lower", "upper"), lambda x: x[1] == 0),
            Surface("bottom", ("lower",), lambda x: x[2] == 0),
            Surface("top", ("upper",), lambda x: x[2] == top),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == middle),
            Surface("lower_top", ("lower",), lambda x: x[2] == middle),
        ],
    )


BUILDERS: dict[str, Callable[..., TaggedMesh]] = {
    builder.__name__: builder for builder in (two_blocks, punch, l_plate, stacked_blocks)
}
"""The builders by their names in case files."""


def build(comm: MPI.Intracomm, name: str, **arguments: object) -> TaggedMesh:
    """Return the mesh of a builder, from its name and arguments in a case file. Collective.

    Args:
        comm: Communicator of the mesh.
        name: Name of a builder in :data:`BUILDERS`.
        arguments: Arguments of the builder besides ``comm``.

    Raises:
        InputError: If the builder is unknown, if an argument is unknown or missing, or if the
            builder refuses an argument.
    """
    if name not in BUILDERS:
        raise InputError(f"there is no builder '{name}'; {nearest(name, BUILDERS)}")
    parameters = dict(inspect.signature(BUILDERS[name]).parameters)
    del parameters["comm"]
    for argument in arguments:
        if argument not in parameters:
            raise InputError(
                f"builder '{name}' has no argument '{argument}'; {nearest(argument, parameters)}"
            )
    for key, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and key not in arguments:
            raise InputError(
                f"builder '{name}' needs the argument '{key}'; give for example {key} = 4."
            )
    return BUILDERS[name](comm, **arguments)


def _check_n(builder: str, n: object) -> None:
    if isinstance(n, bool) or not isinstance(n, Integral) or n < 1:
        raise InputError(f"builder '{builder}' has n = {n!r}; n must be a positive whole number.")
