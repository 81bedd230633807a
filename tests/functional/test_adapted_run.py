"""A case file whose mesh is adapted: a line a mesh, and bounds proven anew from the files."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.run import SOLVED
from perfplast_fenicsx.proof import check
from tests.models import write_case

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
    if comm.rank == 0:
        assert f"Mesh {last['number']}: {last['cells']} cells, lower bound" in out
