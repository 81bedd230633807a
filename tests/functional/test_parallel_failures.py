"""Test the number of ranks of each test, and tests that fail or hang on some ranks.

The run ends, and reports what happened on each rank.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from tests import parallel_plugin

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="a program that uses MPI cannot start another"
)

ROOT = Path(__file__).parents[2]
BEGIN = """
from mpi4py import MPI
import pytest
comm = MPI.COMM_WORLD
"""
GRACE = "from tests import parallel_plugin\nparallel_plugin.GRACE = 5.0\n"
"""A shorter waiting time (s), for ranks that wait in vain; elsewhere the other ranks arrive."""


def run(folder: Path, tests: str, *options: str, ranks: int = 2, settings: str = "") -> str:
    """Run tests, and return the output of pytest."""
    (folder / "test_here.py").write_text(BEGIN + tests)
    (folder / "conftest.py").write_text(settings)
    launch = ["mpirun", "-n", str(ranks), str(ROOT / "scripts" / "rank0")] if ranks > 1 else []
    pytest_ = [sys.executable, "-m", "pytest", "-q", "-p", "tests.parallel_plugin"]
    done = subprocess.run(
        [*launch, *pytest_, *options, "test_here.py"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTEST_ADDOPTS": ""},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=1200,  # a hanging rank
    )
    assert done.returncode != 0, done.stdout
    return done.stdout


def line_of(text: str, what: str) -> int:
    """Return the number of the first line with a text (1 to n)."""
    return next(n for n, line in enumerate(text.splitlines(), start=1) if what in line)


class Case:
    """A test with a name and marks, for the selection of tests."""

    def __init__(self, nodeid: str, *marks: pytest.MarkDecorator) -> None:
        self.nodeid = nodeid
        self._marks = [mark.mark for mark in marks]

    def iter_markers(self, name: str | None = None) -> Iterator[pytest.Mark]:
        return (mark for mark in self._marks if name in (None, mark.name))

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return next(self.iter_markers(name), None)


MARK = pytest.mark
CASES: Any = [
    Case("unmarked"),
    Case("serial", MARK.serial),
    Case("long", MARK.long),
    Case("two", MARK.mpi2),
    Case("three", MARK.mpi3),
    *(Case(f"of[{n}]", MARK.long(but=["1", "2"]), MARK.mpi2("2"), MARK.mpi3("3")) for n in "1234"),
]


@pytest.mark.parametrize(
    ("size", "every", "files", "names"),
    [
        (1, False, False, "unmarked serial two three of[1] of[2]"),
        (1, True, False, "unmarked serial long two three of[1] of[2] of[3] of[4]"),
        (2, False, False, "two three of[2]"),
        (2, False, True, "unmarked two three of[1] of[2]"),
        (2, True, False, "unmarked long two three of[1] of[2] of[3] of[4]"),
        (3, False, False, "three"),
    ],
)
def test_marks_say_where_a_test_runs(size: int, every: bool, files: bool, names: str) -> None:
    kept = parallel_plugin.chosen(CASES, size, every, files)
    assert [case.nodeid for case in kept] == names.split()


def test_marks_name_cases_that_there_are() -> None:
    assert parallel_plugin.wrong_cases(CASES) == []
    assert parallel_plugin.wrong_cases(CASES[:-1]) == []
    assert parallel_plugin.wrong_cases(CASES[:-2]) == ["of[3]"]


@pytest.mark.long
def test_others_wait_for_the_rank_that_failed(tmp_path: Path) -> None:
    """No rank can end a collective call: the run ends, and reports where the other ranks are."""
    tests = """
def test_before():
    assert comm.rank < 0, "the one before"

def test_waits():
    assert comm.rank == 0, "only here"
    comm.allreduce(1)
"""
    shown = run(tmp_path, tests, settings=GRACE)
    assert "AssertionError: only here" in shown
    assert "AssertionError: the one before" in shown
    place = line_of(BEGIN + tests, "allreduce")
    assert re.search(rf"rank 0 is here.*\n.*\n.*test_here.py\", line {place} in test_waits", shown)
    assert (
        "the run is ended: rank 1 has failed and others wait in test_here.py::test_waits" in shown
    )
    closing = re.search(r"2 failed in ([0-9.]+)s", shown)
    assert closing is not None


@pytest.mark.long
@pytest.mark.parametrize(
    ("ranks", "closing"), [(1, "2 failed in "), (2, "1 failed, 1 deselected in ")]
)
def test_what_is_serial_runs_on_one_rank_alone(tmp_path: Path, ranks: int, closing: str) -> None:
    tests = """
