"""Test load combinations in a case file: separate solutions, a table, and refusals."""

import csv
import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.proof import check
from tests.case_runs import assert_case_refused
from tests.models import SLOPE_TABLES, case_text, write_case

ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
TOUCHING = [Contact("lower_top", "upper_bottom")]
WEIGHT, LIVE = (0.0, 0.0, -40.0), 100.0
LOADS = f"""[[load]]
name = "weight"
on = "upper"
body_force = {list(WEIGHT)}
[[load]]
name = "live"
on = "top"
pressure = "{LIVE} + 0*x"
"""
COMBINED = {
    "G": {"weight": 1.0},
    "1.35 G + 1.5 Q": {"weight": 1.35, "live": 1.5},
    "G + 1.5 Q": {"weight": 1.0, "live": 1.5},
    "1.35 G": {"weight": 1.35, "live": 0.0},
    "3.3 Q": {"live": 3.3},
    "Q, weaker": {"live": 1.0, "strength": 1.25},
}
"""Combinations with factors on loads and on strengths."""
BOUNDS = '[loading]\ncontrol = "bounds"\n'
NEAR = 1e-7


def text_of(more: str) -> str:
    """Return the case of two blocks under combined loads."""
    text = case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": VonMises(2e5, 0.3, 330.0), "upper": VonMises(2e5, 0.3, 440.0)},
        ROLLERS,
        contacts=TOUCHING,
        more="[element]\ndegree = 2\n[output]\npictures = false\n" + more,
    )
    head, _, rest = text.partition("[[load]]")
    return head + LOADS + rest[rest.index("\n[") :]


def tables(combined: dict[str, dict[str, float]]) -> str:
    """Return combinations as tables of a case file."""
    text = ""
    for name, factors in combined.items():
        of_loads = {load: factor for load, factor in factors.items() if load != "strength"}
        inside = ", ".join(f"{load} = {factor}" for load, factor in of_loads.items())
        text += f'[[combination]]\nname = "{name}"\nfactors = {{ {inside} }}\n'
        text += f"strength = {factors.get('strength', 1.0)}\n"
    return text


def alone(comm: MPI.Intracomm, factors: dict[str, float], divided: float) -> Any:
    """Return the bounds of one combination as a separate problem. Collective."""
    weight, live = factors.get("weight", 0.0), factors.get("live", 0.0)
    loads: list[Any] = [Pressure("top", live * LIVE)] if live else []
    loads += [BodyForce("upper", tuple(weight * g for g in WEIGHT))] if weight else []
    strengths, divided = {"lower": 330.0, "upper": 440.0}, divided * factors.get("strength", 1.0)
    steels = {body: VonMises(2e5, 0.3, given / divided) for body, given in strengths.items()}
    problem = Problem(stacked_blocks(comm, 1), steels, ROLLERS, loads, TOUCHING, degree=2)
    return limit_bounds(problem, NEAR)


