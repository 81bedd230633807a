"""Test questions in words through the tool server: each has a proven answer or a refusal.

``tool_questions.toml`` contains the questions, the cases that a caller sends, and the known
answers.
"""

import subprocess
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import tool_server
from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.tool_server import Answer, Tools, answering
from perfplast_fenicsx.errors import UNLISTED
from perfplast_fenicsx.proof import check

pytestmark = [pytest.mark.serial, pytest.mark.usefixtures("undrawn")]

TABLE = Path(__file__).with_name("tool_questions.toml")
QUESTIONS = tomllib.loads(TABLE.read_text(encoding="utf-8"))["question"]
ANSWERED = [one for one in QUESTIONS if "answer" in one]
REFUSED = [one for one in QUESTIONS if "refused" in one]

MESHED = ("sand without cohesion", "no support", "side that is not there")
"""Questions whose refusal requires the mesh, which takes seconds."""

PATIENCE = 900
"""Longest time for a run (s)."""


def test_there_are_enough_questions() -> None:
    assert len(ANSWERED) + len(REFUSED) == len(QUESTIONS) >= 40
    assert len(REFUSED) >= 10
    assert len({one["name"] for one in QUESTIONS}) == len(QUESTIONS)


def asked(question: dict[str, Any], folder: Path) -> Tools:
    """Return the tools for a folder with the case of a question."""
    (folder / "case.toml").write_text(question["case"], encoding="utf-8")
    return Tools((folder.resolve(),))


def ended(tools: Tools) -> Answer:
    """Run the case to its end, and return the last status."""
    started = answering(tools.run)("case.toml", "out")
    assert started["ok"], started
    until = time.monotonic() + PATIENCE
    while (status := tools.status("out"))["state"] == "going on":
        assert time.monotonic() < until
        time.sleep(0.1)
    return status


@pytest.mark.long
@pytest.mark.parametrize("question", ANSWERED, ids=lambda one: one["name"])
def test_a_question_is_answered(question: dict[str, Any], tmp_path: Path) -> None:
    """The known answer lies between bounds that the checker proves independently."""
    tools = asked(question, tmp_path)
    assert tools.describe("case.toml")["ok"]
    status = ended(tools)
    assert (status["state"], status["exit_status"]) == ("ended", SOLVED), status
    claim = answering(tools.claim)("out")
    assert claim["ok"], claim
    assert claim["not_proven"] == []
    lower, upper, answer = claim["lower"], claim["upper"], question["answer"]
    rounding = 1e-6  # error of an answer with seven digits
    assert lower <= answer * (1 + rounding)
    assert upper >= answer * (1 - rounding)
    assert upper - lower <= question["width"] * lower
    assert claim["quantity"] == question["quantity"]
    assert {one["half"] for one in claim["proofs"]} == {"lower", "upper"}
    files = {one["half"]: Path("out") / Path(one["file"]).name for one in claim["proofs"]}
    assert all(tools.prove(str(file))["ok"] for file in set(files.values()))
    for half, file in files.items():
        if question["quantity"] != "factor of safety":  # files prove a multiple at a factor
            assert check(tmp_path / file)[half].proven == pytest.approx(claim[half], rel=1e-12)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the commands of the tools in this process, which is faster."""

    def end(command: Sequence[str]) -> subprocess.CompletedProcess[bytes]:
        capsys.readouterr()
        status = main([*command[len(tool_server._PROGRAM) :]])
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess([*command], status, out.encode(), err.encode())

    monkeypatch.setattr(tool_server, "_ended", end)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "question",
    [
        pytest.param(one, id=one["name"], marks=[pytest.mark.long] * (one["name"] in MESHED))
        for one in REFUSED
        if one["by"] == "check"
    ],
)
def test_a_question_is_refused(question: dict[str, Any], tmp_path: Path) -> None:
    """A missing number, or a wrong unit, does not become a default; no run begins."""
    tools = asked(question, tmp_path)
    for refused in (tools.check("case.toml"), answering(tools.run)("case.toml", "out")):
        assert not refused["ok"]
        error = refused["error"]
        assert question["refused"] in error["message"]
        assert error["remedy"]
        assert error["code"] != UNLISTED
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    "question", [one for one in REFUSED if one["by"] == "claim"], ids=lambda one: one["name"]
)
def test_what_is_not_proven_is_not_claimed(question: dict[str, Any], tmp_path: Path) -> None:
    tools = asked(question, tmp_path)
    assert ended(tools)["exit_status"] in (SOLVED, NO_SOLUTION)
    refused = answering(tools.claim)("out")
    assert not refused["ok"]
    assert question["refused"] in refused["error"]["message"]
