"""Test the results that a page contains, and those that a large page omits."""

import json
import shutil
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import Contact, Newton, Problem, Support, Traction, VonMises
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.report.packing import size_of
from perfplast_fenicsx.report.view_data import (
    _offered,
    as_number,
    chosen_levels,
    rows_of,
    skin_lines,
    view_data,
)
from perfplast_fenicsx.units import Units
from tests.report.test_packing import unpacked

pytestmark = pytest.mark.serial

STEEL = VonMises(206900.0, 0.29, 450.0)
LOAD = Traction("top", (0.0, 0.0, -1.0))
CONTACTS = [Contact("upper_bottom", "lower_top")]


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> ResultReader:
    """Return a reader of two blocks at three levels."""
    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, comm.bcast(tmp_path_factory.mktemp("run")))
    folder.create()
    materials = {"lower": STEEL, "upper": STEEL}
    mesh = build(comm, "two_blocks", n=1)
    problem = Problem(mesh, materials, [Support("left")], [LOAD], CONTACTS)
    newton = Newton(problem)
    scene = Scene("Blocks", [LOAD], CONTACTS, units=Units("mm", "MPa"))
    writer = ResultWriter(folder, problem, scene, "newton", prescribed=Prescribed.LOAD_FACTOR)
    for zeta in (10.0, 20.0, 30.0):
        writer.write(newton.solve(zeta))
    comm.barrier()
    return ResultReader(folder.path)


def test_the_view_is_that_of_the_results(reader: ResultReader) -> None:
    data = view_data(reader).data
    assert data is not None
    skin = reader.skin.surface
    points = np.column_stack([unpacked(axis) for axis in data["points"]])
    assert np.allclose(points, skin.points, atol=1e-4)
    assert data["names"] == ["lower", "upper"]
    triangles = unpacked(data["triangles"]).reshape(-1, 3)
    starts = data["triangleStarts"]
    assert starts[-1] == len(triangles) == len(skin.triangles)
    upper = points[triangles[starts[1] : starts[2]]]
    assert upper[..., 2].min() == pytest.approx(1.0, abs=1e-4)
    assert [state["mechanism"] for state in data["states"]] == [False] * 3
    assert data["states"][0]["title"] == "step 1 of 3: ζ = 10"
    for state, level in zip(data["states"], reader.levels, strict=True):
        u = reader.surface(level).at_points["displacement"]
        found = np.column_stack([unpacked(axis) for axis in state["motion"]])
        assert np.allclose(found, u, atol=1e-4 * np.abs(u).max())
        assert state["largest"] == pytest.approx(np.linalg.norm(u, axis=1).max(), rel=1e-4)
        assert unpacked(state["fields"]["stress"]["values"]).max() <= 450.1
    offered = {field["name"]: field for field in data["fields"]}
    assert list(offered)[:2] == ["stress", "yield_ratio"]
    assert (offered["stress"]["unit"], offered["displacement"]["unit"]) == ("MPa", "mm")
    assert offered["stress"]["low"] == pytest.approx(0.0)


def test_loads_and_supports_are_around_the_bodies(reader: ResultReader) -> None:
    """Arrows push on the top along −z; ticks on the left end lie along all three axes."""
    data = view_data(reader).data
    assert data is not None
    points = reader.skin.surface.points
    lines = {}
    for mark in data["marks"]:
        anchors = points[unpacked(mark["anchors"])]
        offsets = np.column_stack([unpacked(axis) for axis in mark["offsets"]])
        lines[mark["kind"]] = (anchors, (anchors + offsets).reshape(-1, 2, 3))
    anchors, arrows = lines["loads"]
    top = points[:, 2].max()
    assert np.allclose(anchors[:, 2], top)
    shafts = arrows[::3]
    assert np.allclose(shafts[:, 1, 2], top, atol=1e-3)
    along = shafts[:, 1] - shafts[:, 0]
    assert np.allclose(along[:, :2], 0.0, atol=1e-3)
    assert np.all(along[:, 2] < -0.05)
    anchors, ticks = lines["supports"]
    assert np.allclose(anchors[:, 0], points[:, 0].min())
    axes = np.abs(ticks[:, 1] - ticks[:, 0]).argmax(axis=1)
    assert set(axes.tolist()) == {0, 1, 2}


