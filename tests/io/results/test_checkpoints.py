"""Test that checkpoints return the written values at the same places on any number of ranks."""

import dataclasses
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from demos.verification.corner_seat import in_elastic_seat, in_rigid_seat
from meshes.corner_seat import write_corner_seat
from perfplast_fenicsx import Level, Problem, State, interpolation_points, read_gmsh
from perfplast_fenicsx.io.results.checkpoints import Checkpoints, Saved
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import checksum, set_checksum
from perfplast_fenicsx.limit_analysis.limit_search import Search
from perfplast_fenicsx.mesh.global_ordering import Block, Ordering
from perfplast_fenicsx.problem.assembled.spaces import space_at_points
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from tests.io.results.test_result_folder import report

SEATS = {"elastic": in_elastic_seat, "rigid": in_rigid_seat}


def displacement(x: np.ndarray, gdim: int, size: float) -> np.ndarray:
    return size * np.array([np.sin(2 * x[0]) * x[1], np.cos(x[0]), x[0] * x[1] + x[2]])[:gdim]


def closed(problem: Problem, shift: float) -> np.ndarray:
    """Return flags of the pairs, equal on any rank: at each node some of its faces."""
    rows = problem.constraints
    x = problem.V.tabulate_dof_coordinates()[rows.host]
    along = rows.normal @ np.array([4.0, 7.0, 5.0])[: rows.normal.shape[1]]
    flags: np.ndarray = np.sin(31 * x @ [1.0, 0.7, 0.3] + along + 2 * rows.surface + shift) > 0
    return flags


def state(problem: Problem, size: float) -> State:
    u = fem.Function(problem.V)
    gdim = problem.tagged_mesh.mesh.geometry.dim
    u.interpolate(lambda x: displacement(x, gdim, size))
    return State(u, size, 2 * size, closed(problem, size), history(problem, size))


def history(problem: Problem, size: float) -> dict[str, fem.Function]:
    """Return internal variables at the points: a number, a Mandel vector and another vector."""
    mesh = problem.tagged_mesh.mesh
    spaces = {
        "hardening": problem.Q,
        "plastic_strain": problem.S,
        "of_seven": space_at_points(mesh, problem.degree, (7,)),
    }
    variables = {name: fem.Function(space, name=name) for name, space in spaces.items()}
    for number, f in enumerate(variables.values()):
        width = f.function_space.dofmap.index_map_bs
        x = ufl.SpatialCoordinate(mesh)[0]
        values = [size * (number + 1 + x) ** (power + 1) for power in range(width)]
        points = interpolation_points(f.function_space.element)
        value = ufl.as_vector(values) if width > 1 else values[0]
        f.interpolate(fem.Expression(value, points))
        f.x.scatter_forward()
    return variables


def stress(problem: Problem, state: State) -> fem.Function:
    fields = QuadratureFields(problem)
    fields.u.x.array[:] = state.u.x.array
    fields.update()
    return fields.stress


