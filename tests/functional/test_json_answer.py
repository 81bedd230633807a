"""Test ``--json``: one object on standard output, with the keys of the command reference."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from docs import command_reference
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import doctor
from perfplast_fenicsx.cli.json_answer import COMMON, FIELDS
from perfplast_fenicsx.cli.parser import BAD_INPUT, FAULT, NO_SOLUTION, SOLVED
from perfplast_fenicsx.environment import environment_with_package
from perfplast_fenicsx.errors import UNLISTED
from tests.models_of_others.meshes import unv_text

COMM = MPI.COMM_WORLD

CASE = """
title = "two blocks"
[mesh]
builder = "two_blocks"
n = 1
[material.lower]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 450.0
[material.upper]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 450.0
[[support]]
on = "left"
[[load]]
on = "top"
traction = [0.0, 0.0, -1.0]
[[contact]]
primary = "upper_bottom"
secondary = "lower_top"
[element]
degree = 1
[loading]
values = [10.0, 20.0]
[output]
pictures = false
[units]
system = "mm-N-MPa"
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a case, the results of a run with bounds, and a model with its mesh."""
    folder = tmp_path_factory.mktemp("json")
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    bounds = CASE.replace("values = [10.0, 20.0]", 'control = "bounds"')
    bounds = bounds.replace("[element]\ndegree = 1\n", "")
    (folder / "bounds.toml").write_text(bounds, encoding="utf-8")
    (folder / "model.unv").write_text(unv_text(), encoding="utf-8")
    assert main(["run", str(folder / "bounds.toml"), "-o", str(folder / "out")]) == SOLVED
    return folder


def answer(
    capsys: pytest.CaptureFixture[str], *arguments: object, status: int = SOLVED
) -> dict[str, Any]:
    """Return the object that a command prints, after checks that hold for all commands."""
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == status
    printed = capsys.readouterr()
    found: dict[str, Any] = json.loads(printed.out)
    command = found["command"]
    assert command in {arguments[0], ""}
    assert set(found) == {*COMMON, *FIELDS.get(command, {})}
    assert found["exit_status"] == status
    assert (found["error"] is None) == (status == SOLVED)
    assert all(line in printed.err for line in found["text"])
    return found


@pytest.mark.serial
def test_run(place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "run", place / "case.toml", "-o", tmp_path / "new")
    stored = json.loads((tmp_path / "new" / "summary.json").read_text(encoding="utf-8"))
    assert found["summary"] == stored
    assert [step["zeta"] for step in stored["steps"]] == pytest.approx([10, 20])
    assert {"summary.json", "path.csv", "run.log"} <= set(found["files"])
    again = answer(capsys, "run", place / "case.toml", "-o", tmp_path / "new", status=BAD_INPUT)
    assert again["error"]["code"].startswith("result-folder-")
    assert again["summary"] is None


@pytest.mark.serial
def test_a_level_without_solution(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The status is the same as without the option, and there is no refusal."""
    (tmp_path / "case.toml").write_text(CASE.replace("20.0]", "1e5]"), encoding="utf-8")
    capsys.readouterr()
    arguments = ["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--json"]
    assert main(arguments) == NO_SOLUTION
    found = json.loads(capsys.readouterr().out)
    assert (found["exit_status"], found["error"]) == (NO_SOLUTION, None)
    assert not found["summary"]["steps"][-1]["converged"]


