"""Test a yield set from outside the package, as one class and one entry, in whole runs."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Contact, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.proof import check
from tests.materials.energy_cap import Foam
from tests.models import case_text, write_case

FOAM = Foam(1e4, 0.3, 10.0, 3.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    """Return the one entry of this yield set."""
    with mock.patch.dict(MATERIALS, {"energy-cap": Foam}):
        yield


def ran(comm: MPI.Intracomm, folder: Path, loading: str, *more: str) -> dict[str, Any]:
    """Run foam under steel, and return the summary. Collective."""
    text = case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": FOAM, "upper": VonMises(2e5, 0.3, 100.0)},  # type: ignore[dict-item]
        ROLLERS,
        contacts=[Contact("lower_top", "upper_bottom")],
        more=f"[element]\ndegree = 2\n[output]\npictures = false\n[loading]\n{loading}\n",
    )
    case = write_case(comm, folder / "case.toml", text)
    assert main(["run", str(case), "-o", str(folder / "r"), *more]) == SOLVED
    found: dict[str, Any] = comm.bcast(
        json.loads((folder / "r" / "summary.json").read_text()) if comm.rank == 0 else None
    )
    return found


def test_levels_and_report(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    found = ran(comm, shared_tmp_path, "values = [5.0, 10.0]", "--report")
    last = found["steps"][-1]
    assert last["reactions"]["support bottom"] == pytest.approx([0.0, 0.0, 10.0], abs=1e-6)
    assert last["balance"] < 1e-9
    if comm.rank == 0:
        page = (shared_tmp_path / "r" / "report.html").read_text(encoding="utf-8")
        assert "energy-cap" in page


@pytest.mark.parametrize("method", ["interior-point", "path"])
def test_limit_load(method: str, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    loading = f'control = "work"\nuntil = "limit"\nlimit_method = "{method}"'
    limit = ran(comm, shared_tmp_path, loading)["limit"]
    assert limit["estimate"] == pytest.approx(FOAM.pressed(), rel=1e-3)


def test_strict_bounds(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    found = ran(comm, shared_tmp_path, 'control = "bounds"', "--report")["limit"]
    assert found["lower"] == pytest.approx(FOAM.pressed(), rel=1e-3)
    assert found["upper"] == pytest.approx(FOAM.pressed(), rel=1e-3)
    checked = check(shared_tmp_path / "r" / "bounds.h5")
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())
