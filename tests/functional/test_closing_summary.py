"""Test scripts/test with a stand-in for ./fenicsx: it runs the tests on every number of ranks."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

SCRIPT = Path(__file__).parents[2] / "scripts" / "test"
ALONE = """echo .
echo '3 passed, 1 skipped in 1.20s (0:00:01)'"""


def run(folder: Path, alone: str, two: str, three: str, **variables: str) -> tuple[int, list[str]]:
    """Return the exit status, and the lines of the summary."""
    (folder / "scripts").mkdir()
    shutil.copy(SCRIPT, folder / "scripts")
    stand_in = folder / "fenicsx"
    stand_in.write_text(
        f'#!/bin/bash\ncase "$*" in\n*"-n 2"*) {two} ;;\n*"-n 3"*) {three} ;;\n'
        f"*) {alone} ;;\nesac\n"
    )
    stand_in.chmod(0o755)
    done = subprocess.run(
        [folder / "scripts" / "test"],
        env=os.environ | variables,
        capture_output=True,
        text=True,
    )
    shown, _, summary = done.stdout.partition("All tests, by the number of ranks:\n")
    assert "3 passed" in shown
    return done.returncode, summary.splitlines()


def test_all_pass(tmp_path: Path) -> None:
    status, summary = run(tmp_path, ALONE, "echo '2 passed in 2.00s'", "echo '1 passed in 1.00s'")
    assert status == 0
    assert summary == [
        "1 rank   passed  3 passed, 1 skipped in 1.20s (0:00:01)",
        "2 ranks  passed  2 passed in 2.00s",
        "3 ranks  passed  1 passed in 1.00s",
    ]


@pytest.mark.long
def test_a_failure_ends_nothing_else(tmp_path: Path) -> None:
    """The failure is on two ranks, and the second rank prints the last line."""
    alone = f"echo 'FAILED tests/a.py::test_a - it is so'; {ALONE}; exit 1"
    two = """echo '[rank 1] ERROR tests/b.py::test_b'
echo '[rank 1] !! the run is ended: rank 1 has failed !!'
echo '[rank 1] 1 error in 0.10s'
exit 1"""
    status, summary = run(tmp_path, alone, two, "exec sleep 100", LIMIT="5")
    assert status == 1
    assert summary == [
        "1 rank   FAILED  3 passed, 1 skipped in 1.20s (0:00:01)",
        "         FAILED tests/a.py::test_a - it is so",
        "2 ranks  FAILED  1 error in 0.10s",
        "         !! the run is ended: rank 1 has failed !!",
        "         ERROR tests/b.py::test_b",
        "3 ranks  FAILED  ended after 5 s",
    ]


@pytest.mark.parametrize("status", [2, 125])
def test_no_tests_at_all(tmp_path: Path, status: int) -> None:
    _, summary = run(tmp_path, ALONE, f"exit {status}", "true")
    assert summary[1] == f"2 ranks  FAILED  ended with status {status}"
