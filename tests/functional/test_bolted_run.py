"""Test a run with a tightened bolt: forces in files, terminal and page, and a restart."""

import json
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, NO_SOLUTION, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from tests.functional.test_restart import path_of
from tests.functional.test_restart import run_until as run_until  # a fixture
from tests.models import write_case

pytestmark = pytest.mark.usefixtures("undrawn")

PRELOAD = 40.0
CASE = f"""
[mesh]
builder = "stacked_blocks"
n = 2
[material.lower]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 300.0
[material.upper]
law = "elastic"
young = 2e5
poisson = 0.3
[[support]]
on = "bottom"
[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[load]]
on = "top"
pressure = 1.0
[[tie]]
primary = "lower_top"
secondary = "upper_bottom"
[[bolt]]
name = "anchor"
on = "lower"
preload = {PRELOAD}
axis = [1.0, 0.0, 0.0]
[units]
length = "mm"
stress = "MPa"
[loading]
values = [10.0, 20.0]
"""


@pytest.mark.mpi2
def test_forces_of_a_bolt_are_told(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """At rest the force is the preload; a restart tightens the bolt again and continues equally."""
    case = write_case(comm, shared_tmp_path / "case.toml", CASE)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole), "--report"]) == SOLVED
    told = capfd.readouterr().out
    steps = json.loads((whole / "summary.json").read_text())["steps"]
    rows = path_of(whole)
    assert [step["zeta"] for step in steps] == [0.0, 10.0, 20.0]
    assert steps[0]["bolts"] == pytest.approx({"anchor": PRELOAD}, rel=1e-5)
    assert [float(row["bolt_anchor"]) for row in rows] == [a["bolts"]["anchor"] for a in steps]
    assert len({f"{step['bolts']['anchor']:.4f}" for step in steps}) == 3
    if comm.rank == 0:
        assert "bolts are tightened before any load acts ('anchor' to 40)" in told
        assert "Forces of bolts, tension positive (N):" in told
        page = (whole / "report.html").read_text()
        assert "Forces of bolts" in page
        assert "Preloads do not change the limit load" in page
        assert "tightened to 40 N" in page
        assert ResultReader(whole).reports[1].bolts == steps[1]["bolts"]
    run_until(case, parts, 2)
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    again = [float(row["bolt_anchor"]) for row in path_of(parts)]
    assert again == pytest.approx([step["bolts"]["anchor"] for step in steps], rel=1e-5)


def test_limit_load_leaves_preload_out(
    comm: MPI.Intracomm, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The program says this in one line."""
    begin = CASE.index("[loading]")
    text = f'{CASE[:begin]}[loading]\ncontrol = "work"\nuntil = "limit"\n[element]\ndegree = 2\n'
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "limit")]) == SOLVED
    told = capfd.readouterr().out
    if comm.rank == 0:
        assert "preloads of bolts remain constant, and do no work" in told


STAGES = """
[[stage]]
name = "half"
factors = { top = 10.0 }
[[stage]]
name = "tightened"
factors = { anchor = 1.25 }
[[stage]]
name = "full"
factors = { top = 20.0 }
"""


def test_stages_tighten_anew(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Table and text show the stage.

    No restart is possible after it, because no file stores shortenings.
    """
    text = CASE[: CASE.index("[loading]")] + STAGES
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole), "--report"]) == SOLVED
    forces = [float(row["bolt_anchor"]) for row in path_of(whole)]
    assert forces[0] == pytest.approx(PRELOAD, rel=1e-5)
    assert forces[2] == pytest.approx(1.25 * PRELOAD, rel=1e-5)
    assert forces[3] - forces[2] == pytest.approx(forces[1] - forces[0], rel=1e-4)
    told = capfd.readouterr().out
    if comm.rank == 0:
        assert "again (anchor)" in told
        assert "Preloads do not change the limit load" in (whole / "report.html").read_text()
    run_until(case, parts, 3)
    comm.barrier()
    capfd.readouterr()
    assert main(["run", str(case), "--restart", str(parts)]) == BAD_INPUT
    said = capfd.readouterr().err
    if comm.rank == 0:
        assert "the bolt 'anchor' is tightened again" in said
        assert "--force" in said


@pytest.mark.parametrize(
    ("factor", "words"),
    [("anchor = -1.0", ["-1 for the bolt 'anchor'", "above 0"]), ("ancor = 1.0", ["'anchor'"])],
)
def test_stages_that_are_wrong(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    factor: str,
    words: list[str],
) -> None:
    text = CASE[: CASE.index("[loading]")] + STAGES.replace("anchor = 1.25", factor)
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "out")]) == BAD_INPUT
    printed = capfd.readouterr().err
    if comm.rank == 0:
        assert all(word in printed for word in words)


@pytest.mark.parametrize(
    ("old", "new", "status", "words"),
    [
        (f"preload = {PRELOAD}", "preload = -1.0", BAD_INPUT, ["[[bolt]]", "preload = -1.0"]),
        (f"preload = {PRELOAD}", 'preload = "much"', BAD_INPUT, ["[[bolt]]", "preload"]),
        ('on = "lower"', 'on = "screw"', BAD_INPUT, ["'screw'", "lower"]),
        ("axis = [1.0, 0.0, 0.0]", "axis = [1.0, 0.0]", BAD_INPUT, ["anchor", "3 numbers"]),
        ("axis = [1.0, 0.0, 0.0]\n", "", BAD_INPUT, ["[[bolt]]", "axis"]),
        (f"preload = {PRELOAD}", "preload = 1e5", NO_SOLUTION, ["'anchor' could not be tightened"]),
    ],
)
def test_bolts_that_are_wrong(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    old: str,
    new: str,
    status: int,
    words: list[str],
) -> None:
    """Each refusal is one sentence with the field and the remedy."""
    assert old in CASE
    case = write_case(comm, shared_tmp_path / "case.toml", CASE.replace(old, new))
    assert main(["run", str(case), "-o", str(shared_tmp_path / "out")]) == status
    printed = "".join(capfd.readouterr())
    if comm.rank == 0:
        assert all(word in printed for word in words)
        assert "Traceback" not in printed
