"""Test a control from outside the package, as one class and one entry, in whole runs."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from unittest import mock

from mpi4py import MPI

import pytest

from perfplast_fenicsx import InputError, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.controls.control import Given, Moved, OfLevels, Run, none_moved
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 300.0)
BLOCKS = case_text(
    {"builder": "stacked_blocks", "n": 1},
    {"lower": STEEL, "upper": STEEL},
    [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
    more='[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
    "[output]\npictures = false\n",
)


@dataclass(frozen=True)
class Deflection(OfLevels):
    """Load until the largest displacement reaches a given value.

    Args:
        largest: The displacement (length).
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    drives: ClassVar[bool] = False
    values: ClassVar[None] = None

    largest: float

    def __post_init__(self) -> None:
        if not self.largest > 0:
            raise InputError(f"largest = {self.largest} is no displacement; give one above 0.")

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """None."""
        return none_moved

    def check(self, given: Given) -> None:
        """Refuse bodies without loads."""
        given.require_load()

    def find(self, run: Run) -> None:
        """Search along secants. Collective."""
        state, zeta = None, 1.0
        for _ in range(20):
            level = run.solver.solve(zeta, state, run.record.iteration)
            run.record.level(level)
            reached = level.report.max_displacement
            if not level.report.converged or abs(reached / self.largest - 1) < 1e-6:
                return
            state, zeta = level.state, zeta * self.largest / reached


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    """Return the one entry of this control."""
    with mock.patch.dict(CONTROLS, {"deflection": Deflection}):
        yield


def written(comm: MPI.Intracomm, path: Path, loading: str) -> Path:
    return write_case(comm, path, f'{BLOCKS}[loading]\ncontrol = "deflection"\n{loading}\n')


def test_a_whole_run(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    case = written(comm, shared_tmp_path / "case.toml", "largest = 1e-3")
    folder = shared_tmp_path / "r"
    assert main(["run", str(case), "-o", str(folder), "--report"]) == SOLVED
    found: dict[str, Any] = comm.bcast(
        json.loads((folder / "summary.json").read_text()) if comm.rank == 0 else None
    )
    last = found["steps"][-1]
    assert len(found["steps"]) == 2
    # two blocks, 2 high and 1 wide, under pressure from above
    across = 0.3 / 2
    assert last["max_displacement"] == pytest.approx(1e-3, rel=1e-6)
    assert last["zeta"] == pytest.approx(1e-3 / 2 * 2e5 / (1 + 2 * across**2) ** 0.5, rel=1e-6)
    assert last["balance"] < 1e-9
    if comm.rank == 0:
        assert "100.0" not in (folder / "path.csv").read_text().splitlines()[0]
        assert "<html" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("loading", "part"),
    {
        "largest = 0.0": "[loading]: largest = 0.0 is no displacement",
        "": "'largest' is missing",
        "values = [1.0]": "there is no key 'values' here",
        "largest = 1.0\n[[mesh.adapt]]": "[mesh]",
        'largest = 1.0\n[solve]\nmethod = "work-newton"': "has control = 'deflection'",
    }.items(),
)
def test_what_is_wrong_with_it(
    loading: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    case = written(comm, shared_tmp_path / "case.toml", loading)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r")]) == BAD_INPUT
    assert part in comm.bcast(capsys.readouterr().err)
