"""Test a load from outside the package, as one class and one entry, in whole runs."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar
from unittest import mock

from mpi4py import MPI

import pytest
import ufl

from perfplast_fenicsx import Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.problem.declared.loads import LOADS, Formula, SpreadLoad
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 300.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
BLOCKS = case_text(
    {"builder": "stacked_blocks", "n": 1},
    {"lower": STEEL, "upper": STEEL},
    ROLLERS,
    more='[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
    '[element]\ndegree = 2\n[output]\npictures = false\n[units]\nsystem = "mm-N-MPa"\n',
).replace("pressure = 1.0", "suction = -2.0\nshare = 0.5")
LIMIT = '[loading]\ncontrol = "work"\nuntil = "limit"\n'


@dataclass(frozen=True)
class Suction(SpreadLoad):
    """Pull along the outward normal.

    Args:
        on: Physical surface.
        value: The pull (stress), a number or formula.
        share: How much of it acts.
        name: Name in messages.
        constant: Whether it acts in full at any load factor.
    """

    words: ClassVar[str] = "pull of a pump"
    quantities: ClassVar[Mapping[str, str]] = MappingProxyType({"value": "stress"})
    scalar: ClassVar[bool] = True

    on: str
    value: Formula
    share: float = 1.0
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: Any) -> Any:
        """Return the work along the normal."""
        return self.share * value * ufl.dot(ufl.FacetNormal(tagged_mesh.mesh), v)


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    """Return the one entry of this load."""
    with mock.patch.dict(LOADS, {"suction": Suction}):
        yield


def summary(comm: MPI.Intracomm, folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = comm.bcast(
        json.loads((folder / "summary.json").read_text()) if comm.rank == 0 else None
    )
    return found


def test_levels(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = write_case(
        comm, shared_tmp_path / "case.toml", BLOCKS + "[loading]\nvalues = [100.0, 200.0]\n"
    )
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r"), "--report"]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    assert "zeta = 1 is suction -2 MPa on 'top'." in out
    last = summary(comm, shared_tmp_path / "r")["steps"][-1]
    assert last["reactions"]["loads"] == pytest.approx([0.0, 0.0, -200.0], abs=1e-9)
    assert last["reactions"]["support bottom"] == pytest.approx([0.0, 0.0, 200.0], abs=1e-6)
    assert last["balance"] < 1e-9
    if comm.rank == 0:
        page = (shared_tmp_path / "r" / "report.html").read_text(encoding="utf-8")
        assert "pull of a pump -2 MPa" in page


@pytest.mark.parametrize("method", ["interior-point", "path"])
def test_limit_load(method: str, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """The limit load of a block under pressure from one side is its yield stress."""
    text = BLOCKS + LIMIT + f'limit_method = "{method}"\n'
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r")]) == SOLVED
    limit = summary(comm, shared_tmp_path / "r")["limit"]
    assert limit["estimate"] == pytest.approx(300.0, rel=1e-3)


def test_strict_bounds_refuse_it(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = BLOCKS + '[loading]\ncontrol = "bounds"\n'
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r")]) == BAD_INPUT
    err = comm.bcast(capsys.readouterr().err)
    assert "the load on 'top' is a suction, but strict bounds accept tractions" in err


@pytest.mark.parametrize(
    ("load", "part"),
    {
        "suction = -1.0\npressure = 1.0": "has pressure and suction",
        "share = 0.5": "has no load; give",
        "pressure = 1.0\nshare = 0.5": "has a share, which applies only to suction",
        'suction = "sin(t)"': "'t'",
        "suction = nan": "suction = nan",
    }.items(),
)
def test_refused(
    load: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = BLOCKS.replace("suction = -2.0\nshare = 0.5", load) + "[loading]\nvalues = [1.0]\n"
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["check", str(case)]) == BAD_INPUT
    err = comm.bcast(capsys.readouterr().err)
    assert part in err
    assert err.count("\n") == 1
