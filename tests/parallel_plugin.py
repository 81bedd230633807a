"""Select the tests for a number of ranks, and synchronise the ranks.

A test runs on one rank unless a mark requires more; this never depends on other tests:

``mpi2``: also on two ranks. ``mpi3``: also on two and on three ranks. ``mpi2("1-tet", "1-hex")``
names the cases of a parametrized test that run so; without names all cases do.

``long``: only with ``make verify``. ``long(but=["1-tet"])`` names cases that ``make test`` runs.

``serial``: never on several ranks, since the number of ranks cannot change the test.

With ``PERFPLAST_EVERY_CASE=1`` all tests run; on several ranks all except the serial ones. A test
that the command line names (``file::test``, or ``-k``) always runs. On several ranks the short
tests of named files also run, as in ``mpirun -n 2 scripts/rank0 python3 -m pytest
tests/test_x.py``.

After each phase of a test (set-up, call, tear-down) the ranks exchange its outcome on a separate
communicator. If the phase failed on some ranks, it fails on all, with every traceback, and the next
test follows. The next test may fail because of unfinished work of the failed test. Some ranks may
remain in a collective call that cannot end. Then a rank that has failed waits :data:`GRACE` for
them, shows the summary so far and the positions of the ranks, and ends the run. The time limit of a
test has the same effect on several ranks; on one rank pytest-timeout's ``timeout`` enforces it
while Python runs.
"""

import faulthandler
import itertools
import os
import re
import signal
import tempfile
import threading
import time
import zlib
from collections.abc import Generator
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

GRACE = 20.0
"""Time for which a failed rank waits for the other ranks (s)."""

STUCK = 10.0
"""Time after its limit at which a test ends that blocks Python, for example in PETSc (s)."""

EVERY_CASE = bool(os.environ.get("PERFPLAST_EVERY_CASE"))

