"""Test shakedown from a case file: terminal, files, pictures, and refusals."""

import csv
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.verdict import verdict_on
from tests.case_runs import assert_case_refused, run_case

CASE = """
mesh = { builder = "stacked_blocks", n = 1 }
tie = [{ primary = "lower_top", secondary = "upper_bottom" }]
support = [
    { on = "x0", components = "x" },
    { on = "y0", components = "y" },
    { on = "bottom", components = "z" },
    { on = "top", components = "x" },
]
load = [
    { on = "top", traction = [0.0, 0.0, 1.0], name = "pull" },
    { on = "top", traction = [0.0, 0.0, 1.0], name = "stays", constant = true },
]
temperature = [{ on = "lower", change = 100.0, name = "heat" }]
loading = { control = "shakedown", ranges = { pull = [0, 1], heat = [0, 1] }, directions = 3 }
output = { pictures = false }
[material.lower]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 100.0
expansion = 1e-5
[material.upper]
law = "elastic"
young = 2e5
poisson = 0.3
"""


@pytest.mark.mpi2
def test_a_run(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_case(comm, shared_tmp_path, CASE, capsys, "--report")
    assert run.status == SOLVED
    out, folder = run.out, run.folder
    assert "are ignored" not in out  # temperatures matter
    assert "Shakedown to " in out
    assert "the elastic stresses are those of this mesh" in out
    assert "At 45 degrees: " in out
    assert "A factor of 1 is traction (0, 0, 1) on 'top'." in out
    assert "zeta" not in out
    limit: dict[str, Any] = run.summary["limit"]
    found = limit["shakedown"]
    assert limit["levelled_off"]
    assert found["names"] == ["pull", "heat"]
    assert len(found["corners"]) == 4
    assert found["load"] == pytest.approx(found["koiter"], rel=2e-4)
    alone = found["diagram"][0]
    assert alone["second"] == 0.0
    assert alone["first"] > 99.0  # a separate bar; glued bodies would prevent it from narrowing
    assert limit["body"] is None
    if comm.rank == 0:
        with (folder / "path.csv").open(encoding="utf-8", newline="") as file:
            assert [float(row["angle"]) for row in csv.DictReader(file)] == [0.0, 45.0, 90.0]
        verdict = verdict_on(ResultReader(folder))
        assert verdict.mark == "found"
        assert "1 × pull, 1 × heat" in verdict.details[0]
        page = (folder / "report.html").read_text(encoding="utf-8")
        assert "Melan" in page
        assert "A factor of 1 is traction" in page


@pytest.mark.long
@pytest.mark.serial
def test_pictures(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(CASE.replace("pictures = false", "pictures = true"))
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r")]) == SOLVED
    for name in ("shakedown.png", "mechanism.png"):
        assert (tmp_path / "r" / name).stat().st_size > 10_000


def test_constant_loads_that_are_too_much(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = CASE.replace('1.0], name = "stays"', '120.0], name = "stays"')
    text = text.replace(", directions = 3", "")
    run = run_case(comm, shared_tmp_path, text, capsys)
    assert run.status == NO_SOLUTION
    assert "No shakedown load was found" in run.out


RANGES = "ranges = { pull = [0, 1], heat = [0, 1] }"


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        (RANGES, "limit_tolerance = 1e-4", "has neither ranges nor corners"),
        (RANGES, RANGES + ", corners = [{ pull = 1 }]", "has both ranges and corners"),
        (RANGES, "ranges = {}", "ranges is empty"),
        (RANGES, "ranges = { pull = [1, 1] }", "[1, 1] is not a valid range for 'pull'"),
        (RANGES, "ranges = { pull = [1, 0] }", "[1, 0] is not a valid range for 'pull'"),
        (RANGES, "ranges = { pull = [], heat = [0, 1] }", "[] is not a valid range for 'pull'"),
        (RANGES, "ranges = { pull = [0, nan] }", "[0, nan] is not a valid range for 'pull'"),
        (RANGES, "corners = []", "two different corners"),
        (RANGES, "corners = [{ pull = 1 }, { pull = inf }]", "a factor that is not finite"),
        (RANGES, "corners = [{ pull = 1, heat = 1 }]", "two different corners"),
        (RANGES, "ranges = { pul = [0, 1], heat = [0, 1] }", "'pul' varies, but no load"),
        (RANGES, "ranges = { stays = [0, 1], heat = [0, 1] }", "this load is constant"),
        (RANGES + ", directions = 3", "ranges = { heat = [0, 1] }", "the load 'pull' has no range"),
        ("directions = 3", "directions = 2", "directions = 2, and the number"),
        ("tie = [", "contact = [", "[[tie]]"),
        (
            'law = "von-mises"\nyoung = 2e5\npoisson = 0.3\nyield_stress = 100.0',
            'law = "mohr-coulomb"\nyoung = 2e5\npoisson = 0.3\ncohesion = 0\nfriction_angle = 30',
            "cohesion = 0 in volume 'lower': shakedown needs a positive",
        ),
        (
            'components = "x" },\n]',
            'components = "x", value = 0.1 },\n]',
            "or a rigid surface moves",
        ),
    ],
)
def test_refused_in_one_sentence(
    old: str,
    new: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert old in CASE
    assert_case_refused(comm, shared_tmp_path, CASE.replace(old, new), part, capsys)
