"""Test ``[solve] conic``: runs with another solver, and sentences where it is not possible."""

import json
import sys
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from tests.functional.test_command_line import one_line
from tests.models import steel_blocks_case, write_case

BOUNDS = '[loading]\ncontrol = "bounds"\nlimit_tolerance = 1e-6\n'
LEVELS = "[loading]\nvalues = [1.0]\n"
PATH = '[loading]\ncontrol = "work"\nuntil = "limit"\nlimit_method = "path"\n'


def case_of(comm: MPI.Intracomm, folder: Path, loading: str, solve: str) -> str:
    """Write the case of two blocks that are pressed together."""
    text = steel_blocks_case(f"[output]\npictures = false\n[solve]\n{solve}\n{loading}")
    return str(write_case(comm, folder / "case.toml", text))


@pytest.mark.serial
def test_a_run_by_clarabel(
    comm: MPI.Intracomm, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("clarabel", reason="the conic solver Clarabel is not installed")
    case = case_of(comm, tmp_path, BOUNDS, 'conic = "clarabel"')
    assert main(["run", case, "-o", str(tmp_path / "r")]) == SOLVED
    assert "method interior-point on 1 rank, clarabel" in capsys.readouterr().out
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert "conic programs are solved by clarabel" in summary["remarks"]
    body = summary["limit"]["body"]
    assert body["lower"] <= 300.0 * (1 + 1e-9)
    assert [body["lower"], body["upper"]] == pytest.approx([300.0, 300.0], rel=2e-6)


@pytest.mark.mpi2
def test_where_it_cannot_run(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """check and run refuse it on several ranks, and without the package."""
    monkeypatch.setitem(sys.modules, "clarabel", None)
    case = case_of(comm, shared_tmp_path, BOUNDS, 'conic = "clarabel"')
    said = "install it (pip install clarabel)" if comm.size == 1 else f"the run has {comm.size}"
    for command in (["check", case], ["run", case, "-o", str(shared_tmp_path / "r")]):
        assert main(command) == BAD_INPUT
        assert said in one_line(comm, capsys)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("loading", "solve", "said"),
    [
        (BOUNDS, 'conic = "clarabell"', "conic = 'clarabell' is unknown"),
        (LEVELS, 'conic = "clarabel"', "applies only to limit loads"),
        (PATH, 'conic = "clarabel"', "the case selects a loading path"),
        (BOUNDS, 'conic = "clarabel"\nmethod = "newton"', "the case selects a loading path"),
    ],
)
def test_where_it_has_nothing_to_solve(
    comm: MPI.Intracomm,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    loading: str,
    solve: str,
    said: str,
) -> None:
    assert main(["check", case_of(comm, tmp_path, loading, solve)]) == BAD_INPUT
    assert said in one_line(comm, capsys)
