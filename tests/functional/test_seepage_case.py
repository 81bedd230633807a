"""Test an earth dam with seepage: a whole run of its case file, on a coarse mesh."""

from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.cli.run import on_bodies
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.seepage.flow import flow_of
from tests.case_runs import run_case

DAM = Path(__file__).parents[2] / "demos" / "earth_dam.toml"


def coarse() -> str:
    text = DAM.read_text(encoding="utf-8")
    return text.replace("size = 1.5", "size = 3.0").replace("until = 0.02", "until = 0.3")


@pytest.mark.long
def test_factor_of_safety_of_an_earth_dam(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_case(comm, shared_tmp_path, coarse(), capsys, "--report")
    assert run.status == 0, run.err
    assert "downstream: no water passes" in run.out
    flow = run.summary["seepage"]
    assert flow["discharges"]["upstream"] == pytest.approx(2.23e-6, rel=0.08)
    assert flow["imbalance"] < 1e-9
    if comm.rank:
        return
    # With half the cell size F lies between 1.728 and 1.738.
    safety = run.summary["limit"]["strength"]
    assert 1.70 < safety["lower"] < safety["upper"] < 1.85
    assert check(run.folder / "stands.h5")["lower"].proven is not None
    assert check(run.folder / "falls.h5")["upper"].proven is not None
    stored = ResultReader(run.folder).flow
    assert stored is not None
    assert stored.pressure.max() == pytest.approx(98.1)
    assert np.ptp(stored.head[stored.pressure > 0]) > 7.0
    assert (run.folder / "seepage.png").is_file()
    page = (run.folder / "report.html").read_text(encoding="utf-8")
    assert 'id="water"' in page
    assert "pore water in dam: pore pressure of steady seepage" in page
    assert ">-0<" not in page


def test_combinations_share_the_flow(tmp_path: Path) -> None:
    """Only the loads differ; the program computes the flow of water once."""
    path = tmp_path / "dam.toml"
    path.write_text(coarse(), encoding="utf-8")
    case = read_case(path, MPI.COMM_SELF)
    bodies = case.problem(MPI.COMM_SELF)
    other = on_bodies(bodies, replace(case, remarks=("combination 'high water'",)))
    assert flow_of(other.given.loads) is flow_of(bodies.given.loads) is not None


@pytest.mark.parametrize(
    ("given", "otherwise", "words"),
    [
        ("dam = 1e-6", "damm = 1e-6", "did you mean 'dam'"),
        ("level = 10.0", "level = 9.0", "crosses a facet near"),
        ("level = 10.0", "level = 10.0\npress = true", "no key 'press'"),
        ("[seepage]", '[seepage]\nup = "x"', "up = 'x' is not opposite to gravity"),
        ('["drain", ', '["drian", ', "'drian'"),
    ],
)
def test_wrong_water_is_refused(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    given: str,
    otherwise: str,
    words: str,
) -> None:
    run = run_case(comm, shared_tmp_path, coarse().replace(given, otherwise), capsys)
    assert run.status == 2
    assert words in run.err
