"""Test ``perfplast run --refine``: both runs, and the table that compares them."""

import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.cli.several_runs import compared
from tests.functional.test_command_line import one_line

CASE = """
title = "blocks"
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
[loading]
control = "bounds"
limit_tolerance = 1e-2
[output]
pictures = false
"""


@pytest.mark.mpi2
def test_half_the_size(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The finer mesh has eight times the cells, the same load, and better bounds."""
    path, folder = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        path.write_text(CASE)
    comm.barrier()
    assert main(["run", str(path), "-o", str(folder), "--refine"]) == SOLVED
    out = capsys.readouterr().out
    if comm.rank:
        assert out == ""
        return
    coarse, fine = (
        json.loads((place / "summary.json").read_text()) for place in (folder, folder / "half")
    )
    assert fine["mesh"]["cells"] == 8 * coarse["mesh"]["cells"]
    assert fine["element_size"] < 0.8 * coarse["element_size"]
    assert fine["loads"][0]["force"] == pytest.approx(coarse["loads"][0]["force"], abs=1e-12)
    before, after = (one["limit"]["body"] for one in (coarse, fine))
    assert after["upper"] < before["upper"]
    assert after["lower"] > before["lower"]
    *_, given, half, change, together = out.strip().splitlines()
    assert given.split()[:2] == ["as", "given"]
    assert half.split()[:3] == ["half", "the", "size"]
    assert "with half the size" in change
    assert together.startswith("Both meshes fill the same body, so it collapses between")


def test_restart_goes_on_with_one_run(comm: MPI.Intracomm, capsys: Any) -> None:
    assert main(["run", "a.toml", "--restart", "a", "--refine"]) == BAD_INPUT
    assert "--refine starts two" in one_line(comm, capsys)


def summary(cells: int, **more: Any) -> dict[str, Any]:
    told = {"mesh": {"cells": cells, "dofs": 3 * cells}, "element_size": 10.0 / cells}
    return told | {"timings": {"total": 2.0 * cells}, "steps": [], "limit": None} | more


def limit(estimate: float | None, lower: float | None, upper: float | None) -> dict[str, Any]:
    return {"limit": {"estimate": estimate, "body": {"lower": lower, "upper": upper}}}


@pytest.mark.serial
def test_what_both_meshes_prove_together() -> None:
    lines = compared(summary(10, **limit(5.0, 3.0, 6.0)), summary(80, **limit(4.0, 3.5, 7.0)))
    assert [line.split()[-5:-2] for line in lines[1:3]] == [["3", "6", "5"], ["3.5", "7", "4"]]
    assert lines[3] == "The estimate is 20 % smaller with half the size."
    assert "between 3.5 and 6, 71 % apart" in lines[4]
    sides = limit(None, None, 6.0), limit(4.0, None, None)
    (_, _, row) = compared(summary(10, **sides[0]), summary(80, **sides[1]))
    assert row.split()[-6:-2] == ["240", "-", "-", "4"]


@pytest.mark.serial
def test_levels_are_compared_at_the_same_load() -> None:
    step = {"converged": True, "zeta": 2.0, "alpha": 1.0, "plastic_fraction": 0.5}
    coarse = summary(10, steps=[step | {"max_displacement": 0.5}])
    fine = summary(80, steps=[step | {"max_displacement": 0.6}])
    assert (
        compared(coarse, fine)[3] == "The largest displacement is 20 % larger with half the size."
    )
    other = summary(80, steps=[step | {"max_displacement": 0.6, "zeta": 3.0}])
    assert (
        compared(coarse, other)[3]
        == "The runs end at different load levels, so their results are not compared."
    )
