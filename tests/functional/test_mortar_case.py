"""Test separately meshed bodies, from the case file to the results."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED

REFUSED = [
    ('[[contact]]\nprimary = "x0"\nsecondary = "y0"', "nowhere opposite each other"),
    ('[[tie]]\nprimary = "x0"\nsecondary = "inner_tube_seam"', "nowhere opposite each other"),
    (
        2 * '[[tie]]\nprimary = "inner_tube_seam"\nsecondary = "outer_tube_seam"\n',
        "has the same surfaces as tie 1",
    ),
]

CASE = """
title = "Tube in tube"
[mesh]
file = "tubes.msh"
[material.inner_tube]
law = "von-mises"
young = 70e3
poisson = 0.3
yield_stress = 250.0
[material.outer_tube]
law = "von-mises"
young = 70e3
poisson = 0.3
yield_stress = 250.0
[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[load]]
on = "inner"
pressure = 1.0
[[contact]]
primary = "inner_tube_seam"
secondary = "outer_tube_seam"
[element]
degree = 2
[loading]
values = [30.0, 60.0]
[output]
pictures = false
"""


@pytest.mark.mpi2
def test_bodies_meshed_apart(
    shared_tmp_path: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    """The terminal and the log name the surface whose nodes are the hosts."""
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        case.write_text(CASE, encoding="utf-8")
        write_thick_tube(
            shared_tmp_path / "tubes.msh", interface=1.15, size=0.1, order=2, finer=1.5
        )
    comm.barrier()
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out = capsys.readouterr().out
    remark = (
        "hosted by 49 nodes of 'outer_tube_seam'; 'inner_tube_seam' covers 100% of this surface"
    )
    assert comm.rank or remark in out
    assert remark in (results / "run.log").read_text(encoding="utf-8")
    steps = json.loads((results / "summary.json").read_text(encoding="utf-8"))["steps"]
    assert [step["converged"] for step in steps] == [True, True]
    assert all(abs(step["duality_gap"]) < 1e-11 for step in steps)
    assert all(step["active_contacts"] == 49 for step in steps)


def test_what_cannot_be_joined_is_refused(
    shared_tmp_path: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each refusal is one sentence, before any run begins."""
    if comm.rank == 0:
        write_thick_tube(
            shared_tmp_path / "tubes.msh", interface=1.15, size=0.2, order=2, finer=1.5
        )
    for number, (rows, words) in enumerate(REFUSED):
        case = shared_tmp_path / f"{number}.toml"
        if comm.rank == 0:
            before, after = CASE.split("[[contact]]")
            case.write_text(f"{before}{rows}\n[element]{after.split('[element]')[1]}")
        comm.barrier()
        assert main(["run", str(case), "-o", str(shared_tmp_path / f"results_{number}")]) == 2
        error = capsys.readouterr().err
        if comm.rank == 0:
            assert words in error
            assert error.count("\n") == 1
