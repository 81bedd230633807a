"""Test cases that state published problems as users would: short, and ready to run."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED

pytestmark = [pytest.mark.serial, pytest.mark.usefixtures("undrawn")]

FOLDER = Path(__file__).resolve().parents[2] / "demos" / "verification" / "cases"
CASES = sorted(path.stem for path in FOLDER.glob("*.toml"))
SHORT = ("arch", "patch")
"""Cases that ``make test`` checks; ``make verify`` checks all."""
MOST_LINES = 30


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_short(name: str) -> None:
    lines = (FOLDER / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    assert len([line for line in lines if line.strip()]) <= MOST_LINES


@pytest.mark.parametrize(
    "name", [pytest.param(it, marks=[] if it in SHORT else pytest.mark.long) for it in CASES]
)
def test_a_case_can_be_run(
    name: str, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(FOLDER / f"{name}.toml"), "--trust"]) == SOLVED
    assert ("can be run" in capsys.readouterr().out) == (comm.rank == 0)