@pytest.mark.long
def test_each_is_as_if_it_were_alone(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Results agree to the tolerance of the search: earlier work affects the mesh partition."""
    asked = f"{BOUNDS}limit_tolerance = {NEAR}\n"
    text = text_of(tables(COMBINED) + "[design]\nstrength = 1.1\n" + asked)
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results), "--report"]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    assert "all strengths are divided by 1.1." in out
    for name, factors in COMBINED.items():
        told = comm.bcast(
            json.loads((results / name / "summary.json").read_text()) if comm.rank == 0 else None
        )
        body, expected = told["limit"]["body"], alone(comm, factors, 1.1)
        assert body["lower"] == pytest.approx(expected.lower.value, rel=2 * NEAR)
        assert body["upper"] == pytest.approx(expected.upper.value, rel=2 * NEAR)
        if comm.rank == 0:
            proven = check(results / name / "bounds.h5")
            assert not any(half.faults for half in proven.values())
            page = (results / name / "report.html").read_text(encoding="utf-8")
            assert all(f">{other}<" in page for other in COMBINED if other != name)
            assert f">{name} (this page)<" in page
            assert f"perfplast run {case} -o {results} --report" in page
            assert "-perfplast_limit_" not in page, "solvers set that for themselves"
    if comm.rank == 0:
        with (results / "combinations.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert [row["combination"] for row in rows[:2]] == ["3.3 Q", "1.35 G + 1.5 Q"]
        lowers = [float(row["lower"]) for row in rows]
        assert lowers == sorted(lowers)
        assert [row["design load"] for row in rows] == ["not carried", *["carried"] * 5]
        assert "The worst of 6: '3.3 Q' (zeta = 1) is not carried" in out
        assert "'1.35 G + 1.5 Q' (zeta = 1) is carried for certain, 1.47" in out
    assert main(["run", str(case), "--restart", str(results)]) == SOLVED
    again = comm.bcast(capsys.readouterr().out)
    assert again.count("is already solved") == len(COMBINED)
    assert out.splitlines()[-1] == again.splitlines()[-1]


ENVELOPE = '[loading]\ncontrol = "envelope"\nfirst = ["live"]\nsecond = ["weight"]\n'
GOOD = tables({"A": {"weight": 1.0}})
HEATED = '[[temperature]]\nname = "heat"\non = "lower"\nchange = 1.0\n'


@pytest.mark.parametrize(
    ("more", "part"),
    {
        tables({"A": {"wieght": 1.0}}) + BOUNDS: "no load 'wieght'; did you mean 'weight'",
        tables({"A": {"weight": -1.0}}) + BOUNDS: "of 'weight' is -1; give 0",
        tables({"A": {"weight": 0.0}}) + BOUNDS: "'A' has no factor above 0",
        tables({"A": {}}) + BOUNDS: "'A' has no factor above 0",
        tables({"A": {"live": float("inf")}}) + BOUNDS: "the factor of 'live' is inf",
        tables({"A/B": {"weight": 1.0}}) + BOUNDS: "cannot be the name of a folder",
        tables({"..": {"weight": 1.0}}) + BOUNDS: "name = '..' cannot be the name of a folder",
        tables({"": {"weight": 1.0}}) + BOUNDS: "name = '' cannot be",
        tables({"A\\n": {"weight": 1.0}}) + BOUNDS: "cannot be the name of a folder",
        HEATED + tables({"A": {"heat": 1.0}}) + BOUNDS: "'heat' is not a load: temperatures",
        GOOD.replace("1.0", '"fill in: the code"') + BOUNDS: "weight is not filled in (the",
        '[design]\nstrength = "fill in: B.8"\n' + BOUNDS: "strength is not filled in (B.8)",
        GOOD + GOOD + BOUNDS: "number 2: two combinations are called 'A'",
        GOOD + "[loading]\nvalues = [1.0]\n": "combinations need a control",
        GOOD + '[loading]\ncontrol = "strength"\n': "constant",
        GOOD + ENVELOPE: "by one load factor each",
        GOOD.replace("strength = 1.0", "strength = { uper = 1.1 }")
        + BOUNDS: "'uper', which is not",
        "[design]\nstrength = 0.0\n" + BOUNDS: "strength = 0 is not positive",
        "[design]\nstrength = { uper = 1.1 }\n" + BOUNDS: "strength has an entry for 'uper'",
    }.items(),
)
def test_refused_in_one_sentence(
    more: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert_case_refused(comm, shared_tmp_path, text_of(more), part, capsys)


def test_one_in_which_nothing_grows(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The program refuses this combination before it solves another one."""
    more = tables({"B": {"live": 1.0}}) + GOOD + '[loading]\ncontrol = "work"\nuntil = "limit"\n'
    text = text_of(more).replace('on = "upper"\nbody', 'on = "upper"\nconstant = true\nbody')
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r")]) == BAD_INPUT
    err = comm.bcast(capsys.readouterr().err)
    assert "[[combination]] 'A': control = 'work'" in err
    assert not (shared_tmp_path / "r").exists()


def test_one_that_is_not_refined(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = write_case(comm, shared_tmp_path / "case.toml", text_of(GOOD + BOUNDS))
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r"), "--refine"]) == BAD_INPUT
    assert "--refine solves only one case" in comm.bcast(capsys.readouterr().err)


def test_loads_that_are_scaled() -> None:
    """Factors apply to numbers, formulas, and all other values of a load."""
    from perfplast_fenicsx.problem.declared.loads import Force, scaled

    assert scaled(Pressure("top", "2*x"), 1.5).value == "1.5*(2*x)"
    assert scaled(Traction("top", (1.0, "z")), 2.0).value == [2.0, "2.0*(z)"]
    force = Force("top", (1.0, 2.0), moment=3.0, point=(1.0, 1.0))
    found = scaled(force, 2.0)
    assert isinstance(found, Force)
    assert (found.value, found.moment, found.point) == ([2.0, 4.0], 6.0, (1.0, 1.0))


SLOPE = f'title = "Slope by EN 1997"\nloading.control = "strength"\n{SLOPE_TABLES}'
SLOPE += """
[[combination]]
name = "given"
factors = { gravity = 1.0 }
[[combination]]
name = "DA1-2"
factors = { gravity = 1.0 }
strength = 1.25
[[combination]]
name = "too weak"
factors = { gravity = 1.0 }
strength = { ground = 3.5 }
"""


@pytest.mark.long
def test_each_combination_has_its_factor_of_safety(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """F times the partial factor on strengths is constant, to the tolerance of F."""
    case = write_case(comm, shared_tmp_path / "case.toml", SLOPE)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    assert "combination 'DA1-2': 1 × gravity; strengths divided by 1.25." in out
    if comm.rank:
        return
    with (results / "combinations.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["combination"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["too weak", "DA1-2", "given"]
    verdicts = ["not carried", "carried", "carried"]
    assert [row["design load"] for row in rows.values()] == verdicts
    for side in ("lower", "upper"):
        given = float(rows["given"][side])
        assert 1.25 * float(rows["DA1-2"][side]) == pytest.approx(given, rel=3e-3)
        assert 3.5 * float(rows["too weak"][side]) == pytest.approx(given, rel=3e-3)
