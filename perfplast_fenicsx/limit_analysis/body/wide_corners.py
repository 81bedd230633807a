"""Find cells of the plane that are too wide where loads, supports or contacts end.

At such points principal stresses rotate (:mod:`singular_points`). A lower bound needs directions
out to the same distance, that is long and thin cells. Next to a side with known traction the stress
is uniform at first. Long cells improve nothing there and worsen the mechanism.
"""

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.body.singular_points import (
    angles_at_corners,
    turns_at_vertices,
)
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.given import Given

Flags = npt.NDArray[np.bool_]


def wide_corners(
    tagged_mesh: TaggedMesh, given: Given, gap: float | None = None
) -> tuple[Flags, Flags]:
    """Return which corners of owned cells at such points are too wide, and all such corners.

    Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        given: Its loads, supports and contacts.
        gap: Gap of the bounds on this mesh, relative. The gap due to an angle is proportional to
            its square. Angles are therefore halved once the bounds are close, and again for each
            quarter of the gap.

    Returns:
        Both of shape (num_cells, 3).
    """
    widest = np.deg2rad(7.5)  # for a rotation by a right angle; wider for smaller rotations
    near_enough = 0.004  # gap at which angles are halved: they cause a third of it
    if gap is not None and 0 < gap < near_enough:
        widest /= 2.0 ** np.ceil(np.log(near_enough / gap) / np.log(4.0))
    near = np.deg2rad(42.0)  # from a side: without friction the stress is uniform within 45°
    topology = tagged_mesh.mesh.topology
    vertices, points = corners(tagged_mesh.mesh)
    vertices = vertices[: topology.index_map(2).size_local]
    x = points[vertices]
    turn, _, at_ends = turns_at_vertices(tagged_mesh, given)
    turn = (turn * at_ends)[vertices]
    wide = angles_at_corners(x) * turn > widest
    return wide & (_from_sides(tagged_mesh, points, vertices) > near), turn > 0


def _from_sides(tagged_mesh: TaggedMesh, points: Floats, vertices: Ints) -> Floats:
    """Return the larger angle of both edges of a corner from the nearer side. Collective.

    Args:
        tagged_mesh: Mesh of triangles.
        points: Points of the local vertices.
        vertices: Vertices of the owned cells, shape (num_cells, 3).

    Returns:
        Angles, shape (num_cells, 3); meaningless where no two sides meet.
    """
    topology = tagged_mesh.mesh.topology
    outer = exterior_facet_indices(topology)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[outer]
    along = _directions(points[ends[:, 1]] - points[ends[:, 0]])
    # The sum of both directions as complex numbers and the sum of their squares determine them.
    sums = la.vector(topology.index_map(0), 4, dtype=np.float64)
    table = sums.array.reshape(-1, 2, 2)
    for end, direction in ((0, along), (1, -along)):
        powers = np.stack([direction, direction**2], axis=1)
        np.add.at(table, ends[:, end], np.stack([powers.real, powers.imag], axis=2))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    whole, squares = (table[:, k, 0] + 1j * table[:, k, 1] for k in (0, 1))
    root = np.sqrt(2 * squares - whole**2)
    sides = np.stack([whole + root, whole - root], axis=1)[vertices]

    x = points[vertices]
    edges = np.stack([_directions(np.roll(x, -k, axis=1) - x) for k in (1, 2)], axis=2)
    angles = np.abs(np.angle(edges[..., None] * np.conj(sides[:, :, None])))
    away: Floats = angles.min(axis=3).max(axis=2)
    return away


def _directions(vectors: Floats) -> npt.NDArray[np.complex128]:
    """Return plane vectors as complex numbers of modulus 1."""
    numbers = vectors[..., 0] + 1j * vectors[..., 1]
    directions: npt.NDArray[np.complex128] = numbers / np.abs(numbers)
    return directions
