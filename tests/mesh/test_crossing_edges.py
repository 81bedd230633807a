"""Test that lines that nearly cross are bent, and no other vertex moves."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import (
    CellType,
    DiagonalType,
    compute_midpoints,
    create_rectangle,
    exterior_facet_indices,
    meshtags,
)

from perfplast_fenicsx import PorePressure, TaggedMesh
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.limit_analysis.body.finer_meshes import on_kinks
from perfplast_fenicsx.mesh.crossing_edges import bend_crossings
from perfplast_fenicsx.spatial_fields import Formula

SIZE = 4


def crossed(shift: float, bodies: int = 1) -> TaggedMesh:
    """Return squares with both diagonals, whose centres are moved along x by a given amount."""
    corners = [(0.0, 0.0), (1.0, 1.0)]
    mesh = create_rectangle(
        *(MPI.COMM_WORLD, corners, [SIZE, SIZE], CellType.triangle),
        diagonal=DiagonalType.crossed,
    )
    topology = mesh.topology
    index_map = topology.index_map(2)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    middles = compute_midpoints(mesh, 2, cells)
    beyond = middles[:, 1] > middles[:, 0] if bodies == 2 else np.zeros(len(cells), dtype=bool)
    topology.create_connectivity(1, 2)
    outer = exterior_facet_indices(topology)
    x = mesh.geometry.x
    centre = np.abs(SIZE * x[:, :2] - np.round(SIZE * x[:, :2])).min(axis=1) > 0.4
    x[centre, 0] += shift
    return TaggedMesh(
        mesh=mesh,
        cell_tags=meshtags(mesh, 2, cells, (1 + beyond).astype(np.int32)),
        facet_tags=meshtags(mesh, 1, outer, np.full(len(outer), 7, dtype=np.int32)),
        volumes={"below": 1, "above": 2},
        surfaces={"around": 7},
    )


@pytest.mark.mpi3("1e-12")
@pytest.mark.parametrize("shift", [1e-12, 1e-9, 1e-5])
def test_nearly_straight_lines_are_bent(shift: float) -> None:
    tagged_mesh = crossed(shift)
    before = tagged_mesh.mesh.geometry.x.copy()
    assert bend_crossings(tagged_mesh) == SIZE**2
    ways = np.linalg.norm(tagged_mesh.mesh.geometry.x - before, axis=1)
    moved = ways > 0
    edge = np.sqrt(0.5) / SIZE
    assert ways[moved] == pytest.approx(0.05 * edge, rel=1e-3)
    owned = tagged_mesh.mesh.geometry.index_map().size_local
    assert MPI.COMM_WORLD.allreduce(int(moved[:owned].sum())) == SIZE**2
    assert bend_crossings(tagged_mesh) == 0


def test_flat_triangles_are_not_folded() -> None:
    """A vertex moves by less than the heights of its triangles."""
    tagged_mesh = crossed(1e-9)
    mesh = tagged_mesh.mesh
    mesh.geometry.x[:, 1] *= 0.02
    cells = geometry_dofmap(mesh)

    def areas() -> Floats:
        sides = mesh.geometry.x[cells[:, 1:], :2] - mesh.geometry.x[cells[:, :1], :2]
        return np.asarray(np.linalg.det(sides))

    before = areas()
    assert bend_crossings(tagged_mesh) == SIZE**2
    assert (areas() * before > 0).all()


@pytest.mark.parametrize("shift", [0.0, 1e-2])
def test_what_crosses_exactly_or_clearly_not_stays(shift: float) -> None:
    tagged_mesh = crossed(shift)
    before = tagged_mesh.mesh.geometry.x.copy()
    assert bend_crossings(tagged_mesh) == 0
    assert (tagged_mesh.mesh.geometry.x == before).all()


def test_the_seam_of_two_bodies_stays() -> None:
    """The centres of four squares along the diagonal lie on the seam."""
    assert bend_crossings(crossed(1e-9, bodies=2)) == SIZE**2 - SIZE


def test_lines_at_which_the_slope_of_a_pore_pressure_changes_stay() -> None:
    """The pore pressure is linear in each cell, and moved vertices would change this."""
    tagged_mesh = crossed(1e-9)
    stays = on_kinks(tagged_mesh, [PorePressure("below", "10*abs(x - y)")])
    assert bend_crossings(tagged_mesh, stays) == SIZE**2 - SIZE
    smooth = on_kinks(
        crossed(1e-9), [PorePressure("below", "10*(x - y)"), PorePressure("below", 2)]
    )
    assert not smooth.any()


def test_lines_at_which_the_slope_of_a_strength_changes_stay() -> None:
    tagged_mesh = crossed(1e-9)
    stays = on_kinks(tagged_mesh, [], [("below", Formula("2 + abs(x - y)"))])
    assert bend_crossings(tagged_mesh, stays) == SIZE**2 - SIZE
    assert not on_kinks(crossed(1e-9), [], [("below", Formula("2 + x - y"))]).any()
