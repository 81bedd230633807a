"""Test both ends of the range of load factors, from a case file: terminal, files and proofs."""

import math
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.platens import write_platens
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.report.verdict import verdict_on
from tests.case_runs import CaseRun, assert_case_refused, run_case

CASE = """
[mesh]
file = "block.msh"
[material.block]
law = "von-mises"
young = 200.0
poisson = 0.3
yield_stress = 1.7320508075688772
[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[load]]
on = "top"
pressure = 1.0
[[load]]
on = "side"
pressure = LATERAL
constant = true
[loading]
control = "bounds"
MORE
[output]
pictures = false
"""


def pressed(
    comm: MPI.Intracomm,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    lateral: float,
    more: str = "",
) -> CaseRun:
    """Return a block with k = 1; its pressures on top and side may differ by 2."""
    if comm.rank == 0:
        write_platens(folder / "block.msh", size=0.5, grading=1.0)
    text = CASE.replace("LATERAL", str(lateral)).replace("MORE", more)
    return run_case(comm, folder, text, capsys)


@pytest.mark.parametrize(
    ("lateral", "more"),
    [(5.0, "design = 1.0"), (-3.0, ""), (0.5, 'direction = "both"'), (0.5, "design = 1.0")],
)
def test_a_block_between_two_pressures(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    lateral: float,
    more: str,
) -> None:
    """The terminal prints both ends if 0 lies outside the range, or if the case requests them."""
    run = pressed(comm, shared_tmp_path, capsys, lateral, more)
    assert run.status == SOLVED
    limit = run.summary["limit"]
    body, least = limit["body"], limit["body"]["least"]
    largest, smallest = lateral + 2, lateral - 2
    assert body["lower"] <= largest <= body["upper"] + 1e-7
    outside, asked = abs(lateral) > 2, "both" in more
    assert bool(least) == (outside or asked)
    assert bool(limit["design"]) == (lateral == 0.5 and not asked)
    if not least:
        return
    assert least["none_below"] - 1e-7 <= smallest <= least["carried"]
    assert least["carried"] == pytest.approx(smallest, abs=1e-3)
    said = "not carry the constant loads alone" in least["in_words"]
    assert said == (smallest > 0)
    assert least["in_words"] in run.out
    if comm.rank == 0:
        assert least["in_words"] in verdict_on(ResultReader(run.folder)).details
        found = check(run.folder / "least.h5")
        assert not any(half.faults for half in found.values())
        assert -(found["lower"].proven or math.nan) == pytest.approx(least["carried"], rel=1e-9)


def test_a_pin_cannot_pull(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if comm.rank == 0:
        write_platens(shared_tmp_path / "block.msh", size=0.5, grading=1.0)
    text = CASE.replace("LATERAL", "1.0").replace("MORE", 'direction = "both"')
    text = text.replace("pressure = 1.0\n[[", "bearing_force = [0.0, -1.0]\n[[", 1)
    said = "a pin, which cannot pull"
    assert_case_refused(comm, shared_tmp_path, text, said, capsys)
