"""Make rigid stones of four or eight corners, divided into simplices, and their problems."""

from collections.abc import Callable, Sequence
from itertools import permutations, product

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.mesh import CellType, create_mesh, exterior_facet_indices, meshtags

from perfplast_fenicsx import BodyForce, Contact, Plane, Problem, Rigid, Support, TaggedMesh
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap

Place = Callable[[Floats], Floats]
"""A map from points in the unit cube, shape (n, d), to points of a stone."""


def stones(comm: MPI.Intracomm, places: Sequence[Place], counts: Sequence[int]) -> TaggedMesh:
    """Return a mesh of stones "0", "1", ..., with sides "0_x0", "0_x1", "0_y0", ... by coordinates.

    Args:
        comm: The ranks.
        places: Coordinates of the stones; neighbouring stones share no vertex.
        counts: Numbers of cells along each coordinate.
    """
    d = len(counts)
    grid = np.indices([count + 1 for count in counts]).reshape(d, -1).T
    steps = np.cumprod([1, *[count + 1 for count in counts[:0:-1]]])[::-1]
    first = np.indices(counts).reshape(d, -1).T @ steps
    corners = [np.cumsum([0, *steps[list(order)]]) for order in permutations(range(d))]
    one = np.concatenate([first[:, None] + of for of in corners])
    share = grid / np.array(counts)
    x = np.concatenate([place(share) for place in places])
    cells = np.concatenate([one + number * len(grid) for number in range(len(places))])
    stone = np.repeat(np.arange(1, len(places) + 1), len(one)).astype(np.int32)
    mine = slice(None) if comm.rank == 0 else slice(0)
    kind = CellType.triangle if d == 2 else CellType.tetrahedron
    domain = ufl.Mesh(basix.ufl.element("Lagrange", kind.name, 1, shape=(d,)))
    mesh = create_mesh(comm, cells[mine], x=x[mine], e=domain)
    of_cell = stone[mesh.topology.original_cell_index]
    tags = _tags(mesh, share, len(grid))
    sides = [f"{i}_{axis}{end}" for i in range(len(places)) for axis in "xyz"[:d] for end in (0, 1)]
    return TaggedMesh(
        mesh=mesh,
        cell_tags=meshtags(mesh, d, np.arange(len(of_cell), dtype=np.int32), of_cell),
        facet_tags=tags,
        volumes={str(i): i + 1 for i in range(len(places))},
        surfaces={name: tag for tag, name in enumerate(sides, start=1)},
    )


def _tags(mesh, share: Floats, per_stone: int):  # type: ignore[no-untyped-def]
    """Return tags of facets, by the sides of the unit cube on which all their vertices lie."""
    d = mesh.topology.dim
    for one, other in ((d - 1, d), (d - 1, 0), (d, 0)):
        mesh.topology.create_connectivity(one, other)
    facets = exterior_facet_indices(mesh.topology)
    index_map = mesh.topology.index_map(0)
    of_vertex = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=np.int64)
    inputs = np.asarray(mesh.geometry.input_global_indices)[geometry_dofmap(mesh).ravel()]
    of_vertex[mesh.topology.connectivity(d, 0).array] = inputs
    vertices = mesh.topology.connectivity(d - 1, 0).array.reshape(-1, d)[facets]
    inputs = of_vertex[vertices]
    stone, at = inputs[:, 0] // per_stone, share[inputs % per_stone]
    values = np.zeros(len(facets), dtype=np.int32)
    for axis, end in product(range(d), (0, 1)):
        on = (at[:, :, axis] == end).all(axis=1)
        values[on] = (stone * 2 * d + 2 * axis + end + 1)[on]
    return meshtags(mesh, d - 1, facets, values)


def box(low: Sequence[float], high: Sequence[float]) -> Place:
    """Return a stone with sides along the axes."""
    return lambda share: np.asarray(low) + share * (np.asarray(high) - np.asarray(low))


def voussoir(begin: float, end: float, inner: float, outer: float) -> Place:
    """Return a stone of an arch with straight sides, x along the arch and y outwards.

    Args:
        begin: Angle of its first side from the vertical, counterclockwise.
        end: Angle of its last side.
        inner: Radius of its inner corners.
        outer: Radius of its outer corners.
    """

    def place(share: Floats) -> Floats:
        ends = np.array([[np.sin(-a), np.cos(a)] for a in (begin, end)])
        along = ends[0] + share[:, :1] * (ends[1] - ends[0])
        return (inner + share[:, 1:2] * (outer - inner)) * along

    return place


def chain(
    mesh: TaggedMesh,
    supports: Sequence[Support],
    loads: Sequence[BodyForce],
    obstacles: Sequence[Plane] = (),
    **joint: npt.ArrayLike,
) -> Problem:
    """Return a problem of stones, each of which touches the next stone along x."""
    count = len(mesh.volumes)
    return Problem(
        mesh,
        {name: Rigid() for name in mesh.volumes},
        list(supports),
        list(loads),
        [Contact(f"{i}_x1", f"{i + 1}_x0", associated=True, **joint) for i in range(count - 1)],  # type: ignore[arg-type]
        list(obstacles),
        degree=2,
    )


def weight_and(mesh: TaggedMesh, push: Sequence[float], held: Sequence[str]) -> list[BodyForce]:
    """Return the weight 1 per volume of each free stone, and a push that ζ multiplies."""
    down = [0.0] * (mesh.mesh.geometry.dim - 1) + [-1.0]
    free = [name for name in mesh.volumes if name not in held]
    return [BodyForce(name, down, constant=True) for name in free] + [
        BodyForce(name, push) for name in free
    ]


def lune(begin: float, end: float, inner: float, outer: float, wide: float) -> Place:
    """Return a stone of a dome slice between two planes through its axis z, x along the meridian.

    Args:
        begin: Angle of its first side from the axis; 0 is the crown, where its side is vertical.
        end: Angle of its last side.
        inner: Inner radius.
        outer: Outer radius.
        wide: Tangent of half the angle between the two planes.
    """
    least = 1e-2 * inner  # lower limit of x at the crown, where planes meet

    def place(share: Floats) -> Floats:
        angle = begin + share[:, 0] * (end - begin)
        r = inner + share[:, 2] * (outer - inner)
        x, z = r * np.sin(angle), r * np.cos(angle)
        if begin == 0:
            x = least + share[:, 0] * (r * np.sin(end) - least)
            z = r + share[:, 0] * (r * np.cos(end) - r)
        return np.column_stack([x, (2 * share[:, 1] - 1) * wide * x, z])

    return place
