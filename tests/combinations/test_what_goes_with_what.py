"""The page that tells what goes with what is true.

Each statement with one question, another one for each, and all that is refused before anything is
computed. ``PERFPLAST_FUZZ=2`` asks everything.
"""

import os
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.cli.parser import BAD_INPUT
from tests.combinations.answers import answer
from tests.combinations.page import PAGE, shown
from tests.combinations.questions import QUESTIONS
from tests.combinations.refusals import REFUSALS, remark
from tests.combinations.statements import STATEMENTS, Statement

pytestmark = [
    pytest.mark.serial,
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="runs are those of one process"),
]

EVERYTHING = float(os.environ.get("PERFPLAST_FUZZ", "1")) >= 2

ASKED = [
    pytest.param(statement, question, id=f"{statement.words} - {question}")
    for number, statement in enumerate(STATEMENTS)
    for place, question in enumerate(QUESTIONS)
    if EVERYTHING
    or place == number % len(QUESTIONS)
    or shown()[statement.words, question].startswith("[")
]


@pytest.mark.parametrize(("statement", "question"), ASKED)
def test_as_shown(statement: Statement, question: str, tmp_path: Path) -> None:
    there = shown()[statement.words, question]
    given = answer(statement, question, tmp_path)
    if there == "yes":
        assert given.words == "yes"
        return
    kind, _, sentence = given.words.partition(": ")
    assert remark(sentence) in PAGE.read_text(encoding="utf-8")
    if there.startswith("["):
        assert given.status == BAD_INPUT or kind == "no"
    else:
        assert kind == f"the {there.split()[0]} one"
    assert _note(there) in _plain(sentence)


def test_no_refusal_is_left_over() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert [words for words in REFUSALS if words not in text] == []


def _note(there: str) -> str:
    """The sentence that the number of a cell stands for."""
    number = there[there.index("[") + 1 : there.index("]")]
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith(f"| {number} |"))
    return _plain(line.split("|")[2])


def _plain(sentence: str) -> str:
    return " ".join(sentence.split())
