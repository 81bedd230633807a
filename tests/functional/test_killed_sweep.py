"""Test a sweep of 50 cases that is killed three times, each time in a separate process."""

import csv
import json
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.cli.parser import FAULT
from perfplast_fenicsx.environment import environment_with_package
from tests.functional.test_sweep import BLOCKS, LEVELS
from tests.models import write_case

pytestmark = [
    pytest.mark.long,
    pytest.mark.serial,
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="processes are those of one rank"),
]

COUNT = 50
# The process kills itself when the given number of levels is solved, or of files is in place.
SWEEP = """
import os, signal, sys
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.recorder import Recorder

solved, when, number, *arguments = sys.argv[1:]
left, plain, put = int(number), Recorder.level, os.replace

def reached(place):
    global left
    if place == when:
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

def level(self, found, *more):
    with open(solved, "a") as file:
        file.write(f"{self.results.summary.remarks} at {found.state.zeta}\\n")
    reached("before it is on file")
    plain(self, found, *more)
    reached("behind it")

def replace(source, target, **more):
    reached("while a file is put in place")
    put(source, target, **more)

Recorder.level, os.replace = level, replace
sys.exit(main(arguments))
"""


def test_goes_on_and_computes_nothing_twice(tmp_path: Path) -> None:
    """Only the level without a file is computed twice; the table has all 50 rows."""
    case = write_case(MPI.COMM_SELF, tmp_path / "case.toml", BLOCKS + LEVELS)
    script, solved, folder = tmp_path / "sweep.py", tmp_path / "solved.txt", tmp_path / "r"
    script.write_text(SWEEP, encoding="utf-8")
    vary = ["--vary", f"load.top.pressure=0.5:1.5:{COUNT}"]

    def run(when: str, number: int, where: str) -> int:
        told = ["sweep", str(case), where, str(folder), *vary]
        command = [sys.executable, str(script), str(solved), when, str(number), *told]
        apart = environment_with_package()
        ended = subprocess.run(command, env=apart, capture_output=True, text=True)
        assert ended.returncode != FAULT, ended.stderr
        return ended.returncode

    assert run("behind it", 17, "-o") == -signal.SIGKILL
    assert run("before it is on file", 30, "--restart") == -signal.SIGKILL
    assert run("while a file is put in place", 100, "--restart") == -signal.SIGKILL
    assert run("never", 1, "--restart") == 0
    times = Counter(solved.read_text(encoding="utf-8").splitlines())
    assert len(times) == 2 * COUNT
    assert sum(times.values()) <= 2 * COUNT + 2, "two kills came before a level was on file"
    with (folder / "sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["zeta"]) for row in rows] == [100.0] * COUNT
    slopes = [float(row["max_displacement"]) / float(row["load.top.pressure"]) for row in rows]
    assert slopes == pytest.approx([slopes[0]] * COUNT, rel=1e-5)
    for number in range(1, COUNT + 1):
        text = (folder / f"{number:04d}" / "summary.json").read_text(encoding="utf-8")
        assert [step["zeta"] for step in json.loads(text)["steps"]] == [50.0, 100.0]
