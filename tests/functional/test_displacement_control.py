"""Test a run under displacement control: its levels, files, and a restart."""

import json
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.solvers.load_stepping import GROWTH, stroke
from perfplast_fenicsx.solvers.newton import Newton
from tests.functional.test_restart import path_of, same_path
from tests.functional.test_restart import run_until as run_until  # a fixture
from tests.models import STACK_HEIGHTS, write_case

YOUNG, YIELD, HEIGHT = 2e5, 300.0, sum(STACK_HEIGHTS)

CASE = f"""title = "Two blocks under a plane that moves"
[mesh]
builder = "stacked_blocks"
n = 1
heights = {list(STACK_HEIGHTS)}
[material]
lower = {{ law = "von-mises", young = {YOUNG}, poisson = 0.3, yield_stress = {YIELD} }}
upper = {{ law = "von-mises", young = {YOUNG}, poisson = 0.3, yield_stress = {YIELD} }}
[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[support]]
on = "bottom"
components = "z"
[[contact]]
primary = "lower_top"
secondary = "upper_bottom"
[[obstacle]]
on = "top"
shape = "plane"
point = [0.0, 0.0, {HEIGHT}]
normal = [0.0, 0.0, -1.0]
move = [0.0, 0.0, -1.0]
[loading]
control = "displacement"
until = 6e-3
[output]
pictures = false
"""


FIT = (
    CASE[: CASE.index("[[obstacle]]")]
    + """gap = -1.0
interference = true
constant = false
[[support]]
on = "top"
components = "z"
"""
    + CASE[CASE.index("[loading]") :]
)


@pytest.mark.parametrize("text", [CASE, FIT])
def test_first_yield_and_growing_strokes(
    text: str, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    case = read_case(write_case(comm, shared_tmp_path / "case.toml", text), comm)
    solver = Newton(case.problem(comm))
    values = np.array(stroke(solver, 6e-3))
    first = YIELD * HEIGHT / YOUNG
    assert values[0] == pytest.approx(first, rel=1e-9)
    assert values[-1] == pytest.approx(6e-3)
    assert (values[1:] / values[:-1] > 1).all()
    assert (values[1:] / values[:-1] < GROWTH * (1 + 1e-9)).all()
    assert stroke(solver, first / 2) == pytest.approx([first / 2])
    assert stroke(solver, -1.0) == pytest.approx([-1.0])  # nothing resists upward motion


@pytest.mark.mpi2
def test_a_run(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Files and terminal contain force and stroke, and a restart gives the same run."""
    case = write_case(comm, shared_tmp_path / "case.toml", CASE)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    told = capfd.readouterr().out
    if comm.rank == 0:
        assert "force" in told
        assert "obstacle top" in told
        assert "support bottom" in told
    steps = json.loads((whole / "summary.json").read_text())["steps"]
    for step, row in zip(steps, path_of(whole), strict=True):
        expected = min(YOUNG * step["zeta"] / HEIGHT, YIELD)
        assert step["driving_force"] == pytest.approx(expected, rel=1e-9)
        assert step["reactions"]["obstacle top"] == pytest.approx([0, 0, -expected], abs=1e-9)
        assert step["balance"] < 1e-10
        assert float(row["driving_force"]) == pytest.approx(expected, rel=1e-9)
        assert float(row["obstacle_top_z"]) == pytest.approx(-expected, rel=1e-9)
    run_until(case, parts, 2)
    assert len(path_of(parts)) == 2
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    same_path(parts, whole)