@pytest.mark.serial
def test_check_and_its_warnings(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = answer(capsys, "check", place / "case.toml")
    assert found["bodies"] == ["lower", "upper"]
    assert (found["cells"], found["contact_pairs"]) == (36, 6)
    assert found["warnings"] == []
    (tmp_path / "case.toml").write_text(CASE.replace("2e5", "2.0"), encoding="utf-8")
    warned = answer(capsys, "check", tmp_path / "case.toml")
    assert warned["warnings"]
    assert {one["code"] for one in warned["warnings"]}.isdisjoint({UNLISTED, ""})


@pytest.mark.serial
def test_a_refusal(place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = CASE.replace("poisson = 0.3", "poisson = 0.7", 1)
    (tmp_path / "bad.toml").write_text(bad, encoding="utf-8")
    found = answer(capsys, "check", tmp_path / "bad.toml", status=BAD_INPUT)
    error = found["error"]
    assert error["where"] == "bad.toml, [material.lower], poisson"
    assert error["remedy"].startswith("give Poisson's ratio")
    assert error["code"] == "elastic-2"
    wrong = answer(capsys, "run", place / "case.toml", "--fast", status=BAD_INPUT)
    assert wrong["error"]["code"].startswith("parser-")


@pytest.mark.serial
def test_what_reads_results(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    claim = answer(capsys, "claim", place / "out")
    assert claim["lower"] < claim["upper"]
    for command in (["report", place / "out"], ["export", place / "out", "--csv"]):
        files = answer(capsys, *command)["files"]
        assert files
        assert all(Path(file).is_file() for file in files)
    empty = answer(capsys, "claim", tmp_path, status=BAD_INPUT)
    assert empty["lower"] is None


@pytest.mark.serial
def test_what_the_program_knows(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    schema = answer(capsys, "schema", "-o", tmp_path / "schema.json")
    assert schema["schema"] == json.loads((tmp_path / "schema.json").read_text(encoding="utf-8"))
    names = answer(capsys, "template")["names"]
    tables = answer(capsys, "template", names[0])["tables"]
    assert {"design", "combination"} & set(tables)
    steel = answer(capsys, "materials", "--units", "SI")["materials"][0]
    assert float(steel["keys"]["young"]) > 1e10
    assert "PETSc" in answer(capsys, "info")["versions"]
    assert answer(capsys, "info", place / "case.toml")["bodies"] == ["lower", "upper"]


@pytest.mark.serial
@pytest.mark.usefixtures("undrawn")
def test_mesh_and_setup(
    place: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("perfplast_fenicsx.cli.mesh_command.draw_parts", lambda *of: None)
    found = answer(capsys, "mesh", place / "model.unv", "-o", tmp_path / "case")
    assert found["bodies"][0]["elements"] > 0
    assert {"case.msh", "case.toml"} <= set(found["files"])
    refused = answer(capsys, "setup", tmp_path, status=BAD_INPUT)
    assert refused["page"] is None


@pytest.mark.serial
def test_doctor_and_version(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "TRIALS", {"memory": lambda: doctor.Finding("ok", "enough")})
    assert answer(capsys, "doctor")["tests"] == [
        {"name": "memory", "verdict": "ok", "text": "enough"}
    ]
    version = answer(capsys, "--version")
    assert version["text"] == [version["program"]]


@pytest.mark.serial
def test_a_fault_of_the_program(
    place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("nothing to divide by")

    monkeypatch.setattr("perfplast_fenicsx.cli.commands.check", fail)
    found = answer(capsys, "check", place / "case.toml", status=FAULT)
    assert found["error"]["code"] == "fault"
    assert "nothing to divide by" in found["error"]["message"]


@pytest.mark.mpi2
def test_one_object_on_several_ranks(
    shared_tmp_path: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    path = shared_tmp_path / "case.toml"
    if comm.rank == 0:
        path.write_text(CASE, encoding="utf-8")
    comm.barrier()
    capsys.readouterr()
    assert main(["check", str(path), "--json"]) == SOLVED
    printed = comm.gather(capsys.readouterr().out)
    if printed is not None:
        own, *others = printed
        assert json.loads(own)["contact_pairs"] == 6
        assert others == [""] * (comm.size - 1)


@pytest.mark.serial
def test_as_a_program(place: Path, tmp_path: Path) -> None:
    """PETSc's output also goes to standard error."""
    arguments = ["run", str(place / "case.toml"), "-o", str(tmp_path / "out")]
    program = [sys.executable, "-m", "perfplast_fenicsx", *arguments]
    done = subprocess.run(
        [*program, "--json", "--", "-perfplast_ksp_view"],
        env=environment_with_package(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == SOLVED, done.stderr
    assert json.loads(done.stdout)["command"] == "run"
    assert "KSP Object" in done.stderr


def test_the_keys_are_documented() -> None:
    text = command_reference.reference()
    for keys in (COMMON, *FIELDS.values()):
        for key, meaning in keys.items():
            assert f"| `{key}` | {meaning} |" in text
