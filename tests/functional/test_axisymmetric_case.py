"""Test ``[model] kind = "axisymmetric"`` from the case file to every output, and refusals."""

import csv
import json
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.ring import write_ring
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.proof import check
from tests.functional.test_command_line import one_line, write

CASE = """
[mesh]
file = "ring.msh"
[model]
kind = "axisymmetric"
[material.ring]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 300.0
[[support]]
on = "bottom"
components = "y"
[[load]]
on = "top"
pressure = 1.0
[loading]
control = "load"
values = [100.0]
[output]
pictures = false
[units]
length = "mm"
stress = "MPa"
"""
BUILDER = 'builder = "punch"\nn = 2'
LIMIT = '[loading]\ncontrol = "bounds"'


def written(comm: MPI.Intracomm, folder: Path, text: str, inner: float = 1.0) -> Path:
    """Write a case and its mesh."""
    if comm.rank == 0:
        write_ring(folder / "ring.msh", inner=inner, size=0.5)
    return write(comm, folder, text)


def test_forces_are_told_to_be_of_the_full_turn(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    case, results = written(comm, shared_tmp_path, CASE), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    force = 100 * 3.141592653589793 * 3
    if comm.rank == 0:
        assert ", P1, axisymmetric, " in out
        assert (
            "Forces of the full turn (r: outward, summed around the axis; z: along the axis) (N) at"
            in out
        )
    assert main(["info", str(case)]) == SOLVED
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert "refer to the full turn" in out
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    assert summary["model"]["kind"] == "axisymmetric"
    assert summary["model"]["axes"] == "rz"
    assert "full turn" in summary["model"]["forces"]
    (row,) = csv.DictReader((results / "path.csv").read_text(encoding="utf-8").splitlines())
    assert float(row["support_bottom_z"]) == pytest.approx(force, rel=1e-10)
    assert float(row["loads_z"]) == pytest.approx(-force, rel=1e-12)
    assert {"support_bottom_r", "loads_r"} <= set(row)
    scene = json.loads((results / "scene.json").read_text(encoding="utf-8"))
    assert scene["axisymmetric"] is True


@pytest.mark.mpi2
def test_bounds_are_strict_and_proven(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    """A steel ring between rigid ends carries exactly 300."""
    loading = CASE[CASE.index("[loading]") : CASE.index("[output]")]
    text = CASE.replace(loading, f"{LIMIT}\n").replace("pictures = false", "pictures = true")
    case, results = written(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    if comm.rank == 0:
        assert "both bounds are strict" in out
    body = json.loads((results / "summary.json").read_text(encoding="utf-8"))["limit"]["body"]
    assert body["strict"] is True
    assert 299 < body["lower"] <= 300 * (1 + 1e-9) <= body["upper"] * (1 + 2e-9) < 301
    found = check(results / "bounds.h5")
    assert not any(half.faults for half in found.values())
    assert (results / "mechanism.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("old", "new", "inner", "words"),
    [
        ("young", "young", -0.1, ["[model]", "extends to x = -0.1", "x is the radius"]),
        ('file = "ring.msh"', BUILDER, 1.0, ["[model]", "has tetrahedra", "remove kind"]),
        ('"axisymmetric"', '"axisymetric"', 1.0, ["[model]", "give 'plane-strain'"]),
        ('"y"\n', '"z"\n', 1.0, ["components = 'z'", "'xy'"]),
    ],
)
def test_one_sentence_and_status_2(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    old: str,
    new: str,
    inner: float,
    words: list[str],
) -> None:
    case = written(comm, shared_tmp_path, CASE.replace(old, new), inner)
    assert main(["check", str(case)]) == BAD_INPUT
    sentence = one_line(comm, capsys)
    for word in words:
        assert word in sentence


def test_plane_strain_may_be_named_but_not_in_space(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    plane = CASE.replace('"axisymmetric"', '"plane-strain"').replace('"y"\n', '"xy"\n')
    assert main(["check", str(written(comm, shared_tmp_path, plane))]) == SOLVED
    capsys.readouterr()
    case = write(comm, shared_tmp_path, plane.replace('file = "ring.msh"', BUILDER))
    assert main(["check", str(case)]) == BAD_INPUT
    assert "applies only to meshes of triangles" in one_line(comm, capsys)
