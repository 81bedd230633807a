"""Test the completion of words by the shell with the Tab key."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from perfplast_fenicsx.cli.parser import complete, make_parser

pytestmark = pytest.mark.serial

LINES = {
    "perfplast ": {
        "doctor",
        "run",
        "mesh",
        "check",
        "plot",
        "animate",
        "report",
        "materials",
        "info",
        "schema",
        "template",
        "setup",
        "claim",
        "mcp",
        "sweep",
        "export",
    },
    "perfplast re": {"report"},
    "perfplast run --l": {"--log-level"},
    "perfplast run x --log-level ": {"debug", "info", "warning", "error"},
    "perfplast run ": {"case.toml", "results/"},
    "perfplast plot ": {"results/"},
    "perfplast mesh ": {"part.step", "results/"},
    "perfplast animate results -o ": {"old.gif", "results/"},
    "perfplast report results -o ": {"page.html", "results/"},
}
"""Typed texts, each with all completions, or with all completions that do not begin with a dash."""

# a separate process, because argcomplete uses the file descriptor 9
ASK = """
import io, json, os, sys
from perfplast_fenicsx.cli.parser import make_parser
from perfplast_fenicsx.cli.parser import complete

class Ended(Exception):
    pass

def end(_):
    raise Ended

found = {}
for line in json.load(sys.stdin):
    os.environ |= {"COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9"}
    os.environ |= {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "|"}
    stream = io.StringIO()
    try:
        complete(make_parser(), exit_method=end, output_stream=stream)
    except Ended:
        found[line] = [word.strip() for word in stream.getvalue().split("|")]
slow = {"mpi4py.MPI", "petsc4py.PETSc", "dolfinx", "numpy", "scipy"}
print(json.dumps([found, sorted(slow & set(sys.modules))]))
"""


def test_completion(tmp_path: Path) -> None:
    pytest.importorskip("argcomplete")
    for name in ("case.toml", "notes.txt", "old.gif", "page.html", "part.step"):
        (tmp_path / name).touch()
    (tmp_path / "results").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", ASK],
        input=json.dumps(list(LINES)),
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    answers, slow = json.loads(done.stdout)
    assert slow == []  # modules whose import takes a second
    found = {line: set(words) for line, words in answers.items()}
    for line, expected in LINES.items():
        typed = line.split(" ")[-1]
        words = {word for word in found[line] if typed or not word.startswith("-")}
        assert words == expected


def test_nobody_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("_ARGCOMPLETE", raising=False)
    complete(make_parser(), exit_method=None)  # does nothing
