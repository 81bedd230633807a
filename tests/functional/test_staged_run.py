"""Test a run in which stages move a punch: stored forces, and a restart within a cycle."""

import json
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from tests.functional.test_displacement_control import CASE, HEIGHT, YIELD, YOUNG
from tests.functional.test_restart import path_of, same_path
from tests.functional.test_restart import run_until as run_until  # a fixture
from tests.models import write_case

pytestmark = pytest.mark.usefixtures("undrawn")

AT_YIELD = YIELD * HEIGHT / YOUNG
STAGES = f"""
[[stage]]
name = "press"
factors = {{ top = {3 * AT_YIELD} }}
steps = 2
[[stage]]
name = "release"
factors = {{ top = 0.0 }}
steps = 3
[[stage]]
name = "again"
factors = {{ top = {2.5 * AT_YIELD} }}
[output]
"""


@pytest.mark.mpi2
def test_a_cycle_of_a_punch_goes_on(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The run ends where the punch has left the blocks, which remain shorter by 2 ε_y."""
    begin, end = CASE.index("[loading]"), CASE.index("[output]")
    text = CASE[:begin] + STAGES + CASE[end + len("[output]\n") :]
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    told = capfd.readouterr().out
    if comm.rank == 0:
        assert "Stage 'release':" in told
        assert "obstacle top" in told
    steps = json.loads((whole / "summary.json").read_text())["steps"]
    forces = [1.0, 1.0, 0.0, 0.0, 0.0, 0.5]
    for step, row, force in zip(steps, path_of(whole), forces, strict=True):
        assert step["driving_forces"] == pytest.approx({"top": force * YIELD}, abs=1e-7)
        assert step["balance"] < 1e-10
        assert float(row["driving_force_top"]) == pytest.approx(force * YIELD, abs=1e-7)
        assert float(row["obstacle_top_z"]) == pytest.approx(-force * YIELD, abs=1e-7)
    run_until(case, parts, 4)
    assert len(path_of(parts)) == 4
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    same_path(parts, whole, at_rest=[str(i + 1) for i, force in enumerate(forces) if not force])
    assert [float(row["factor_top"]) for row in path_of(parts)] == pytest.approx(
        [float(row["factor_top"]) for row in path_of(whole)]
    )
