"""Test a thin hollow shaft under tension and torsion: the ellipse lies between proven polygons."""

import math

from mpi4py import MPI

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx.mesh import create_mesh, locate_entities_boundary, meshtags

from perfplast_fenicsx import Problem, Support, Traction, VonMises
from perfplast_fenicsx.limit_analysis import envelope
from perfplast_fenicsx.mesh.sample_meshes import Box
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Y = 300.0
STEEL = VonMises(2e5, 0.3, Y)
PLATES, THICK, LONG = 8, 0.1, 3.0
"""Number of walls, thickness and length; the middle of a wall has the distance 1 from the axis."""


def shaft(comm: MPI.Intracomm, layers: int, across: int = 1) -> TaggedMesh:
    """Return a tube of flat walls; no cell belongs to two walls.

    Args:
        comm: Communicator of the mesh.
        layers: Cells along it.
        across: Cells along each wall, an even number or 1.
    """
    around = PLATES * across
    box = Box("shaft", (0, 0, 0), (around, 1, layers), (around, 1, layers))
    every = np.arange(box.num_vertices if comm.rank == 0 else 0)
    i, j, k = np.unravel_index(every, [count + 1 for count in box.counts], order="F")
    number = i % around + around * (j + 2 * k)  # the last column equals the first column
    cells = number[box.tetrahedra(np.arange(box.num_cubes))] if comm.rank == 0 else None
    cells = np.zeros((0, 4), dtype=np.int64) if cells is None else cells
    kept = i < around
    i, j, k = i[kept], j[kept], k[kept]
    wall, along = np.divmod(i, across)
    turn = 2 * np.pi / PLATES
    corner = (1 + (j - 0.5) * THICK) / math.cos(turn / 2)
    ends = [np.stack([np.cos(a), np.sin(a)]) * corner for a in (turn * wall, turn * (wall + 1))]
    share = along / across
    x = np.column_stack([*((1 - share) * ends[0] + share * ends[1]), LONG * k / layers])
    domain = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    mesh = create_mesh(comm, cells, x=x, e=domain)
    mesh.topology.create_connectivity(2, 3)
    num_cells = mesh.topology.index_map(3).size_local
    top = locate_entities_boundary(mesh, 2, lambda x: x[2] > LONG - 1e-9)
    parts = [locate_entities_boundary(mesh, 2, lambda x: x[2] < 1e-9)]
    inside = math.cos(turn / 2) - 1e-9
    for one in range(PLATES):
        middle = turn * (one + 0.5)
        parts.append(
            np.intersect1d(
                top,
                locate_entities_boundary(
                    mesh,
                    2,
                    lambda x, a=middle: (
                        x[0] * math.cos(a) + x[1] * math.sin(a) > inside * np.hypot(x[0], x[1])
                    ),
                ),
            )
        )
    tags = np.concatenate([np.full(len(p), i, dtype=np.int32) for i, p in enumerate(parts, 1)])
    facets = np.concatenate(parts)
    order = np.argsort(facets)
    names = ["bottom", *(f"end{one}" for one in range(PLATES))]
    return TaggedMesh(
        mesh=mesh,
        cell_tags=meshtags(
            mesh, 3, np.arange(num_cells, dtype=np.int32), np.ones(num_cells, dtype=np.int32)
        ),
        facet_tags=meshtags(mesh, 2, facets[order], tags[order]),
        volumes={"shaft": 1},
        surfaces={name: tag for tag, name in enumerate(names, 1)},
    )


def loads() -> tuple[list[Traction], list[Traction]]:
    """Return tension up to Y, and shear stresses up to Y/√3 along the walls."""
    pull, twist = [], []
    for one in range(PLATES):
        middle = 2 * math.pi * (one + 0.5) / PLATES
        shear = Y / math.sqrt(3)
        pull.append(Traction(f"end{one}", (0.0, 0.0, Y)))
        twist.append(
            Traction(f"end{one}", (-shear * math.sin(middle), shear * math.cos(middle), 0.0))
        )
    return pull, twist


@pytest.mark.long
def test_an_ellipse_is_between_the_polygons(comm: MPI.Intracomm) -> None:
    """Equal walls under tension and shear carry (N/N₀)² + (T/T₀)² = 1 for any number of walls.

    Shear stresses balance where walls meet in the middle of their corner.
    """
    mesh = shaft(comm, 3)
    pull, twist = loads()
    problem = Problem(mesh, {"shaft": STEEL}, [Support("bottom")], pull, degree=2)
    found = envelope(problem, [pull, twist], directions=3, until=0.01)
    for (angle,) in found.directions:
        assert found.inner(angle) == pytest.approx(1.0, abs=1e-4)
        assert found.outer(angle) < 1.06
    for angle in np.arange(0.0, 91.0).tolist():
        assert found.inner(angle) <= 1 + 1e-4
        assert found.outer(angle) >= 1 - 1e-9
    assert found.gap < 0.25  # three directions leave 1/cos²(π/8) - 1 = .172
