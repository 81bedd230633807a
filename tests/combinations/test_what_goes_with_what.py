"""Test that the page on combinations of statements and questions is true.

``make test`` checks each question with one statement. ``PERFPLAST_FUZZ=2`` checks all questions
with all statements, as ``make verify`` does.
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

ASKED = (
    ("contact without friction", "ALG1"),
    ("a traction in addition to the pressure", "ALG2"),
    ("a body force in addition to the pressure", "ALG3"),
    ("a constant load (weight)", "ALG4"),
    ("pore pressure", "T-FETI"),
    ("hardening", "stages"),
    ("contact with nonmatching nodes", "limit load along a path"),
    ("a tie", "limit load by the interior point method"),
    ("a support that moves (settlement)", "bounds of the body"),
    ("a gap that closes", "bounds on adapted meshes"),
    ("ground (Mohr–Coulomb)", "shakedown, tied"),
    ("a joint that dilates", "ALG1"),
    ("a quadratic pressure", "bounds of the body"),
    ("curved cells", "bounds on adapted meshes"),
    ("hardening", "limit load by the interior point method"),
    ("a press fit", "shakedown, tied"),
)
"""Pairs for ``make test``: each question with one statement, and some refused pairs."""

CASES = [
    pytest.param(statement, question, id=f"{statement.words} - {question}")
    for statement in STATEMENTS
    for question in QUESTIONS
    if EVERYTHING or (statement.words, question) in ASKED
]


def test_what_is_asked_is_there() -> None:
    words = {statement.words for statement in STATEMENTS}
    assert all(asked in words and question in QUESTIONS for asked, question in ASKED)


@pytest.mark.parametrize(("statement", "question"), CASES)
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
    """Return the sentence to which the number in a table cell refers."""
    number = there[there.index("[") + 1 : there.index("]")]
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith(f"| {number} |"))
    return _plain(line.split("|")[2])


def _plain(sentence: str) -> str:
    return " ".join(sentence.split())
