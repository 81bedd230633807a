"""Test the push-out force of a press fit from a case file to every output, and refusals."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.ring import write_ring
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, NO_SOLUTION, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.verdict import verdict_on
from tests.functional.test_command_line import one_line, write

BODY = """
[material.{}]
law = "von-mises"
young = 2e5
poisson = 0.0
yield_stress = 1000.0
"""
CASE = f"""
title = "A shaft pushed out of its hub"
[mesh]
file = "ring.msh"
[model]
kind = "axisymmetric"
[element]
degree = 2
{BODY.format("inner_ring")}{BODY.format("outer_ring")}
[[contact]]
primary = "outer_ring_seam"
secondary = "inner_ring_seam"
gap = -1e-3
interference = true
coulomb = 0.2
[[support]]
on = "outer"
components = "y"
[[load]]
on = "inner_ring"
body_force = [0.0, 1.0]
[output]
pictures = false
"""
SEARCH = '[loading]\ncontrol = "work"\nuntil = "limit"\n'
FORCE = 30.0
"""2π a L μ p divided by π a² L, with Lamé's p = 75."""


@pytest.fixture
def folder(comm: MPI.Intracomm, shared_tmp_path: Path) -> Path:
    if comm.rank == 0:
        write_ring(shared_tmp_path / "ring.msh", 0.0, 2.0, 1.0, interface=1.0, size=0.5)
    comm.barrier()
    return shared_tmp_path


def test_the_load_and_what_it_is_are_told(
    folder: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    case = write(comm, folder, CASE + SEARCH)
    assert main(["run", str(case), "-o", str(folder / "results"), "--report"]) == SOLVED
    said = comm.bcast(capsys.readouterr().out)
    assert "This path loses equilibrium between 30.00" in said
    assert "No limit theorem holds with Coulomb's friction" in said
    assert "may slide at any load, as without friction they carry none" in said
    assert said.count("(Drucker)") == 1
    summary = json.loads((folder / "results" / "summary.json").read_text(encoding="utf-8"))
    limit = summary["limit"]
    assert limit["theorem"] is False
    assert limit["levelled_off"] is True
    assert limit["lower"] == pytest.approx(FORCE, rel=1e-4)
    assert limit["lower"] < limit["upper"] <= limit["lower"] * 1.0011
    assert limit["drucker"]["lower"] == pytest.approx(0.0, abs=1e-6)
    assert limit["drucker"]["upper"] > limit["upper"]
    assert all(step["converged"] for step in summary["steps"])
    verdict = verdict_on(ResultReader(folder / "results"))
    assert verdict.mark == "found"
    assert verdict.sentence.startswith("Loaded on this path, this mesh loses equilibrium between")
    assert "bound" not in verdict.sentence
    page = (folder / "results" / "report.html").read_text(encoding="utf-8")
    assert "this path loses equilibrium" in page
    assert "limit load of this mesh" not in page


@pytest.mark.long
def test_a_push_that_is_never_too_large_is_no_result(
    folder: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    """A step in the hub holds the shaft, modelled by a support, and both bodies are elastic."""
    held = '[[support]]\non = "top"\ncomponents = "y"\n'
    elastic = CASE.replace("von-mises", "elastic").replace("yield_stress = 1000.0\n", "")
    case = write(comm, folder, elastic + held + SEARCH)
    assert main(["run", str(case), "-o", str(folder / "results")]) == NO_SOLUTION
    said = comm.bcast(capsys.readouterr().out)
    assert "This path loses equilibrium at a load that was not found; levels are solved" in said
    assert "the bodies may carry any multiple of the loads" in said


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('limit_method = "interior-point"\n', "no limit theorem holds"),
        ("limit_tolerance = 1e-6\n", "give 1e-05 or more"),
    ],
)
def test_what_is_refused_is_one_sentence(
    more: str,
    words: str,
    folder: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    case = write(comm, folder, CASE + SEARCH + more)
    assert main(["run", str(case), "-o", str(folder / "results")]) == BAD_INPUT
    assert words in one_line(comm, capsys)