@pytest.mark.long(but=["True-2-1-elastic"])
@pytest.mark.mpi3("True-2-1-elastic")
@pytest.mark.parametrize("seat", SEATS)
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (3, 2)])
@pytest.mark.parametrize("gather", [True, False])
def test_other_ranks_read_what_was_written(
    seat: str, dim: int, degree: int, gather: bool, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    """All ranks write and each rank reads alone, or one rank writes and all ranks read."""
    file = shared_tmp_path / "corner.msh"
    if comm.rank == 0:
        write_corner_seat(file, dim=dim, size=0.5)
    comm.barrier()
    together = SEATS[seat](read_gmsh(comm, file), degree)
    alone = SEATS[seat](read_gmsh(MPI.COMM_SELF, file), degree)
    assert 0 < together.num_pairs == alone.num_pairs
    assert len(np.unique(alone.constraints.host)) < alone.num_pairs  # nodes with two normals
    source, target = (together, alone) if gather else (alone, together)

    case = {"mesh": {"file": "corner.msh"}}
    path = shared_tmp_path / "results"
    now, before = state(source, 2e-3), state(source, 1e-3)
    reports = [report(s.zeta, alpha=s.alpha) for s in (before, now)]
    sigma = stress(source, now)
    level = Level(now, sigma, contact_forces(source, sigma, now.zeta), reports[-1])
    search = Search([(0.1, 0.2), (0.3, 0.4)], [0.5], 0.6, True, False, "so", 7)
    if gather or comm.rank == 0:
        folder = ResultFolder(source.comm, path)
        folder.create()
        writer = Checkpoints(folder, source, case, "1.2.3")
        writer.write(Saved(reports, level, before, search, {"solve": 1.5}))
    comm.barrier()

    folder = ResultFolder(target.comm, path, restart=True)
    saved = Checkpoints(folder, target, case, "1.2.3").read()
    assert [dataclasses.asdict(r) for r in saved.reports] == [
        dataclasses.asdict(r) for r in reports
    ]
    assert (saved.search, saved.timings) == (search, {"solve": 1.5})
    assert saved.level is not None
    assert saved.before is not None
    for read, size in ((saved.level.state, 2e-3), (saved.before, 1e-3)):
        expected = state(target, size)
        assert (read.zeta, read.alpha) == (size, 2 * size)
        np.testing.assert_allclose(read.u.x.array, expected.u.x.array, rtol=1e-13, atol=1e-15)
        assert np.array_equal(read.active, expected.active)
        assert list(read.history) == list(expected.history)
        for name, f in expected.history.items():
            values = read.history[name].x.array
            assert np.abs(values).max(initial=0) > 0 or not values.size
            np.testing.assert_allclose(values, f.x.array, rtol=1e-13, atol=1e-15)
    of_state = stress(target, saved.level.state)
    largest = target.comm.allreduce(np.abs(of_state.x.array).max(initial=0), MPI.MAX)
    difference = np.abs(saved.level.stress.x.array - of_state.x.array).max(initial=0)
    assert difference < 1e-12 * largest
    flags = target.comm.allreduce(int(saved.level.state.active.sum()))
    assert 0 < flags < target.num_pairs


@pytest.mark.mpi3
def test_an_order_of_any_keys(comm: MPI.Intracomm) -> None:
    keys = np.random.default_rng(3).permutation(1000)[:57]
    ours = np.array_split(keys, comm.size)[comm.rank] if comm.size > 1 else keys
    ours = ours[:0] if comm.size > 2 and comm.rank == 1 else ours
    everyone = np.sort(np.concatenate(comm.allgather(ours)))
    ordering = Ordering(comm, ours)
    assert ordering.total == len(everyone)
    assert np.array_equal(everyone[ordering.numbers()], ours)
    values = np.stack([ours, 2 * ours], axis=1)
    block = ordering.to_blocks(values)
    mine = everyone[ordering.first : ordering.first + ordering.count]
    assert np.array_equal(block, np.stack([mine, 2 * mine], axis=1))
    assert np.array_equal(ordering.from_blocks(block), values)


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.uint8])
def test_checksums_see_values_and_places(comm: MPI.Intracomm, dtype: type) -> None:
    values = np.arange(60, dtype=dtype).reshape(20, 3)
    bounds = np.linspace(0, 20, comm.size + 1).astype(int)

    def of(array: np.ndarray) -> int:
        mine = array[bounds[comm.rank] : bounds[comm.rank + 1]]
        return checksum(comm, Block(np.ascontiguousarray(mine), int(bounds[comm.rank]), 20))

    assert of(values) == checksum(MPI.COMM_SELF, Block(values, 0, 20))
    exchanged, changed = values.copy(), values.copy()
    exchanged[[3, 15]] = values[[15, 3]]
    changed[7, 1] += 1
    assert len({of(values), of(exchanged), of(changed)}) == 3


def test_a_checksum_of_a_set(comm: MPI.Intracomm) -> None:
    rows = np.random.default_rng(1).integers(0, 99, size=(30, 3))
    shuffled = rows[np.random.default_rng(2).permutation(30)]
    expected = set_checksum(MPI.COMM_SELF, rows)
    assert set_checksum(comm, np.array_split(shuffled, comm.size)[comm.rank]) == expected
    rows[4] = rows[4, ::-1] + 1
    assert set_checksum(MPI.COMM_SELF, rows) != expected
