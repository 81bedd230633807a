"""Test the table of the verification cases: wrong numbers, and the failures they cause."""

import math
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from mpi4py import MPI

import pytest

from demos.verification import verify
from demos.verification.study import Row, costs, line, orders, rates
from perfplast_fenicsx.io.results.result_folder import ResultFolder

ROW = Row("a case", "limit load", "P2", 0.1, 100, 1.01, 1.0, 0.02, 10, 0.5)


@pytest.mark.parametrize(
    ("changes", "right"),
    [
        ({}, True),
        ({"computed": 1.021}, False),
        ({"computed": 0.97}, False),
        ({"computed": math.nan}, False),
        ({"computed": 3.0, "allowed": None}, True),
        ({"computed": 0.5, "bound": True}, True),
        ({"computed": 1.021, "bound": True}, False),
        ({"computed": 1e-3, "exact": 0.0}, True),
        ({"computed": -0.03, "exact": 0.0}, False),
        ({"computed": -1.01, "exact": -1.0}, True),
        ({"factorisations": 36}, False),
        ({"factorisations": 30, "solves": 81}, False),
        ({"solves": 81}, True),
    ],
)
def test_a_number_is_right_within_what_is_allowed(changes: dict[str, float], right: bool) -> None:
    row = replace(ROW, **changes)  # type: ignore[arg-type]
    assert row.right is right
    assert ("WRONG" in line(row)) is not right


def test_orders_of_convergence() -> None:
    rows = [replace(ROW, size=h, computed=1 + 3 * h**2) for h in (0.4, 0.2, 0.1)]
    assert orders(rows) == pytest.approx([2.0, 2.0])
    assert orders([replace(ROW, size=h, computed=1.0) for h in (0.4, 0.2)]) == []
    (text,) = rates([*rows, replace(ROW, case="another")])
    assert text.endswith("a case, limit load, P2: 2.00, 2.00")


def test_what_limit_loads_took() -> None:
    taken = [(9, 24), (10, 31), (None, 90)]
    rows = [replace(ROW, factorisations=factors, solves=solves) for factors, solves in taken]
    (text,) = costs(rows)
    assert text == "limit loads, a case: 9 to 10 factorisations, 24 to 31 linear solves"


@pytest.mark.parametrize("computed", [1.0, 2.0])
def test_all_cases_are_run_and_one_wrong_number_is_a_failure(
    monkeypatch: pytest.MonkeyPatch,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    computed: float,
) -> None:
    seen: list[Path] = []

    def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
        seen.append(folder.path)
        wrong = len(seen) == 2
        return [replace(ROW, case=folder.path.name, computed=computed if wrong else 1.0)]

    def import_module(name: str) -> ModuleType:
        module = ModuleType(name)
        module.study = study  # type: ignore[attr-defined]
        return module

    monkeypatch.setattr(verify, "import_module", import_module)
    status = 0
    try:
        verify.main(["--coarse", "-o", str(shared_tmp_path)])
    except SystemExit as end:
        status = int(end.code or 0)
    assert status == (computed != 1.0)
    assert [path.name for path in seen] == list(verify.CASES)
    out = capsys.readouterr().out
    if comm.rank == 0:
        assert f"{len(verify.CASES)} numbers checked, {status} wrong" in out
        assert out.count("WRONG") == status
