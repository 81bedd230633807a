"""The result folder: what it refuses, and that its files say what was computed."""

import csv
import dataclasses
import json
import math
import os
from pathlib import Path
from xml.etree import ElementTree

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx.contact.contact import Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_folder import (
    RESULT_FILES,
    STEP_KEYS,
    ResultFolder,
    Results,
    to_json,
)
from perfplast_fenicsx.io.results.xdmf import FieldsFile
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.problem.loads import Traction
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.report import LevelReport
from perfplast_fenicsx.problem.supports import Support

SUMMARY_KEYS = [
    *("title", "version", "method", "ranks", "mesh", "steps", "limit", "timings"),
    "peak_memory_mb",
]


def report(zeta: float, **changes: object) -> LevelReport:
    """A report with made-up numbers, all different."""
    values: dict[str, object] = {"converged": True, "reason": "criterion met, at last"}
    for number, field in enumerate(dataclasses.fields(LevelReport), start=1):
        if field.name not in values:
            values[field.name] = number if field.type is int else number / 8
    return LevelReport(**(values | {"zeta": zeta} | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Two elastic blocks."""
    assembly = build(MPI.COMM_WORLD, "two_blocks", n=1)
    materials = {name: Elastic(1.0, 0.3) for name in assembly.volumes}
    contact = Contact("upper_bottom", "lower_top")
    load = Traction("top", (0.0, 0.0, -1.0))
    return Problem(assembly, materials, [Support("left")], [load], [contact])


def refused(comm: MPI.Intracomm, path: Path, force: bool = False) -> str:
    """The sentence of a refusal, the same on every rank."""
    with pytest.raises(InputError) as caught:
        ResultFolder(comm, path, force).create()
    messages = comm.allgather(str(caught.value))
    assert len(set(messages)) == 1
    assert "\n" not in messages[0]
    assert str(path) in messages[0]
    return messages[0]


def test_a_folder_is_made_with_its_parents(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "a" / "b")
    assert not (shared_tmp_path / "a").exists()
    comm.barrier()
    folder.create()
    assert folder.path.is_dir()


def test_results_are_not_overwritten(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    old, other = shared_tmp_path / "fields.png", shared_tmp_path / "case.toml"
    if comm.rank == 0:
        old.write_text("old")
        other.write_text("mine")
    comm.barrier()
    message = refused(comm, shared_tmp_path)
    assert "fields.png" in message
    assert "--force" in message
    assert old.read_text() == "old"
    comm.barrier()

    folder = ResultFolder(comm, shared_tmp_path, force=True)
    assert old.exists()  # nothing is removed before all else is known to be right
    comm.barrier()
    folder.create()
    assert not old.exists()
    assert other.read_text() == "mine"


@pytest.mark.parametrize("below", ["", "deep/er"])
def test_a_file_is_no_folder(comm: MPI.Intracomm, shared_tmp_path: Path, below: str) -> None:
    file = shared_tmp_path / "file"
    if comm.rank == 0:
        file.write_text("mine")
    comm.barrier()
    assert "is not a folder" in refused(comm, file / below, force=True)
    assert file.read_text() == "mine"


def test_a_folder_that_cannot_be_made(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    assert "cannot be written" in refused(comm, Path("/proc/results"))
    if os.geteuid() != 0:
        locked = shared_tmp_path / "locked"
        if comm.rank == 0:
            locked.mkdir(mode=0o500)
        comm.barrier()
        assert "no right to write" in refused(comm, locked / "results")


def test_writing_that_fails_later(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()

    def fail() -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left on device"):
        folder.on_root(fail)


def test_summary_and_path(comm: MPI.Intracomm, shared_tmp_path: Path, problem: Problem) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    results = Results(folder, problem, "A „title“", "1.2.3", "newton")
    summary = json.loads(folder.file("summary.json").read_text(encoding="utf-8"))
    assert list(summary) == SUMMARY_KEYS
    assert summary["title"] == "A „title“"
    assert (summary["version"], summary["method"], summary["ranks"]) == (
        "1.2.3",
        "newton",
        comm.size,
    )
    assert summary["mesh"] == {"cells": 36, "vertices": 32, "dofs": 96}
    assert (summary["steps"], summary["limit"]) == ([], None)
    assert summary["peak_memory_mb"] > 10
    comm.barrier()

    with results.timed("solve"):
        pass
    given = [report(1.0), report(2.0, duality_gap=math.nan, converged=False, max_penetration=-0.0)]
    for number, level in enumerate(given, start=1):
        results.add(level)
        text = folder.file("summary.json").read_text(encoding="utf-8")
        assert "NaN" not in text
        assert "-0.0" not in text
        summary = json.loads(text)
        assert len(summary["steps"]) == number
        with folder.file("path.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == number
        assert rows[-1]["step"] == str(number)
        for key, value in dataclasses.asdict(level).items():
            assert rows[-1][key] == str(value)
        comm.barrier()
    assert [list(step) for step in summary["steps"]] == [list(STEP_KEYS)] * 2
    assert summary["steps"][0]["alpha"] == given[0].alpha
    assert summary["steps"][1]["duality_gap"] is None
    assert summary["steps"][1]["converged"] is False
    assert list(summary["timings"]) == ["solve"]
    assert set(folder.found()) == {"summary.json", "path.csv"} <= set(RESULT_FILES)
    assert {entry.name for entry in folder.path.iterdir()} == {"summary.json", "path.csv"}


def test_json_of_numbers_that_are_not_finite() -> None:
    text = to_json({"a": [math.inf, -math.inf, (math.nan, 1.5)], "b": True, "c": None, "d": 3})
    assert json.loads(text) == {"a": [None, None, [None, 1.5]], "b": True, "c": None, "d": 3}


def test_fields_of_two_levels(comm: MPI.Intracomm, shared_tmp_path: Path, problem: Problem) -> None:
    mesh = problem.tagged_mesh.mesh
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    file = FieldsFile(folder, problem.tagged_mesh)
    u, q = fem.Function(problem.V), fem.Function(problem.Q)
    sigma = fem.Function(fem.functionspace(mesh, ("DG", 0, (3, 3))))
    for zeta in (0.5, 20.0):
        u.interpolate(lambda x, zeta=zeta: zeta * np.array([x[0], 2 * x[1], x[2] - x[0]]))
        q.x.array[:] = zeta
        sigma.x.array[:] = np.tile(zeta * np.arange(9.0), len(sigma.x.array) // 9)
        file.write({"displacement": u, "plastic": q, "stress": sigma}, zeta)

    root = ElementTree.parse(folder.file("fields.xdmf")).getroot()
    (series,) = root.findall("Domain/Grid")
    assert series.get("CollectionType") == "Temporal"
    steps = series.findall("Grid")
    times = [time.get("Value") for time in series.findall("Grid/Time")]
    assert [float(time or "nan") for time in times] == [0.5, 20.0]
    with h5py.File(folder.file("fields.h5"), "r") as data:

        def read(grid: ElementTree.Element, what: str) -> np.ndarray:
            item = grid.find(f"{what}/DataItem")
            assert item is not None
            name, _, place = (item.text or "").strip().partition(":")
            with h5py.File(folder.file(name), "r") as own:  # VTK's reader follows no links
                assert isinstance(own.get(place, getlink=True), h5py.HardLink)
                values = np.asarray(own[place])
            assert list(values.shape) == [int(n) for n in (item.get("Dimensions") or "").split()]
            return values

        for grid, zeta in zip(steps, (0.5, 20.0), strict=True):
            x, cells = read(grid, "Geometry"), read(grid, "Topology")
            assert x.shape == (32, 3)
            assert cells.shape == (36, 4)
            expected = zeta * np.column_stack([x[:, 0], 2 * x[:, 1], x[:, 2] - x[:, 0]])
            displacement = read(grid, "Attribute[@Name='displacement']")
            assert np.allclose(displacement, expected, atol=1e-14 * zeta)
            assert np.all(read(grid, "Attribute[@Name='plastic']") == zeta)
            stress = read(grid, "Attribute[@Name='stress']")
            assert np.allclose(stress, zeta * np.arange(9.0))
            body = read(grid, "Attribute[@Name='body']").ravel()
            upper = x[cells].mean(axis=1)[:, 2] > 1
            assert np.array_equal(body, np.where(upper, 2, 1))
        joined = np.asarray(data["Function/displacement/20_0"])  # by a link
        assert np.array_equal(joined, displacement)
        kinds = [attribute.get("AttributeType") for attribute in steps[0].findall("Attribute")]
        assert kinds == ["Scalar", "Vector", "Scalar", "Tensor"]
