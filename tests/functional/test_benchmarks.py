"""Test the benchmarks: E is the elastic solution, records fill the tables, goals are judged."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from benchmarks import case, limit, terms
from benchmarks.catalogue import GROUPS
from benchmarks.elastic import Elasticity
from benchmarks.goals import GOALS, Goal
from benchmarks.peers.step42 import read
from benchmarks.problems import MODELS
from benchmarks.table import is_wrong, report
from perfplast_fenicsx import Newton


def test_unit_is_the_elastic_solution(comm: MPI.Intracomm) -> None:
    model = MODELS["l_plate"]
    problem = model.problem(comm, 1, 1)
    unit = Elasticity(problem, model.material).measure()
    alpha = Newton(problem).solve(1e-3).report.alpha
    assert 1e-3 * unit.compliance == pytest.approx(alpha, rel=1e-6)
    assert unit.seconds > 0 and unit.iterations > 0


def test_a_record_fills_the_tables(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    output = shared_tmp_path / "record.json"
    case.main(["punch", "--n", "2", "--units", "2", "-o", str(output)])
    comm.Barrier()
    record = json.loads(output.read_text(encoding="utf-8"))
    assert not is_wrong(record)
    assert is_wrong(record | {"reference_error": 1e-6})
    text = report({"scaling": {"a job": [record, None]}})
    assert "FAILED" in text and f"{record['E_path']:.1f}" in text


def test_a_limit_load_is_measured(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    output = shared_tmp_path / "record.json"
    limit.main(["l_plate", "--n", "1", "--units", "1", "-o", str(output)])
    comm.Barrier()
    record = json.loads(output.read_text(encoding="utf-8"))
    assert not is_wrong(record)
    assert record["lower"] <= record["upper"] <= record["lower"] * 1.001
    assert f"{record['E_path']:.1f}" in report({"bolted_limit": {"a job": [record]}})


def test_a_level_with_all_terms_is_measured(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    output = shared_tmp_path / "record.json"
    terms.main(["--n", "1", "--repeats", "1", "-o", str(output)])
    comm.Barrier()
    record = json.loads(output.read_text(encoding="utf-8"))
    assert not is_wrong(record)
    assert record["newton_iterations"] > 1
    (goal,) = (goal for goal in GOALS if goal.groups == ("terms",))
    results = {"terms": {"1 rank": [record]}}
    assert goal.measured(results) == record["ratio"] > 0
    assert goal.text in report(results)


def test_goals_name_groups_and_are_judged() -> None:
    assert {group for goal in GOALS for group in goal.groups} <= set(GROUPS)
    goal = Goal("a", ("start",), lambda jobs: jobs["x"]["value"], 5.0, 3.0)
    for values, verdict in (((1.0, 2.0, 9.0), "aim reached"), ((4.0,), "met"), ((6.0,), "MISSED")):
        measured = goal.measured({"start": {"x": [{"value": value} for value in values]}})
        assert goal.verdict(measured) == verdict
    assert goal.verdict(goal.measured({"start": {"x": [None]}})) == "-"


def test_output_of_step_42_is_read() -> None:
    record = read(
        "   Number of degrees of freedom: 2187\n   Newton iteration 1\n"
        "         Error: 1 -> 0.1 in 7 Bicgstab iterations.\n   Newton iteration 2\n"
        "         Error: 1 -> 0.1 in 8 Bicgstab iterations.\n"
        "| Total wallclock time elapsed since start    |     0.9s |            |\n"
        "| Setup                           |         1 |     0.25s |       1.3% |\n"
    )
    assert (record["newton_iterations"], record["linear_iterations"]) == (2, 15)
    assert record["seconds"]["path"] == pytest.approx(0.65)  # type: ignore[index]
    with pytest.raises(ValueError, match="did not run to its end"):
        read("nothing")
