"""Test cases with an adapted mesh: a line for each mesh, and bounds proven from the files."""

import csv
import json
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Support
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.report.verdict import verdict_on
from tests.models import STEEL, case_text, write_case

CASE = """
[mesh]
file = "ground.msh"
adapt = { until = 0.2, cells = 800 }
[material.ground]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0
[[support]]
on = "x0"
components = "x"
[[support]]
on = "bottom"
[[load]]
on = "footing"
pressure = 1.0
[loading]
control = "bounds"
[output]
pictures = false
"""


@pytest.mark.mpi2
def test_adapted_run(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    if comm.rank == 0:
        write_strip_footing(shared_tmp_path / "ground.msh", size=0.4)
    case = write_case(comm, shared_tmp_path / "case.toml", CASE)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, _ = capsys.readouterr()
    body = json.loads((results / "summary.json").read_text(encoding="utf-8"))["limit"]["body"]
    first, last = body["meshes"][0], body["meshes"][-1]
    assert first["cells"] == 353
    assert 353 < last["cells"] <= 800
    assert last["gap"] < 0.2 < first["gap"]
    assert body["upper"] / body["lower"] - 1 == pytest.approx(last["gap"], rel=1e-9)
    proven = check(results / "bounds.h5")
    for kind in ("lower", "upper"):
        assert not proven[kind].faults
        assert proven[kind].proven == pytest.approx(body[kind], rel=1e-9)
    with (results / "path.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["cells"]) for row in rows] == [mesh["cells"] for mesh in body["meshes"]]
    assert [row["estimate"] == "" for row in rows] == [*[True] * (len(rows) - 1), False]
    lower, upper = ([float(row[f"body_{kind}"]) for row in rows] for kind in ("lower", "upper"))
    assert lower == sorted(lower)
    assert upper == sorted(upper, reverse=True)
    assert (lower[-1], upper[-1]) == pytest.approx((body["lower"], body["upper"]), rel=1e-12)
    assert ResultReader(results).reports == []
    if comm.rank == 0:
        assert f"Mesh {last['number']}: {last['cells']} cells, lower bound" in out
        assert "Limit load of the last mesh: " in out
        words = " ".join(line for line in out.splitlines() if "as requested" in line)
        assert words.count("bounds are within 0.2 of each other, as requested") == 1
        assert "a smaller until brings them closer" in words


@pytest.mark.parametrize(
    ("design", "says", "mark", "meshes"),
    [
        (1000.0, "is carried for certain", "proven", 2),
        (1500.0, "is not carried: the bodies collapse at", "proven", 1),
        (1180.0, "is not decided by this mesh", "open", 3),
    ],
)
def test_until_decided(
    design: float,
    says: str,
    mark: str,
    meshes: int,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    """The terminal prints the verdict on the design load, and the page begins with it."""
    if comm.rank == 0:
        write_strip_footing(shared_tmp_path / "ground.msh", size=1.0, grading=1.0)
    text = CASE.replace("{ until = 0.2, cells = 800 }", '{ until = "decided", cells = 150 }')
    text = text.replace('control = "bounds"', f'control = "bounds"\ndesign = {design}')
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results), "--report"]) == SOLVED
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert says in out
        assert out.index(says) < out.index("The body that the mesh fills")
        table = json.loads((results / "summary.json").read_text(encoding="utf-8"))["limit"]
        assert len(table["body"]["meshes"]) == meshes
        verdict = verdict_on(ResultReader(results))
        assert says in verdict.sentence
        assert verdict.mark == mark
        assert says in (results / "report.html").read_text(encoding="utf-8")


ADAPT = "adapt = { until = 0.2, cells = 800 }"
BOUNDS = '[loading]\ncontrol = "bounds"\n'
CONTACT = '[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]


def stacked(supports: list[Support], contact: str = CONTACT) -> str:
    """Two stacked blocks, on the mesh of a builder that is adapted."""
    steel = dict.fromkeys(("lower", "upper"), STEEL)
    text = case_text({"builder": "stacked_blocks", "n": 1}, steel, supports)
    return text.replace("[mesh]\n", f"[mesh]\n{ADAPT}\n") + contact + BOUNDS


TUBE = (
    CASE[: CASE.index("[[support]]")].replace("ground", "tube")
    + '[[support]]\non = "x0"\ncomponents = "x"\n[[support]]\non = "y0"\ncomponents = "y"\n'
    + '[[load]]\non = "inner"\npressure = 1.0\n'
    + BOUNDS
)
REFUSED = {
    "nothing holds a body": (
        stacked(ROLLERS, contact=""),
        "can move as a rigid body",
    ),
    "lifted off": (
        stacked(ROLLERS).replace("pressure = 1.0", "pressure = -1.0"),
        "no stress can carry the loads",
    ),
    "no design load": (
        CASE.replace("until = 0.2", 'until = "decided"'),
        '[mesh], adapt: until = "decided" needs a design',
    ),
    "no gap": (CASE.replace("until = 0.2", "until = 2.0"), "until = 2.0 is not between 0 and 1"),
    "no word": (CASE.replace("until = 0.2", 'until = "narrow"'), "until"),
    "curved cells": (TUBE, "[mesh]: adapt: cells are curved"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_refused_in_one_sentence(
    fault: str, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    text, part = REFUSED[fault]
    if comm.rank == 0 and text is TUBE:
        write_thick_tube(shared_tmp_path / "tube.msh", size=0.5, order=2)
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "results")]) == BAD_INPUT
    err = capsys.readouterr().err
    assert comm.rank == 0 or err == ""
    err = comm.bcast(err)
    assert part in err
    assert err.startswith("perfplast: case.toml")
    assert err.count("\n") == 1
