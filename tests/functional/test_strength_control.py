"""Test cases for a factor of safety: results, proofs, pictures, page, refusals."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.retaining_wall import write_retaining_wall
from meshes.slope import write_slope
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.cli.recorder import Recorder
from perfplast_fenicsx.cli.signals import Interrupted
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.claims import check_factor, proofs_in
from perfplast_fenicsx.limit_analysis.body import proof_arrays
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.outcome_words import factor_so_far
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.report.verdict import verdict_on
from tests.functional.test_command_line import one_line, write

CASE = """
title = "Slope 2:1"
[mesh]
file = "slope.msh"
adapt = { until = 0.2, cells = 300 }
[material.soil]
law = "drucker-prager"
young = 1e4
poisson = 0.3
cohesion = 0.05
friction_angle = 20.0
match = "plane-strain"
[[support]]
on = "bottom"
[[support]]
on = "left"
components = "x"
[[load]]
on = "soil"
body_force = [0.0, -1.0]
constant = true
[loading]
control = "strength"
limit_tolerance = 0.01
path = true
"""


@pytest.fixture
def slope(comm: MPI.Intracomm, shared_tmp_path: Path) -> Path:
    """Return a folder with the mesh of the first slope of D. V. Griffiths and P. A. Lane."""
    if comm.rank == 0:
        write_slope(shared_tmp_path / "slope.msh", size=0.3)
    comm.barrier()
    return shared_tmp_path


def test_a_slope(comm: MPI.Intracomm, slope: Path) -> None:
    results = slope / "results"
    case = write(comm, slope, CASE)
    assert main(["run", str(case), "-o", str(results), "--report"]) == SOLVED
    if comm.rank != 0:
        return
    limit = json.loads((results / "summary.json").read_text())["limit"]
    lower, upper = limit["strength"]["lower"], limit["strength"]["upper"]
    assert 1.2 < lower < 1.3978  # F at which log spirals collapse
    assert 1.3743 < upper < 1.6  # F proven on finer meshes
    for name, side, value in (("stands", "lower", 1.0), ("falls", "upper", 1.0)):
        halves = check(results / f"{name}.h5")
        assert list(halves) == [side]
        assert not halves[side].faults
        words = " ".join(halves[side].words)
        assert f"F = {limit['strength'][side]:.9g};" in words
        assert "they are a cohesion of 0.05 with tan φ = 0.36397" in words
        assert halves[side].claimed == pytest.approx(value, abs=0.05)
        assert (halves[side].claimed >= 1) == (side == "lower")
    assert not (results / "bounds.h5").exists()
    with (results / "path.csv").open() as file:
        rows = [{k: float(v) for k, v in row.items() if v} for row in csv.DictReader(file)]
    known = {row["factor"]: row for row in rows if "work" not in row}
    assert known[lower]["lower"] >= 1 >= known[upper]["upper"]
    path = limit["strength"]["path"]
    assert path["levelled_off"]
    factors, works = ([row[key] for row in path["points"]] for key in ("factor", "work"))
    assert factors == sorted(factors) == [row["factor"] for row in rows if "work" in row]
    assert works == sorted(works)
    assert lower < factors[-1] < 1.05 * upper
    for picture in ("strength.png", "mechanism.png", "report.html"):
        assert (results / picture).stat().st_size > 1000
    page = (results / "report.html").read_text(encoding="utf-8")
    assumed = page[page.index('<section id="assumptions"') : page.index('<section id="again"')]
    assert (
        "The bodies are the regions that the straight-sided elements of the mesh fill." in assumed
    )
    verdict = verdict_on(ResultReader(results))
    assert verdict.mark == "proven"
    assert verdict.sentence.startswith("The bodies stand with F = 1.")
    assert "stands.h5 and python3 -m perfplast_fenicsx.proof falls.h5" in verdict.details[1]
    proofs = proofs_in(results)
    check_factor(results, limit, proofs)
    with pytest.raises(InputError, match="says that F = "):
        check_factor(results, {"strength": {**limit["strength"], "lower": 1.01 * lower}}, proofs)
    assert verdict.details[2].startswith("F over work levels off at 1.")


WALL = """
[mesh]
file = "wall.msh"
adapt = { until = 0.9, cells = 100 }
[material.ground]
law = "tresca"
young = 1e4
poisson = 0.3
cohesion = 0.5
[material.wall]
law = "von-mises"
young = 1e6
poisson = 0.2
yield_stress = 2000.0
reduced = false
[[tie]]
primary = "ground_face"
secondary = "wall_face"
[[support]]
on = "bottom"
[[support]]
on = "side"
components = "x"
[[support]]
on = "below"
components = "x"
[[load]]
on = "ground"
body_force = [0.0, -1.2]
constant = true
[[load]]
on = "wall"
body_force = [0.0, -1.2]
constant = true
[loading]
control = "strength"
limit_tolerance = 0.05
"""


@pytest.mark.long
def test_a_strength_that_is_not_divided(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    """The terminal says so before and after the run, and the checker for both proofs."""
    if comm.rank == 0:
        write_retaining_wall(shared_tmp_path / "wall.msh", width=3.0)
    case = write(comm, shared_tmp_path, WALL)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    told = capsys.readouterr().out
    if comm.rank != 0:
        return
    assert "F divides: the strength of 'ground'" in told
    assert "F does not divide (reduced = false): the strength of 'wall'" in told
    strength = json.loads((results / "summary.json").read_text())["limit"]["strength"]
    assert strength["in_words"].endswith(
        "all strengths but the strength of 'wall' are divided by F."
    )
    for file, side in (("stands", "lower"), ("falls", "upper")):
        found = check(results / f"{file}.h5")[side]
        assert not found.faults
        words = " ".join(found.words)
        assert f"Strengths are divided by F = {strength[side]:.9g}" in words
        assert "before the division they are a yield radius of 0.707107." in words
        assert "Not divided: strengths in a volume of 0.5." in words


@pytest.mark.parametrize("control", ["bounds", "load"])
def test_no_strength_is_kept_where_none_is_divided(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], slope: Path, control: str
) -> None:
    text = CASE.replace("friction_angle = 20.0", "friction_angle = 20.0\nreduced = false")
    text = text[: text.index("[loading]")].replace("adapt = { until = 0.2, cells = 300 }\n", "")
    text = text.replace("constant = true\n", "")
    text += f'[loading]\ncontrol = "{control}"\n' + "values = [1.0]\n" * (control == "load")
    case = write(comm, slope, text)
    assert main(["check", str(case)]) == BAD_INPUT
    told = one_line(comm, capsys)
    assert "reduced = false for the strength of 'soil'" in told
    assert "give control = 'strength'" in told


@pytest.mark.parametrize(
    ("before", "after", "named"),
    [
        ("poisson = 0.3", "poisson = 0.3\nreduced = false", "reduced = false leaves no strength"),
        ("constant = true", "", "'soil' grows"),
        ("limit_tolerance = 0.01", "limit_tolerance = 1.5", "1.5"),
        ("limit_tolerance = 0.01", "design = 1.0", "design"),
        ("path = true", "path = 1", "path"),
        (
            'law = "drucker-prager"\nyoung = 1e4\npoisson = 0.3\ncohesion = 0.05\n'
            'friction_angle = 20.0\nmatch = "plane-strain"',
            'law = "elastic"\nyoung = 1e4\npoisson = 0.3',
            "all bodies are elastic or rigid",
        ),
    ],
)
def test_what_cannot_be_is_one_sentence(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    slope: Path,
    before: str,
    after: str,
    named: str,
) -> None:
    assert before in CASE
    case = write(comm, slope, CASE.replace(before, after))
    assert main(["run", str(case), "-o", str(slope / "results")]) == BAD_INPUT
    assert named in one_line(comm, capsys)


def coarse(comm: MPI.Intracomm, slope: Path) -> Path:
    """Write a case with a coarse mesh, a large tolerance and no adaptation."""
    if comm.rank == 0:
        write_slope(slope / "slope.msh", size=1.0)
    comm.barrier()
    text = CASE.replace("path = true", "").replace("= 0.01", "= 0.3")
    return write(comm, slope, text.replace("adapt = { until = 0.2, cells = 300 }", ""))


@pytest.mark.long
def test_a_wide_tolerance(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], slope: Path
) -> None:
    """With a large tolerance, a run also solves a case that check accepts."""
    case = coarse(comm, slope)
    assert main(["check", str(case)]) == SOLVED
    assert main(["run", str(case), "-o", str(slope / "results")]) == SOLVED


def test_an_interrupted_search_prints_and_writes_its_bracket(
    comm: MPI.Intracomm,
    slope: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    undrawn: None,
) -> None:
    """Only proven factors count as proven, before and after the first bounds."""
    case = coarse(comm, slope)
    told: list[float] = []
    factor, most = Recorder.factor, 0

    def keep(self: Recorder, *bounds: Any) -> None:
        factor(self, *bounds)
        told.append(bounds[0])

    def interior(_: Recorder, step: InteriorStep) -> None:
        if len(told) == most and step.number == 2:
            raise Interrupted(15)

    monkeypatch.setattr(Recorder, "factor", keep)
    monkeypatch.setattr(Recorder, "interior", interior)
    assert main(["run", str(case), "-o", str(slope / "early")]) == 128 + 15
    early = capsys.readouterr().out
    most = 2
    assert main(["run", str(case), "-o", str(slope / "late")]) == 128 + 15
    late = capsys.readouterr().out
    if comm.rank == 0:
        assert "Factor of safety so far: no proven bound. The search was interrupted." in early
        assert "(an estimate that is not proven)" in late
        strength = json.loads((slope / "late" / "summary.json").read_text())["limit"]["strength"]
        proven = [strength["lower"], strength["upper"]]
        assert any(proven)
        for side, sign in (("lower", 1), ("upper", -1)):
            times = [row[side] for row in strength["curve"] if row["factor"] == strength[side]]
            assert all(sign * (it - 1) >= 0 for it in times)
        assert f"{factor_so_far(*proven, False)[1:]}." in late
        assert "The search was interrupted." in strength["in_words"]
        assert strength["in_words"] in late


@pytest.mark.long
def test_a_side_that_the_checker_refuses_is_not_told(
    comm: MPI.Intracomm, slope: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stress for the smaller factor is damaged. The program then claims no lower bound."""
    honest = proof_arrays._stress

    def spoil(proof: proof_arrays.StressProof) -> proof_arrays.Blocks:
        return honest(replace(proof, stress=np.full_like(proof.stress, np.nan)))

    monkeypatch.setattr(proof_arrays, "_stress", spoil)
    results = slope / "results"
    quick = CASE.replace("path = true", "").replace("= 0.01", "= 0.09")
    case = write(comm, slope, quick.replace("adapt = { until = 0.2, cells = 300 }", ""))
    main(["run", str(case), "-o", str(results)])
    strength = json.loads((results / "summary.json").read_text())["limit"]["strength"]
    assert strength["lower"] is None
    assert strength["upper"] is not None
    assert not (results / "stands.h5").exists()
