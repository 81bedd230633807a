"""Test the result folder: refusals, and files that agree with the computation."""

import csv
import dataclasses
import json
import math
import os
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import NAMED
from perfplast_fenicsx.io.results.result_folder import (
    STEP_KEYS,
    ResultFolder,
    Results,
    result_files,
)
from perfplast_fenicsx.io.results.summary import to_json
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.problem.declared.loads import Traction
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.problem import Problem

SUMMARY_KEYS = [
    *(
        "title",
        "version",
        "method",
        "prescribed",
        "ranks",
        "mesh",
        "model",
        "given",
        "element_size",
        "loads",
        "seepage",
        "case",
        "report",
        "surroundings",
        "remarks",
        "warnings",
        "steps",
        "limit",
        "timings",
    ),
    "peak_memory_mb",
    "units",
    "planned",
]


def report(zeta: float, **changes: object) -> LevelReport:
    """Return a report with arbitrary numbers, all different."""
    values: dict[str, object] = {"converged": True, "reason": "criterion met, at last"}
    values |= {"stage": "pumping", "factors": {"water": 0.375}, "works": {"water": 3.5}}
    values |= {"driving_forces": {}, "bolts": {}}
    values["reactions"] = {"loads": [0.5, 0.0, -2.5], "support floor": [-0.5, 0.0, 2.5]}
    for number, field in enumerate(dataclasses.fields(LevelReport), start=1):
        if field.name not in values:
            values[field.name] = number if field.type is int else number / 8
    return LevelReport(**(values | {"zeta": zeta} | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Return a problem of two elastic blocks."""
    tagged_mesh = build(MPI.COMM_WORLD, "two_blocks", n=1)
    materials = {name: Elastic(1.0, 0.3) for name in tagged_mesh.volumes}
    contact = Contact("upper_bottom", "lower_top")
    load = Traction("top", (0.0, 0.0, -1.0))
    return Problem(tagged_mesh, materials, [Support("left")], [load], [contact])


def refused(comm: MPI.Intracomm, path: Path, force: bool = False) -> str:
    """Return the sentence of a refusal, which is the same on every rank."""
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
    assert old.exists()  # the program removes nothing before it has checked everything else
    comm.barrier()
    folder.create()
    assert not old.exists()
    assert other.read_text() == "mine"


def test_results_of_an_earlier_version_are_replaced_too(
    comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    if comm.rank == 0:
        (shared_tmp_path / "fields").mkdir()
        for name in ("model.json", "fields.xdmf", "fields.h5", "fields/0001.h5"):
            (shared_tmp_path / name).write_text("old")
    comm.barrier()
    assert "(model.json, fields.xdmf, fields.h5)" in refused(comm, shared_tmp_path)
    ResultFolder(comm, shared_tmp_path, force=True).create()
    assert [path.name for path in shared_tmp_path.iterdir()] == ["path.csv"]


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
        assert "no permission to write" in refused(comm, locked / "results")


@pytest.mark.mpi2
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
    results = Results(folder, problem, "A „title“", "1.2.3", "newton", Prescribed.LOAD_FACTOR)
    summary = json.loads(folder.file("summary.json").read_text(encoding="utf-8"))
    assert list(summary) == SUMMARY_KEYS
    assert summary["title"] == "A „title“"
    assert (summary["version"], summary["method"], summary["ranks"]) == (
        "1.2.3",
        "newton",
        comm.size,
    )
    assert summary["prescribed"] == "zeta"
    assert summary["mesh"] == {"cells": 36, "vertices": 32, "dofs": 96}
    assert (summary["steps"], summary["limit"]) == ([], None)
    assert summary["peak_memory_mb"] > 10
    comm.barrier()

    with results.timed("solve"):
        pass
    stage = {"stage": "load", "factors": {"push": 0.25}, "works": {"push": -3.5}}
    stage |= {"driving_forces": {"punch": 0.75}, "bolts": {"m12": 2.25}}
    wrong = {"duality_gap": math.nan, "converged": False, "max_penetration": -0.0}
    given = [report(1.0, **stage), report(2.0, **wrong, **stage)]
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
        numbers = dataclasses.asdict(level)
        forces, *named = (numbers.pop(key) for key in ("reactions", *map("{}s".format, NAMED)))
        for key, value in numbers.items():
            assert rows[-1][key] == str(value)
        assert [rows[-1][f"loads_{axis}"] for axis in "xyz"] == [*map(str, forces["loads"])]
        assert rows[-1]["support_floor_z"] == "2.5"
        assert (rows[-1]["factor_push"], rows[-1]["work_push"]) == ("0.25", "-3.5")
        assert rows[-1]["driving_force_punch"] == "0.75"
        assert named == [{"push": 0.25}, {"push": -3.5}, {"punch": 0.75}, {"m12": 2.25}]
        comm.barrier()
    assert [list(step) for step in summary["steps"]] == [list(STEP_KEYS)] * 2
    assert summary["steps"][0]["alpha"] == given[0].alpha
    assert summary["steps"][0]["reactions"] == given[0].reactions
    assert summary["steps"][1]["duality_gap"] is None
    assert summary["steps"][1]["converged"] is False
    assert list(summary["timings"]) == ["solve"]
    assert set(folder.found()) == {"summary.json", "path.csv"} <= set(result_files())
    assert {entry.name for entry in folder.path.iterdir()} == {"summary.json", "path.csv"}


def test_json_of_numbers_that_are_not_finite() -> None:
    text = to_json({"a": [math.inf, -math.inf, (math.nan, 1.5)], "b": True, "c": None, "d": 3})
    assert json.loads(text) == {"a": [None, None, [None, 1.5]], "b": True, "c": None, "d": 3}
