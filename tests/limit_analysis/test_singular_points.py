"""Test where bounds need fans of cells: ends of loads, supports, contacts; re-entrant corners."""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import pytest

from meshes.platens import write_platens
from meshes.strip_footing import DEPTH, WIDTH, write_strip_footing
from meshes.tube_polygon import write_tube_polygon
from perfplast_fenicsx import Contact, Pressure, Support, TaggedMesh
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.finer_meshes import largest_shares
from perfplast_fenicsx.limit_analysis.body.singular_points import (
    angles_at_corners,
    singular_edges,
    singular_points,
    wide_corners,
)
from perfplast_fenicsx.mesh.bisection import edges_of_simplex
from perfplast_fenicsx.mesh.refinement import spread
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.declared.given import Given
from tests.mesh.test_meshes import check_interface
from tests.models import Read

GROUND = [Support("x0", "x"), Support("bottom"), Support("side")]
MANY = 1000


def declared(
    supports: Sequence[Support], loads: Sequence[Pressure], contacts: Sequence[Contact] = ()
) -> Given:
    """Return supports, loads and contacts; the laws are irrelevant."""
    return Given({}, supports, loads, contacts, [], 2, [], [], [])


def places(tagged_mesh: TaggedMesh, given: Given, valence: int = MANY) -> set[tuple[float, float]]:
    """Return the coordinates of the singular points on all ranks."""
    x = corners(tagged_mesh.mesh)[1][singular_points(tagged_mesh, given, valence)]
    return {
        (float(a), float(b))
        for part in tagged_mesh.mesh.comm.allgather(np.round(x, 9) + 0.0)
        for a, b in part
    }


def test_the_end_of_a_load(read: Read) -> None:
    ground = read(write_strip_footing)
    footing = declared(GROUND, [Pressure("footing", 1.0)])
    assert places(ground, footing) == {(1.0, 0.0)}
    assert places(ground, footing, valence=3) == set()
    everywhere = [Pressure("footing", 1.0), Pressure("free", 1.0)]
    assert places(ground, declared(GROUND, everywhere)) == set()
    stepped = [Pressure("footing", 1.0), Pressure("free", 2.0)]
    assert places(ground, declared(GROUND, stepped)) == {(1.0, 0.0)}


@pytest.mark.mpi2
def test_the_end_of_a_contact(read: Read) -> None:
    """The point belongs to the ground; the corner of the punch is not singular."""
    assembly = read(write_strip_footing, punch=True)
    contact = Contact("ground_footing", "punch_footing")
    given = declared(GROUND, [Pressure("top", 1.0)], [contact])
    assert places(assembly, given) == {(1.0, 0.0)}
    points = singular_points(assembly, given, MANY)
    owned = points < assembly.mesh.topology.index_map(0).size_local
    assert assembly.mesh.comm.allreduce(np.count_nonzero(owned)) == 1
    assert (WIDTH, -DEPTH) not in places(assembly, given)


def test_a_straight_side_of_one_kind_has_none(read: Read) -> None:
    block = read(write_platens)
    pressed = declared([Support("x0", "x"), Support("y0", "y")], [Pressure("top", 1.0)])
    assert places(block, pressed) == set()


def test_fans_where_a_load_ends_are_long(read: Read) -> None:
    """Fans are as long as the former cells, with no cells in the 42° beside either side."""
    ground = read(write_strip_footing, width=3.0, depth=2.0, grading=1.0, size=1.0)
    given = declared(GROUND, [Pressure("footing", 1.0)])
    assert not wide_corners(ground, declared(GROUND, []))[0].any()
    reach, comm = [], ground.mesh.comm
    for _ in range(6):
        wide, there = wide_corners(ground, given)
        x = corners(ground.mesh)[1][corners(ground.mesh)[0][: len(there)]]
        away = np.linalg.norm(x - (1.0, 0.0), axis=2)
        here = there.any(axis=1)
        assert (away[here].min(axis=1) < 1e-9).all()
        reach.append(comm.allreduce(away[here].max(initial=0.0), MPI.MAX))
        if not comm.allreduce(int(wide.sum())):
            break
        ground = spread(ground, wide, there).tagged_mesh
    assert len(reach) > 2
    np.testing.assert_allclose(reach, reach[0])
    angles = comm.allgather(np.rad2deg(angles_at_corners(x)[there]))
    assert np.concatenate(angles).sum() == pytest.approx(180.0)
    assert np.count_nonzero(np.concatenate(angles) < 7.5) >= 12