@pytest.mark.serial
def test_alone():
    assert comm.size == 0, "has run"

def test_on_all():
    assert comm.size == 0, "has run"
"""
    shown = run(tmp_path, tests, ranks=ranks)
    assert any(line.startswith(closing) for line in shown.splitlines()), shown


def test_one_rank_fails_and_the_run_goes_on(tmp_path: Path) -> None:
    shown = run(
        tmp_path,
        """
def test_fails():
    print("from rank", comm.rank)
    assert comm.rank == 0, "only here"

def test_both_fail():
    assert comm.rank == 2

@pytest.fixture
def one_sided():
    assert comm.rank == 0, "in set-up"

def test_is_not_begun(one_sided):
    comm.barrier()

@pytest.mark.skipif(comm.rank == 1, reason="on this rank")
def test_is_skipped_by_one():
    comm.barrier()

@pytest.mark.skip(reason="everywhere")
def test_is_skipped():
    comm.barrier()

def test_goes_on():
    assert comm.allreduce(1) == 2
""",
    )
    closing = "2 failed, 1 passed, 1 skipped, 2 errors in "
    (first,) = [line for line in shown.splitlines() if line.startswith(closing)]
    (second,) = [line for line in shown.splitlines() if line.startswith(f"[rank 1] {closing}")]
    assert first and second
    rank0 = "\n".join(line for line in shown.splitlines() if not line.startswith("[rank 1] "))
    assert "failed on rank 1:\n" in rank0
    assert "AssertionError: only here" in rank0
    assert "from rank 1" in rank0
    assert "assert 0 == 2" in rank0
    assert "assert 1 == 2" in rank0
    assert "AssertionError: in set-up" in rank0
    assert "skipped on rank 1:\n" in rank0


def test_a_tear_down_that_fails(tmp_path: Path) -> None:
    shown = run(
        tmp_path,
        """
@pytest.fixture
def resource():
    yield
    assert comm.rank == 1, "too late"

def test_passes(resource):
    comm.barrier()
""",
    )
    assert "[rank 1] failed on rank 0:\n" in shown
    assert "\n1 passed, 1 error in " in shown


@pytest.mark.long
def test_all_ranks_wait_for_ever(tmp_path: Path) -> None:
    tests = """
def test_waits():
    comm.recv(source=comm.rank)
"""
    shown = run(tmp_path, tests, "--timeout", "2")
    place = line_of(BEGIN + tests, "recv")
    for rank in range(2):
        where = rf"rank {rank} is here.*\n(.*\n)*?.*test_here.py\", line {place} in test_waits"
        assert re.search(where, shown)
    assert "the run is ended: test_here.py::test_waits takes more than 2 s" in shown


@pytest.mark.long
@pytest.mark.parametrize("ranks", [1, 2])
def test_nothing_runs_in_python_any_more(tmp_path: Path, ranks: int) -> None:
    """A library does not release the interpreter, like PETSc in a collective call."""
    tests = """
import ctypes
from tests import parallel_plugin
parallel_plugin.STUCK = 1.0

def test_waits():
    libc = ctypes.PyDLL(None)
    libc.sigprocmask(0, ctypes.create_string_buffer(bytes([255]) * 128), None)
    libc.pause()
"""
    shown = run(tmp_path, tests, "--timeout", "2", ranks=ranks)
    assert re.search(r"Timeout \(0:00:03\)!", shown)
    assert f'test_here.py", line {line_of(BEGIN + tests, "pause")} in test_waits' in shown


@pytest.mark.long
def test_other_tests_on_each_rank(tmp_path: Path) -> None:
    tests = "if comm.rank == 0:\n    def test_here():\n        comm.barrier()\n"
    assert "the ranks have not collected the same tests" in run(tmp_path, tests)
    tests = "assert comm.rank == 0, 'on import'\ndef test_here():\n    comm.barrier()\n"
    shown = run(tmp_path, tests)
    assert "the ranks have not collected the same tests" in shown
    assert "AssertionError: on import" in shown
