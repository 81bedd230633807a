"""Test sweeps: a case for each value, one table, continuation after a stop, and refusals."""

import csv
import json
import signal
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Contact, InputError, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.cli.recorder import Recorder
from perfplast_fenicsx.cli.signals import Interrupted
from perfplast_fenicsx.io.case.variations import Variation, grid, read_variation, varied
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 300.0)
BLOCKS = case_text(
    {"builder": "stacked_blocks", "n": 1},
    {"lower": STEEL, "upper": VonMises(2e5, 0.3, 400.0)},
    [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
    contacts=[Contact("lower_top", "upper_bottom")],
    more="[output]\npictures = false\n",
)
LIMIT = '[element]\ndegree = 2\n[loading]\ncontrol = "bounds"\n'
LEVELS = "[loading]\nvalues = [50.0, 100.0]\n"
VARY = ["--vary", "material.lower.yield_stress=300:500:2", "--vary", "load.top.pressure=1,2"]


def table(comm: MPI.Intracomm, folder: Path) -> list[dict[str, str]]:
    """Return the rows of ``sweep.csv``. Collective."""
    if comm.rank == 0:
        with (folder / "sweep.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    found: list[dict[str, str]] = comm.bcast(rows if comm.rank == 0 else None)
    return found


@pytest.mark.mpi2
def test_a_case_for_each_pair_of_values(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The weaker block yields at min(Y, 400)/p."""
    case = write_case(comm, shared_tmp_path / "case.toml", BLOCKS + LIMIT)
    folder = shared_tmp_path / "r"
    assert main(["sweep", str(case), "-o", str(folder), *VARY]) == SOLVED
    rows = table(comm, folder)
    assert len(rows) == 4
    for row in rows:
        strength = float(row["material.lower.yield_stress"])
        exact = min(strength, 400.0) / float(row["load.top.pressure"])
        assert float(row["lower"]) <= exact <= float(row["upper"])
        assert float(row["upper"]) / float(row["lower"]) < 1.001
    assert (folder / "sweep.png").stat().st_size > 10_000
    if comm.rank == 0:
        summary = json.loads((folder / "0001" / "summary.json").read_text(encoding="utf-8"))
        assert "material.lower.yield_stress = 300, load.top.pressure = 1" in summary["remarks"]
        assert "perfplast sweep" in summary["surroundings"]["command"]
        (folder / "0001" / "summary.json").unlink()
    comm.barrier()
    capsys.readouterr()
    assert main(["sweep", str(case), "--restart", str(folder), *VARY]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    assert out.count("Results in") == 2, "one case, and the table"
    again = table(comm, folder)
    assert again[1:] == rows[1:]
    assert float(again[0]["lower"]) == pytest.approx(float(rows[0]["lower"]), rel=1e-6)


def test_what_is_stopped_goes_on(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sweep stops three times, and solves no level twice."""
    case = write_case(comm, shared_tmp_path / "case.toml", BLOCKS + LEVELS)
    folder, solved = shared_tmp_path / "r", list[float]()
    level, vary = Recorder.level, ["--vary", "load.top.pressure=0.5,1.0,1.5"]

    def stopped(self: Recorder, found: Any, search: Any = None) -> None:
        level(self, found, search)
        solved.append(found.state.zeta)
        if len(solved) in (1, 2, 5):
            raise Interrupted(signal.SIGTERM)

    monkeypatch.setattr(Recorder, "level", stopped)
    statuses = [main(["sweep", str(case), "-o", str(folder), *vary])]
    while statuses[-1] != SOLVED and len(statuses) < 5:
        statuses.append(main(["sweep", str(case), "--restart", str(folder), *vary]))
    assert statuses == [128 + signal.SIGTERM] * 3 + [SOLVED]
    assert solved == [50.0, 100.0] * 3
    again = f"perfplast sweep {case} --restart {folder} --vary=load.top.pressure=0.5,1.0,1.5"
    if comm.rank == 0:
        assert again in (folder / "0001" / "run.log").read_text(encoding="utf-8")
    assert [float(row["zeta"]) for row in table(comm, folder)] == [100.0] * 3


@pytest.mark.parametrize(
    ("vary", "part"),
    {
        "load.top": "--vary load.top does not have",
        "load.top.pressure=1:2": "FROM:TO:NUMBER with NUMBER",
        "load.top.pressure=1:2:1": "FROM:TO:NUMBER with NUMBER",
        "load.top.pressure=": "load.top.pressure= does not have",
        "load.top.pressure=3:3:5": "the value 3.0 occurs twice",
        "load.top.pressure=1,2,1": "the value 1 occurs twice",
        "load.top.pressure=1,,2": "a value between commas is empty",
        "load.tip.pressure=1,2": "there is no 'tip' in the case; did you mean 'top'",
        "material.lwer.young=1,2": "there is no 'lwer' in the case; did you mean 'lower'",
        "load.top.presure=1,2": "load.top.presure = 1: case.toml, [[load]]:",
        "material.lower.yield_stress=-1,1": "with material.lower.yield_stress = -1: case.toml",
        "mesh.n=1:10:20000": "the sweep has more than 10000 cases",
    }.items(),
)
def test_refused_before_anything_is_solved(
    vary: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    case = write_case(comm, shared_tmp_path / "case.toml", BLOCKS + LIMIT)
    folder = shared_tmp_path / "r"
    assert main(["sweep", str(case), "-o", str(folder), "--vary", vary]) == BAD_INPUT
    err = comm.bcast(capsys.readouterr().err)
    assert part in err
    assert len(err.strip().splitlines()) == 1
    assert not folder.exists()


@pytest.mark.serial
def test_values() -> None:
    assert read_variation("a.b = 1:2:3") == Variation("a.b", (1.0, 1.5, 2.0))
    assert read_variation("a=1,2.5,x").values == (1, 2.5, "x")
    assert grid([Variation("a", (1, 2)), Variation("b", (3, 4))])[1] == {"a": 1, "b": 4}
    with pytest.raises(InputError, match="twice"):
        grid([Variation("a", (1,)), Variation("a", (2,))])


@pytest.mark.serial
def test_places() -> None:
    """Places are tables, entries by name, surface or number, and list items; the input stays."""
    given = {"m": {"x": 1}, "load": [{"on": "top"}, {"name": "wind", "t": [0.0, 1.0]}]}
    found = varied(given, {"m.x": 2, "load.top.p": 3, "load.wind.t.1": 4, "load.1.u": 5})
    assert found["m"] == {"x": 2}
    assert found["load"] == [{"on": "top", "p": 3}, {"name": "wind", "t": [0.0, 4], "u": 5}]
    assert given["m"] == {"x": 1}
    with pytest.raises(InputError, match="is a value, not a table"):
        varied(given, {"m.x.y": 1})
    with pytest.raises(InputError, match="several entries are called"):
        varied({"load": [{"on": "top"}, {"on": "top"}]}, {"load.top.p": 1})