@pytest.mark.long
def test_fans_are_narrower_the_nearer_bounds_are(read: Read) -> None:
    """Cells span 7.5°, then half of this angle for gaps below 0.4 %, and again below 0.1 %."""
    ground = read(write_strip_footing, width=3.0, depth=2.0, grading=1.0, size=1.0)
    given = declared(GROUND, [Pressure("footing", 1.0)])
    for gap, widest in ((None, 7.5), (0.005, 7.5), (0.003, 3.75), (0.0009, 1.875)):
        for _ in range(6):
            wide, there = wide_corners(ground, given, gap)
            ground = spread(ground, wide, there).tagged_mesh
        assert not wide_corners(ground, given, gap)[0].any()
        x = corners(ground.mesh)[1][corners(ground.mesh)[0]]
        here = wide_corners(ground, given)[1]
        angles = np.concatenate(ground.mesh.comm.allgather(angles_at_corners(x)[here]))
        narrow = np.rad2deg(angles[angles < np.deg2rad(widest)])
        assert narrow.sum() > 85.0
        assert narrow.max() > widest / 2


def test_fans_at_the_end_of_a_contact_match(read: Read) -> None:
    """Edges of the other body are also cut; meshes are the same on any number of ranks."""
    contact = Contact("ground_footing", "punch_footing")
    given = declared(GROUND, [Pressure("top", 1.0)], [contact])
    arguments = {"punch": True, "width": 3.0, "depth": 2.0, "grading": 1.0, "size": 1.0}
    assembly = read(write_strip_footing, **arguments)
    for _ in range(6):
        wide, there = wide_corners(assembly, given)
        pairs = opposite_vertices(assembly, [contact])
        assembly = spread(assembly, wide, there, pairs).tagged_mesh
    assert not wide_corners(assembly, given)[0].any()
    check_interface(assembly, "ground_footing", "punch_footing")


def test_corners_need_fewer_cells_the_less_the_stress_turns(read: Read) -> None:
    sides = 8
    hole = read(write_tube_polygon, lesser=True, size=np.pi / 2 / sides)
    given = declared([Support("x0", "x"), Support("y0", "y")], [Pressure("inner", 1.0)])
    found = {(x, y) for x, y in places(hole, given) if min(x, y) > 0}
    assert len(found) == sides - 1
    assert places(hole, given, valence=2 * sides) == set()  # one at a right angle; two at a corner


@pytest.mark.mpi3
def test_largest_shares(comm: MPI.Intracomm) -> None:
    mine = np.array([8.0, -1.0, 1.0 / (1 + comm.rank), 0.0])
    marked = largest_shares(comm, mine, 0.5)
    assert marked.tolist() == [True, False, False, False]
    most = largest_shares(comm, mine, 0.999999)
    assert most.tolist() == [True, False, True, False]
    assert not largest_shares(comm, np.zeros(3), 0.4).any()


def test_edges_in_space_where_a_pressure_ends() -> None:
    """The edges lie between the loaded square and the free surface, and nowhere else."""
    lower, upper = (0.0, 0.0, -1.0), (3.0, 3.0, 0.0)
    block = structured_mesh(
        MPI.COMM_WORLD,
        [Box("block", lower, upper, (3, 3, 1))],
        [
            Surface("pressed", ("block",), lambda x: (x[2] == 0) & (x[0] <= 1) & (x[1] <= 1)),
            Surface("x0", ("block",), lambda x: x[0] == 0),
            Surface("y0", ("block",), lambda x: x[1] == 0),
        ],
    )
    given = declared([Support("x0", "x"), Support("y0", "y")], [Pressure("pressed", 1.0)])

    def found(valence: int) -> set[tuple[float, ...]]:
        cells, points = corners(block.mesh)
        edges = singular_edges(block, given, valence)
        ends = points[cells[:, edges_of_simplex(3)][edges]]
        parts = block.mesh.comm.allgather(ends.mean(axis=1))
        return {tuple(map(float, middle)) for middle in np.concatenate(parts)}

    assert found(MANY) == {(1.0, 0.5, 0.0), (0.5, 1.0, 0.0)}
    assert found(2) == set()
