"""Run ``perfplast`` with a pause until a signal comes, or with a full disk, at a chosen moment.

    paused_run.py RANKS LEVEL CALL COUNT ANNOUNCEMENT ARGUMENT ...

RANKS are numbers, such as 0,2. The moment is before the COUNT-th call of CALL
(``module:Class.method``) after the LEVEL-th level of this run is about to be recorded. At this
moment, each of the ranks writes its process number to the file ANNOUNCEMENT.RANK. If COUNT begins
with "<", the ranks do not pause. From this moment on, files cannot become larger than COUNT
(bytes).
"""

import functools
import os
import pkgutil
import resource
import select
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.__main__ import main

LEVEL = "perfplast_fenicsx.cli.recorder:Recorder.level"


def before(name: str, action: Callable[[], None]) -> None:
    """Insert an action before each call of a function."""
    owner, _, attribute = name.rpartition("." if "." in name.partition(":")[2] else ":")
    there = pkgutil.resolve_name(owner)
    plain = getattr(there, attribute)

    @functools.wraps(plain)
    def call(*arguments: Any, **named: Any) -> Any:
        action()
        return plain(*arguments, **named)

    setattr(there, attribute, call)


def run(ranks: list[int], level: int, call: str, count: str, announcement: Path) -> None:
    """Arrange the pause or the file limit at the chosen moment."""
    left = {"levels": level, "calls": 1 if count[0] == "<" else int(count)}
    woken, wake = os.pipe()
    os.set_blocking(wake, False)

    def pause() -> None:
        if left["levels"] > 0:
            return
        left["calls"] -= 1
        if left["calls"] != 0:
            return
        if count[0] == "<":
            most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(count[1:]), most))
            return
        signal.set_wakeup_fd(wake)
        part = Path(f"{announcement}.part")
        part.write_text(str(os.getpid()))
        os.rename(part, announcement)
        select.select([woken], [], [])

    def one_level() -> None:
        left["levels"] -= 1

    if MPI.COMM_WORLD.rank in ranks:
        before(call, pause)
        before(LEVEL, one_level)


if __name__ == "__main__":
    ranks_, level_, call_, count_, announcement_, *arguments_ = sys.argv[1:]
    there_ = Path(f"{announcement_}.{MPI.COMM_WORLD.rank}")
    run([int(rank) for rank in ranks_.split(",")], int(level_), call_, count_, there_)
    sys.exit(main(arguments_))
