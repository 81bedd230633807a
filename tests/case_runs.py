"""Run a case file completely, with the same results on every rank."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT
from tests.models import write_case


@dataclass(frozen=True)
class CaseRun:
    """The result of running a case.

    Attributes:
        status: Exit status of the command.
        out: Standard output of rank 0.
        err: Standard error of rank 0.
        folder: Folder of the results.
        summary: ``summary.json``; empty if the file does not exist.
    """

    status: int
    out: str
    err: str
    folder: Path
    summary: dict[str, Any]


def run_case(
    comm: MPI.Intracomm,
    folder: Path,
    text: str,
    capsys: pytest.CaptureFixture[str],
    *more: str,
) -> CaseRun:
    """Run a case file, whose mesh may be in the same folder. Collective.

    Args:
        comm: The ranks.
        folder: A folder common to all ranks; the results are in its subfolder ``r``.
        text: Text of the case file.
        capsys: The fixture of the test.
        more: Additional arguments of ``perfplast run``.
    """
    case, results = write_case(comm, folder / "case.toml", text), folder / "r"
    status = main(["run", str(case), "-o", str(results), *more])
    out, err = comm.bcast(tuple(capsys.readouterr()))
    path = results / "summary.json"
    there = comm.rank == 0 and path.exists()
    summary = json.loads(path.read_text(encoding="utf-8")) if there else {}
    return CaseRun(status, out, err, results, comm.bcast(summary))


def assert_case_refused(
    comm: MPI.Intracomm,
    folder: Path,
    text: str,
    part: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Check that a case is refused with one sentence that contains a given part. Collective."""
    found = run_case(comm, folder, text, capsys)
    assert found.status == BAD_INPUT
    assert part in found.err
    assert len(found.err.strip().splitlines()) == 1