@pytest.mark.parametrize(("low", "shown"), [(-1.77e-14, 0.0), (-2.0, -2.0), (3.0, 0.0)])
def test_scales_begin_at_zero_but_for_what_is_below(low: float, shown: float) -> None:
    states = [{"fields": {"stress": {"low": low, "high": 5.0, "whole": True}}}]
    (field,) = _offered(states, {})
    assert field["low"] == pytest.approx(shown, abs=1e-300)


def test_numbers_that_are_not_finite_are_left_out_of_ranges(
    reader: ResultReader, shared_tmp_path: Path
) -> None:
    folder = shared_tmp_path / "spoilt"
    if MPI.COMM_WORLD.rank == 0:
        shutil.copytree(reader.path, folder)
        with h5py.File(folder / reader.levels[-1].file, "r+", locking=False) as file:
            file["VTKHDF/CellData/yield_ratio"][...] = np.nan
            file["VTKHDF/PointData/displacement"][::2] = np.inf
    MPI.COMM_WORLD.barrier()
    view = view_data(ResultReader(folder))
    data = view.data
    assert data is not None
    assert ["utilisation" in text for text in view.remarks].count(True) == 1
    assert not any("von Mises" in text for text in view.remarks)
    json.dumps(data, allow_nan=False)
    assert data["states"][-1]["fields"]["yield_ratio"]["high"] == pytest.approx(0.0)
    assert 0 < data["states"][-1]["largest"] < np.inf


def test_a_large_run_loses_levels_then_fields_then_the_view(reader: ResultReader) -> None:
    whole = view_data(reader)
    assert whole.data is not None
    assert whole.remarks == []
    size = size_of(whole.data)
    one = size_of(whole.data["states"][-1])
    fewer = view_data(reader, room=size - one // 2)
    assert fewer.data is not None
    assert [state["title"][:6] for state in fewer.data["states"]] == ["step 1", "step 3"]
    assert "2 of 3 levels" in fewer.remarks[0]
    poorer = view_data(reader, room=size - 2 * one - one // 4)
    assert poorer.data is not None
    assert set(poorer.data["states"][0]["fields"]) < set(whole.data["states"][0]["fields"])
    assert "most important fields" in poorer.remarks[0]
    assert size_of(poorer.data) < size - 2 * one - one // 4
    assert view_data(reader, room=1000).data is None


def test_levels_that_are_chosen() -> None:
    assert chosen_levels(0, 5) == []
    assert chosen_levels(3, 5) == [0, 1, 2]
    assert chosen_levels(9, 3) == [0, 4, 8]
    assert chosen_levels(9, 0) == [8]


def test_lines_are_the_edges_of_the_blocks(reader: ResultReader) -> None:
    surface = reader.skin.surface
    lines, body = skin_lines(surface)
    ends = surface.points[lines]
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    assert lengths == pytest.approx(np.abs(along).max(axis=1))  # none across a face
    for number in range(2):  # each block is 3 × 1 × 1
        assert lengths[body == number].sum() == pytest.approx(4 * (3 + 1 + 1))


def test_numbers_of_vectors_and_tensors() -> None:
    shear = np.zeros((1, 3, 3))
    shear[0, 0, 1] = shear[0, 1, 0] = 2.0
    uniaxial = np.array([[-5.0, 0, 0, 0, 0, 0, 0, 0, 0]])
    assert as_number("stress", shear) == pytest.approx([2 * np.sqrt(3)])
    assert as_number("stress", uniaxial) == pytest.approx([5.0])
    assert as_number("plastic_strain", np.diag([1.0, -0.5, -0.5])[None]) == pytest.approx([1.0])
    assert as_number("displacement", np.array([[3.0, 0.0, 4.0]])) == pytest.approx([5.0])


def test_rows_are_read_slab_by_slab(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("perfplast_fenicsx.report.view_data.SLAB", 4)
    data, rows = np.arange(40.0).reshape(20, 2), np.array([0, 3, 4, 4, 11, 19])
    assert rows_of(data, rows) == pytest.approx(data[rows])
