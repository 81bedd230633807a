"""Test rolled metal in case files: levels by algorithms, limit load and bounds, and refusals."""

import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Elastic, Hill, Support
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.proof import check
from tests.models import case_text, write_case

SHEET = Hill(2e5, 0.3, 450.0, r33=0.9, r13=1.2, angle=30.0)
LIMIT = 0.9 * 450.0
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]


def case(comm: MPI.Intracomm, folder: Path, more: str) -> Path:
    """Write the case of a sheet below a body that never yields. Collective."""
    text = case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": SHEET, "upper": Elastic(2e5, 0.3)},  # type: ignore[dict-item]
        ROLLERS,
        more="[element]\ndegree = 2\n[output]\npictures = false\n"
        '[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n' + more,
    )
    return write_case(comm, folder / "case.toml", text)


def summary(comm: MPI.Intracomm, folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = comm.bcast(
        json.loads((folder / "r" / "summary.json").read_text()) if comm.rank == 0 else None
    )
    return found


@pytest.mark.parametrize("method", ["newton", "augmented-lagrangian"])
def test_levels(method: str, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = case(
        comm,
        shared_tmp_path,
        f'[loading]\nvalues = [300.0, 400.0]\n[solve]\nmethod = "{method}"\n',
    )
    assert main(["run", str(path), "-o", str(shared_tmp_path / "r"), "--report"]) == SOLVED
    steps = summary(comm, shared_tmp_path)["steps"]
    assert steps[-1]["zeta"] == 400.0
    assert steps[-1]["balance"] < 1e-6
    if comm.rank == 0:
        page = (shared_tmp_path / "r" / "report.html").read_text(encoding="utf-8")
        assert "Hill 1948" in page


def test_work(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = case(comm, shared_tmp_path, '[loading]\ncontrol = "work"\nvalues = [0.004]\n')
    assert main(["run", str(path), "-o", str(shared_tmp_path / "r")]) == SOLVED
    last = summary(comm, shared_tmp_path)["steps"][-1]
    assert last["zeta"] <= LIMIT * (1 + 1e-9)


def test_limit_and_bounds(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = case(comm, shared_tmp_path, '[loading]\ncontrol = "bounds"\n')
    assert main(["run", str(path), "-o", str(shared_tmp_path / "r")]) == SOLVED
    found = summary(comm, shared_tmp_path)["limit"]
    assert found["lower"] == pytest.approx(LIMIT, rel=1e-3)
    assert found["upper"] == pytest.approx(LIMIT, rel=1e-3)
    checked = check(shared_tmp_path / "r" / "bounds.h5")
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())


def test_refused(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = case(comm, shared_tmp_path, "[loading]\nvalues = [1.0]\n")
    text = path.read_text(encoding="utf-8").replace("r33 = 0.9", "r33 = 0.3")
    assert main(["check", str(write_case(comm, shared_tmp_path / "b.toml", text))]) == BAD_INPUT
    err = comm.bcast(capsys.readouterr().err)
    assert "r33 = " in err
    assert err.count("\n") == 1
