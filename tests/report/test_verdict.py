"""Test that the verdict is not stronger than the proof."""

from types import SimpleNamespace
from typing import Any

import pytest

from perfplast_fenicsx.io import Scene
from perfplast_fenicsx.pictures.result_reader import StoredLimit
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.report.verdict import Verdict, verdict_on
from tests.io.results.test_result_folder import report

pytestmark = pytest.mark.serial

WHY = ["lower bound: not computed"]


def of_levels(
    *reports: LevelReport,
    driven: bool = False,
    planned: int | None = None,
    case: bool = False,
    interrupted: str = "",
    **given: Any,
) -> Verdict:
    scene = Scene("", driven=driven)
    case_file = {"file": "a.toml"} if case else {}
    summary = SimpleNamespace(given=given, units={}, planned=planned, case=case_file)
    reader = SimpleNamespace(
        limit=None, reports=reports, scene=scene, summary=summary, interrupted=interrupted
    )
    return verdict_on(reader)  # type: ignore[arg-type]


def plain(zeta: float, **more: Any) -> LevelReport:
    return report(zeta, **({"stage": "", "factors": {}, "works": {}} | more))


@pytest.mark.parametrize(
    ("body", "mark", "words"),
    [
        ({"lower": 1.23456789, "upper": 3.45678901}, "proven", ["ζ = 1.23456 ", "ζ = 3.45679 "]),
        ({"upper": 3.0, "why_not": WHY}, "one-sided", ["collapse at ζ = 3 at the latest"]),
        ({"lower": 1.0}, "one-sided", ["carry ζ = 1 for certain"]),
        ({}, "found", ["The limit load of this mesh is ζ = 2 ("]),
    ],
)
def test_limit_loads(body: dict[str, Any], mark: str, words: list[str]) -> None:
    limit = StoredLimit(1.5, 2.0, 2.5, body)
    table = SimpleNamespace(limit={"levelled_off": True, "reason": ""})
    verdict = verdict_on(SimpleNamespace(limit=limit, summary=table, reports=[]))  # type: ignore[arg-type]
    assert verdict.mark == mark
    for word in words:
        assert word in verdict.sentence
    if body.get("why_not"):
        assert "Lower bound: not computed." in verdict.details
    # the only pair of numbers is the proven one, and statements on the mesh are no bounds
    assert [text.count("2.5") for text in (verdict.sentence, *verdict.details)] == [0] * (
        1 + len(verdict.details)
    )
    (known,) = (a for a in (verdict.sentence, *verdict.details) if "limit load of this mesh" in a)
    assert known == (
        "The limit load of this mesh is ζ = 2 (static and kinematic sides 67 % apart), an estimate "
        "for the body, not a bound."
    )


def test_several_meshes_have_a_last_one() -> None:
    body = {"lower": 1.0, "upper": 3.0, "meshes": [{"cells": 8}, {"cells": 16}]}
    table = SimpleNamespace(limit={"levelled_off": True, "reason": ""})
    found = SimpleNamespace(limit=StoredLimit(4.0, 4.0, 4.0, body), summary=table, reports=[])
    verdict = verdict_on(found)  # type: ignore[arg-type]
    assert verdict.mark == "proven"
    assert any("The limit load of the last mesh is ζ = 4 (" in text for text in verdict.details)


def test_a_search_that_ended_early() -> None:
    limit = StoredLimit(1.5, None, None, {})
    table = SimpleNamespace(limit={"levelled_off": False, "reason": "time was out"})
    verdict = verdict_on(SimpleNamespace(limit=limit, summary=table, reports=[]))  # type: ignore[arg-type]
    assert verdict.mark == "open"
    assert "No limit load was found" in verdict.sentence
    assert "Reason for the end of the search on this mesh: time was out." in verdict.details


def test_levels() -> None:
    assert "up to ζ = 8" in of_levels(plain(4.0), plain(8.0)).sentence
    assert of_levels().mark == "open"
    failed = of_levels(plain(4.0), plain(8.0, converged=False, reason="it fell"))
    assert failed.mark == "open"
    assert failed.sentence == (
        "The bodies carry ζ = 4 on this mesh, but at ζ = 8 no solution was found."
    )
    assert failed.details[0] == "Why: it fell."
    alone = of_levels(plain(8.0, converged=False))
    assert alone.sentence == "At ζ = 8 no solution was found."


def test_runs_that_have_not_come_to_their_end() -> None:
    ended = of_levels(plain(4.0), plain(8.0), planned=2, case=True)
    assert (ended.mark, ended.sentence[:3]) == ("found", "All")
    stopped = of_levels(plain(4.0), plain(8.0), planned=5, case=True)
    assert stopped.mark == "open"
    assert stopped.sentence == (
        "The bodies carry ζ = 8 on this mesh; 2 of 5 steps are solved, and the run continues or "
        "was stopped."
    )
    killed = of_levels(plain(4.0), plain(8.0), planned=5, case=True, interrupted="SIGTERM")
    assert killed.sentence.endswith("solved, and the run was interrupted (SIGTERM).")
    assert "interrupted (SIGINT) at its first" in of_levels(interrupted="SIGINT").sentence
    search = of_levels(plain(4.0), case=True)
    assert search.mark == "open"
    assert "the limit load is not found" in search.sentence
    moved = of_levels(plain(1.0), plain(2.0, converged=False), driven=True)
    assert moved.sentence == "All steps are solved up to ζ = 1, but at ζ = 2 no solution was found."


def test_motions_histories_and_friction() -> None:
    driven = of_levels(plain(1.0, driving_force=-7.0), plain(2.0, driving_force=5.0), driven=True)
    assert "driving force is -7, at ζ = 1" in driven.sentence
    assert "2 steps in 1 stage" in of_levels(report(1.0), report(2.0)).sentence
    rough = of_levels(plain(1.0), contacts=[{"coulomb": 0.3}])
    assert any("further solutions" in text for text in rough.details)
    assert not any("further solutions" in text for text in of_levels(plain(1.0)).details)