PASSED, SKIPPED, FAILED = range(3)
NAMES = ("passed", "skipped", "failed")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marks and the hooks; most hooks are necessary only on several ranks."""
    for mark in (
        "mpi2(*cases): also runs on two ranks, all cases or those that are named",
        "mpi3(*cases): also runs on two and on three ranks, all cases or those that are named",
        "long(but=()): runs with make verify alone, but for the cases that are named",
        "serial: cannot depend on ranks; runs on one alone",
    ):
        config.addinivalue_line("markers", mark)
    if config.pluginmanager.has_plugin("watchdog"):
        return
    config.pluginmanager.register(Watchdog(), "watchdog")
    if MPI.COMM_WORLD.size > 1:
        config.pluginmanager.register(Together(config), "together")


class Watchdog:
    """A guard that ends the run if Python does not run after the time limit."""

    def __init__(self) -> None:
        """Not collective."""
        self._stderr = os.dup(2)

    @pytest.hookimpl(wrapper=True)
    def pytest_timeout_set_timer(self, settings: Any) -> Generator[None, bool, bool]:
        """Start the time limit, even if another plugin enforces it."""
        faulthandler.dump_traceback_later(settings.timeout + STUCK, exit=True, file=self._stderr)
        return (yield)

    def pytest_runtest_logfinish(self) -> None:
        """Stop the time limit after the test."""
        faulthandler.cancel_dump_traceback_later()


class Together:
    """A plugin that makes a test fail on all ranks if it fails on one rank."""

    def __init__(self, config: pytest.Config) -> None:
        """Collective."""
        self._config = config
        self._comm = MPI.COMM_WORLD.Dup()
        neighbours = MPI.COMM_WORLD.Split_type(MPI.COMM_TYPE_SHARED)
        self._processes = dict(neighbours.allgather((self._comm.rank, os.getpid())))
        neighbours.Free()
        self._folder = Path(self._comm.bcast(tempfile.mkdtemp() if self._comm.rank == 0 else ""))
        self._stack = self._stack_of(self._comm.rank).open("w")
        self._timer: threading.Timer | None = None
        faulthandler.register(signal.SIGUSR1, file=self._stack)
        self._comm.barrier()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Check that all ranks have collected the same tests."""
        names = "\n".join(item.nodeid for item in session.items)
        outcome = FAILED if session.testsfailed else PASSED
        outcomes, same = self._exchange(names, outcome, "the collection of tests")
        if not same or (FAILED in outcomes and outcome == PASSED):
            raise pytest.UsageError("the ranks have not collected the same tests")

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Mark a test as failed if it has failed on another rank."""
        report = yield
        outcome = NAMES.index(report.outcome)
        outcomes, same = self._exchange(item.nodeid + report.when, outcome, item.nodeid, report)
        if not same:
            self._give_up(f"the ranks are not all at {report.when} of {item.nodeid}")
        # a test that is skipped on some ranks would begin only on the other ranks
        if FAILED not in outcomes and (report.when == "call" or len(set(outcomes)) == 1):
            return report
        texts = self._comm.allgather(_text(report))
        elsewhere = {
            f"{NAMES[outcomes[rank]]} on rank {rank}": text
            for rank, text in enumerate(texts)
            if rank != self._comm.rank and outcomes[rank] != PASSED
        }
        if outcome == FAILED:
            report.sections += elsewhere.items()
        else:
            report.outcome = "failed"
            told = [f"{title}:\n{text}" for title, text in elsewhere.items()]
            report.longrepr = "\n".join([*told, f"{NAMES[outcome]} here"])
        return report

    @pytest.hookimpl(tryfirst=True)
    def pytest_timeout_set_timer(self, item: pytest.Item, settings: Any) -> bool:
        """Start a time limit that ends the test on all ranks."""
        reason = f"{item.nodeid} takes more than {settings.timeout:g} s"
        self._timer = threading.Timer(settings.timeout, self._give_up, (reason,))
        self._timer.daemon = True
        self._timer.start()
        return True

    @pytest.hookimpl(tryfirst=True)
    def pytest_timeout_cancel_timer(self) -> bool:
        """Do nothing: pytest calls this when a test fails, but the teardown also needs a limit."""
        return True

    def pytest_runtest_logfinish(self) -> None:
        """Stop the time limit after the test."""
        if self._timer is not None:
            self._timer.cancel()

    def pytest_unconfigure(self) -> None:
        """Wait for all ranks at the end: launchers end all ranks when one exits with an error."""
        self._exchange("the end", PASSED, "the end of all tests")
        self._stack.close()
        self._stack_of(self._comm.rank).unlink()
        self._comm.barrier()
        if self._comm.rank == 0:
            self._folder.rmdir()

    def _exchange(
        self, place: str, outcome: int, what: str, report: pytest.TestReport | None = None
    ) -> tuple[list[int], bool]:
        """Return the outcomes on all ranks, and whether all ranks are at one place; may exit."""
        mine = np.array([outcome, zlib.crc32(place.encode())], dtype=np.int64)
        all_ = np.empty((self._comm.size, 2), dtype=np.int64)
        request = self._comm.Iallgather(mine, all_)
        end, pause = time.monotonic() + GRACE, 5e-4
        while not request.Test():  # without using the core of ranks that are still working
            if outcome == FAILED and time.monotonic() > end:
                self._give_up(
                    f"rank {self._comm.rank} has failed and others wait in {what}", report
                )
            time.sleep(pause)
            pause = min(2 * pause, 0.02)
        return all_[:, 0].tolist(), bool((all_[:, 1] == all_[0, 1]).all())

    def _give_up(self, reason: str, report: pytest.TestReport | None = None) -> None:
        """Show the results so far and end this process; the launcher then ends the other ranks."""
        faulthandler.dump_traceback_later(STUCK, exit=True)  # in case this does not end
        self._config.pluginmanager.getplugin("capturemanager").suspend(in_=True)
        for rank, process in self._processes.items():
            if not self._stack_of(rank).stat().st_size:  # no other rank has requested it
                os.kill(process, signal.SIGUSR1)
        time.sleep(1)
        reporter = self._config.pluginmanager.getplugin("terminalreporter")
        if report is not None:
            reporter.pytest_runtest_logreport(report)
        reporter.summary_errors()
        reporter.summary_failures()
        for rank in self._processes:
            reporter.write_sep("_", f"rank {rank} is here, the last call first")
            reporter.write_line(_readable(self._stack_of(rank).read_text()))
        reporter.short_test_summary()
        reporter.write_sep("!", f"the run is ended: {reason}")
        reporter.summary_stats()
        reporter.flush()
        os._exit(pytest.ExitCode.TESTS_FAILED)

    def _stack_of(self, rank: int) -> Path:
        return self._folder / f"stack{rank}"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Pass over files without a mark for this number of ranks, which need seconds to import."""
    size = MPI.COMM_WORLD.size
    named = bool(config.getoption("keyword")) or any(".py" in word for word in config.args)
    if size == 1 or EVERY_CASE or named or collection_path.suffix != ".py":
        return None
    text = collection_path.read_text(encoding="utf-8")
    return None if any(name in text for name in sufficient(size)) else True


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests that this number of ranks runs.

    Raises:
        UsageError: If a mark names a case that its test does not have.
    """
    named = bool(config.getoption("keyword")) or any("::" in word for word in config.args)
    if not named and (wrong := wrong_cases(items)):
        raise pytest.UsageError(f"marks name cases that there are not: {', '.join(wrong)}")
    files = all(word.endswith(".py") for word in config.args)
    kept = chosen(items, MPI.COMM_WORLD.size, EVERY_CASE or named, files)
    here = {item.nodeid for item in kept}
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in here])
    items[:] = kept


def chosen(items: list[pytest.Item], size: int, every: bool, files: bool) -> list[pytest.Item]:
    """Return the tests that run on a number of ranks.

    Args:
        items: All tests.
        size: The number of ranks.
        every: Run all that this number of ranks can run.
        files: Run all short tests that this number of ranks can run.
    """
    return [
        item
        for item in items
        if (size == 1 or not item.get_closest_marker("serial"))
        and (every or (is_short(item) and (files or is_for(item, size))))
    ]


def is_short(item: pytest.Item) -> bool:
    """Return whether ``make test`` runs this case."""
    return all(case_of(item) in mark.kwargs.get("but", ()) for mark in item.iter_markers("long"))


def sufficient(size: int) -> tuple[str, ...]:
    """Return the marks of which one makes a test run on a number of ranks."""
    return {1: (), 2: ("mpi2", "mpi3")}.get(size, ("mpi3",))


def is_for(item: pytest.Item, size: int) -> bool:
    """Return whether a mark makes this case run on a number of ranks; one rank needs no mark."""
    marks = [mark for name in sufficient(size) for mark in item.iter_markers(name)]
    return size == 1 or any(not mark.args or case_of(item) in mark.args for mark in marks)


def wrong_cases(items: list[pytest.Item]) -> list[str]:
    """Return the cases that marks name but that no test has."""
    there = {item.nodeid for item in items}
    return sorted(
        {
            case
            for item in items
            for mark in item.iter_markers()
            if mark.name in ("mpi2", "mpi3", "long")
            for name in (*mark.args, *mark.kwargs.get("but", ()))
            if (case := f"{item.nodeid.partition('[')[0]}[{name}]") not in there
        }
    )


def case_of(item: pytest.Item) -> str:
    """Return the name of a case of a parametrized test, without brackets; empty otherwise."""
    return item.nodeid.partition("[")[2].removesuffix("]")


def _text(report: pytest.TestReport) -> str:
    """Return the text of a rank on a test that has not passed."""
    if report.skipped:
        return str(report.longrepr)
    return "\n".join(
        [report.longreprtext, *(f"[{name}]\n{text}" for name, text in report.sections)]
    )


def _readable(stacks: str) -> str:
    """Return the stacks of a process without pytest's frames and waiting threads."""
    ours = [
        line
        for line in stacks.splitlines()
        if not re.search(r"/(_?pytest|pluggy)/|<frozen runpy>|/threading\.py", line)
    ]
    return "\n".join(
        line
        for line, below in itertools.pairwise([*ours, ""])
        if line.startswith(" ") or below.startswith(" ")
    )
