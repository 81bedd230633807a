"""Test interaction diagrams from a case file: proofs, picture, page, and refusals."""

import csv
import json
import math
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from meshes.footing import write_footing
from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.report.verdict import verdict_on
from tests.case_runs import CaseRun, assert_case_refused, run_case

CASE = """
[mesh]
file = "ground.msh"
[material.ground]
law = "von-mises"
young = 200.0
poisson = 0.3
yield_stress = 1.7320508075688772
[[support]]
on = "x0"
components = "x"
[[support]]
on = "side"
components = "x"
[[support]]
on = "bottom"
[[load]]
name = "V"
on = "footing"
pressure = 1.0
[[load]]
name = "H"
on = "footing"
traction = [1.0, 0.0]
[loading]
control = "envelope"
first = ["V"]
second = ["H"]
until = 0.3
directions = 8
[output]
pictures = false
"""


@pytest.mark.long
def test_a_footing(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The ground carries a pressure alone up to (2 + π)k, and a shear stress up to k."""
    if comm.rank == 0:
        write_strip_footing(shared_tmp_path / "ground.msh", size=0.5, grading=1.0)
    run = run_case(comm, shared_tmp_path, CASE, capsys, "--report")
    out, folder = run.out, run.folder
    assert "At 0 degrees: lower bound " in out
    assert "At 90 degrees: lower bound " in out
    limit: dict[str, Any] = run.summary["limit"]
    rows = limit["envelope"]["rows"]
    assert len(rows) == 91
    assert rows[0]["carried"] < 2 + math.pi < rows[0]["not carried from"]
    assert rows[90]["carried"] <= 1.0 + 1e-6 <= rows[90]["not carried from"] + 2e-6
    for row in rows:
        assert row["carried"] <= row["not carried from"]
    if comm.rank == 0:
        with (folder / "path.csv").open(encoding="utf-8", newline="") as file:
            assert len(list(csv.DictReader(file))) == 91
        for (angle,) in limit["envelope"]["directions"]:
            proven = check(folder / f"direction_{angle:06.2f}.h5")
            assert not any(half.faults for half in proven.values())
        reader = ResultReader(folder)
        verdict = verdict_on(reader)
        assert "All pairs inside one polygon are carried for certain" in verdict.sentence
        assert "'V'" in verdict.details[0]
        assert "envelope" in (folder / "report.html").read_text(encoding="utf-8")
    goes_on(comm, shared_tmp_path / "case.toml", run, capsys)


def goes_on(
    comm: MPI.Intracomm, case: Path, run: CaseRun, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run was killed after three directions. A restart computes the last of them and the rest."""
    folder = run.folder
    kept, path, before = 3, folder / "directions.json", dict[str, Any]()
    if comm.rank == 0:
        rows = json.loads(path.read_text(encoding="utf-8"))
        before = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["limit"]
        path.write_text(json.dumps(rows[:kept]), encoding="utf-8")
    comm.Barrier()
    assert main(["run", str(case), "--restart", str(folder)]) == run.status
    out = comm.bcast(capsys.readouterr().out)
    assert f"Directions already proven: {kept};" in out
    if comm.rank == 0:
        again = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["limit"]
        directions = before["envelope"]["directions"]
        assert again["envelope"]["directions"] == directions
        assert out.count(" degrees: lower bound ") == len(directions) - (kept - 1)
        for row, same in zip(again["envelope"]["rows"], before["envelope"]["rows"], strict=True):
            # the bounds in the repeated direction are as close as limit_tolerance
            assert row == pytest.approx(same, rel=1e-5, abs=1e-9)
        assert len(json.loads(path.read_text(encoding="utf-8"))) == len(directions)
        path.write_text("[{}]", encoding="utf-8")
    comm.Barrier()
    assert main(["run", str(case), "--restart", str(folder)]) == BAD_INPUT
    if comm.rank == 0:
        error = capsys.readouterr().err
        assert "directions.json cannot be read" in error and "--force" in error


RIGID = """
[[support]]
on = "sides"
components = "x"
[[support]]
on = "bottom"
[[rigid_surface]]
on = "footing"
[[load]]
name = "V"
on = "footing"
force = [0.0, -2.0]
[[load]]
name = "H"
on = "footing"
force = [2.0, 0.0]
"""


@pytest.mark.long
@pytest.mark.serial
def test_the_picture_of_a_rigid_footing(tmp_path: Path) -> None:
    """The forces act on a rigid surface; the width of the footing is 2."""
    write_footing(tmp_path / "ground.msh", size=1.0)
    head, tail = CASE[: CASE.index("[[support]]")], CASE[CASE.index("[loading]") :]
    text = head + RIGID + tail.replace("pictures = false", "pictures = true").replace("= 8", "= 3")
    (tmp_path / "case.toml").write_text(text)
    main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r")])
    assert (tmp_path / "r" / "envelope.png").stat().st_size > 10_000
    assert (tmp_path / "r" / "mechanism.png").stat().st_size > 10_000
    rows = json.loads((tmp_path / "r" / "summary.json").read_text())["limit"]["envelope"]["rows"]
    assert rows[0]["carried"] <= 2 + math.pi <= rows[0]["not carried from"]
    assert rows[90]["carried"] <= 1.0 + 1e-9 <= rows[90]["not carried from"] + 2e-9


@pytest.mark.long
@pytest.mark.serial
def test_three_loads_of_a_rigid_footing(tmp_path: Path) -> None:
    """V, H and M: proofs for each direction, rows, four views and the page."""
    write_footing(tmp_path / "ground.msh", size=1.0)
    head, tail = CASE[: CASE.index("[[support]]")], CASE[CASE.index("[loading]") :]
    turn = '[[load]]\nname = "M"\non = "footing"\nmoment = 2.0\n'
    text = head + RIGID + turn + tail.replace("pictures = false", "pictures = true")
    text = text.replace('second = ["H"]', 'second = ["H"]\nthird = ["M"]\naround = ["M"]')
    (tmp_path / "case.toml").write_text(text.replace("directions = 8", "directions = 4"))
    main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r"), "--report"])
    table = json.loads((tmp_path / "r" / "summary.json").read_text())["limit"]["envelope"]
    assert len(table["directions"]) == 4
    for turned, risen in table["directions"]:
        proven = check(tmp_path / "r" / f"direction_{turned:06.2f}_{risen:06.2f}.h5")
        assert not any(half.faults for half in proven.values())
    rows = {(row["angle"], row["elevation"]): row for row in table["rows"]}
    assert len(rows) == 19 * 37
    assert rows[0, 0]["carried"] <= 2 + math.pi <= rows[0, 0]["not carried from"]
    assert (tmp_path / "r" / "envelope.png").stat().st_size > 10_000
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "A triple (a, b, c) is a times 'V', b times 'H' and c times 'M'." in page.replace(
        "&#x27;", "'"
    )


@pytest.mark.mpi2('first = ["V"]-first = []-first is empty')
@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('first = ["V"]', "first = []", "first is empty"),
        ('first = ["V"]', 'first = ["W"]', "first contains 'W', which is not a load"),
        ('second = ["H"]', 'second = ["V"]', "the load 'V' is in both first and second"),
        (
            'first = ["V"]\nsecond = ["H"]',
            'first = ["V"]\nsecond = ["footing"]',
            "contains 'footing'",
        ),
        ('second = ["H"]', 'second = ["H"]\nthird = ["H"]', "'H' is in both second and third"),
        (
            'second = ["H"]',
            'second = ["H"]\naround = ["W"]',
            "around contains 'W', which is not a load",
        ),
        ('second = ["H"]', 'second = ["H"]\nthird = []', "third is empty"),
        ("directions = 8", "directions = 2", "directions = 2 is too few"),
        ("until = 0.3", "until = 3.0", "until = 3.0 is not between 0 and 1"),
        ('name = "H"', 'name = "H"\nconstant = true', "second contains 'H', which is not a load"),
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


def test_solved_where_it_is_near_enough(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Block under a pressure p and its weight w: p + w ≤ Y."""
    text = """
        mesh = { builder = "stacked_blocks", n = 1 }
        material.lower = { law = "von-mises", young = 2e5, poisson = 0.3, yield_stress = 300.0 }
        material.upper = { law = "von-mises", young = 2e5, poisson = 0.3, yield_stress = 400.0 }
        support = [
            { on = "x0", components = "x" },
            { on = "y0", components = "y" },
            { on = "bottom", components = "z" },
        ]
        load = [
            { on = "top", pressure = 1.0 },
            { on = "upper", body_force = [0.0, 0.0, -1.0], name = "weight" },
        ]
        contact = [{ primary = "lower_top", secondary = "upper_bottom" }]
        loading = { control = "envelope", first = ["top"], second = ["weight"], until = 0.01 }
        output = { pictures = false }
    """
    run = run_case(comm, shared_tmp_path, text, capsys)
    assert run.status == SOLVED
    limit = run.summary["limit"]
    assert limit["envelope"]["gap"] <= 0.01
    for row in limit["envelope"]["rows"]:
        angle = math.radians(row["angle"])
        exact = 300.0 / (math.cos(angle) + math.sin(angle))
        assert row["carried"] <= exact * (1 + 1e-9)
        assert row["not carried from"] >= exact * (1 - 1e-9)
