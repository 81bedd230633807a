"""Run the drawing program as a process with its own X server.

The process reads the result folder and is not an MPI rank. So a failure of the graphics system does
not affect the run.
"""

import logging
import os
import random
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

from perfplast_fenicsx.environment import REFUSED, environment_with_package
from perfplast_fenicsx.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI

    from perfplast_fenicsx.io.results.result_folder import ResultFolder

PATIENCE = {"plot": 900.0, "animate": 2400.0, "parts": 600.0, "case": 600.0}
"""Time limit of each drawing command (s)."""

log = logging.getLogger(__name__)


def draw(folder: "ResultFolder") -> bool:
    """Draw the pictures of a result folder into it. Collective.

    Without a graphics system rank 0 logs a warning, and the run continues.

    Args:
        folder: The result folder, to which the run has written its results.

    Returns:
        Whether all pictures were drawn, the same on every rank.
    """
    return drawn_on_rank0(folder.comm, lambda: plot(folder.path))


def drawn_on_rank0(comm: "MPI.Intracomm", draw: Callable[[], None]) -> bool:
    """Draw on rank 0, and return whether this succeeded; rank 0 logs failures. Collective.

    Args:
        comm: The ranks.
        draw: Function that draws; only rank 0 calls it.
    """
    drawn = False
    if comm.rank == 0:
        try:
            draw()
            drawn = True
        except Exception as error:  # rank 0 must go on, because others wait for it
            log.warning("%s", error)
    return bool(comm.bcast(drawn))


def plot(
    folder: str | Path,
    output: str | Path | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> None:
    """Draw the pictures of a run, such as its loading curve and mechanism. Not collective.

    Args:
        folder: The result folder of the run, which may still be in progress.
        output: Folder for the pictures; the result folder by default.
        say: Function called with the path of each picture, and with a sentence for each picture
            whose data are missing.

    Raises:
        InputError: If the folder has no results, or if nothing can be drawn or written.
    """
    _run("plot", folder, output, say)


def animate(
    folder: str | Path,
    output: str | Path | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> None:
    """Animate the loading level by level, with the same scales in all frames. Not collective.

    Args:
        folder: The result folder of a run, which may still be in progress.
        output: A GIF or WebP file; ``loading.gif`` in the folder by default.
        say: Function called with the path of the file.

    Raises:
        InputError: If the folder has no fields, or if nothing can be drawn or written.
    """
    _run("animate", folder, output, say)


def draw_parts(skin: str | Path, picture: str | Path) -> None:
    """Draw the bodies of a geometry, with the numbers of their free faces. Not collective.

    Args:
        skin: An .npz file of :func:`perfplast_fenicsx.geometry.mesher.skin_of`.
        picture: A PNG file.

    Raises:
        InputError: If the picture cannot be drawn or written.
    """
    _run("parts", skin, picture, lambda line: None)


def draw_case(arrays: str | Path, picture: str | Path) -> None:
    """Draw a case with 3D bodies before the run. Not collective.

    Args:
        arrays: An .npz file with the :func:`perfplast_fenicsx.cli.case_picture.arrays_of` a case.
        picture: A PNG file.

    Raises:
        InputError: If the picture cannot be drawn or written.
    """
    _run("case", arrays, picture, lambda line: None)


def _run(
    command: str,
    folder: str | Path,
    output: str | Path | None,
    say: Callable[[str], None],
) -> None:
    """Run :mod:`perfplast_fenicsx.pictures.__main__` as a process, and pass on its output.

    Args:
        command: The command of the process.
        folder: The data to draw.
        output: The file or folder for the pictures; None for the default of the command.
        say: Function called with each line of the output.
    """
    program = [sys.executable, "-P", "-m", "perfplast_fenicsx.pictures", command, str(folder)]
    program += [str(output)] if output else []
    with (
        display() as environment,
        tempfile.TemporaryFile("w+", encoding="utf-8") as complaints,
    ):
        try:
            child = subprocess.Popen(
                program,
                env=environment,
                encoding="utf-8",
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=complaints,
            )
        except OSError as error:
            raise InputError(f"the drawing program cannot be run ({error}).") from error
        late = threading.Event()

        def end() -> None:
            late.set()
            child.kill()

        timer = threading.Timer(PATIENCE[command], end)
        timer.start()
        try:
            with child:
                for line in child.stdout or ():
                    say(line.rstrip("\n"))
        except BaseException:
            child.kill()
            raise
        finally:
            timer.cancel()
        if child.returncode:
            waited = PATIENCE[command] if late.is_set() else None
            raise InputError(_cause(child.returncode, complaints, waited, "DISPLAY" in environment))


def _cause(status: int, complaints: IO[str], waited: float | None, screen: bool) -> str:
    """Return the cause of a failure: a time limit, no X server, or the last line of the output."""
    complaints.seek(0)
    last = (complaints.read().strip().splitlines() or [f"exit status {status}"])[-1]
    if status == REFUSED:
        return last
    if waited is not None:
        last = f"the drawing program was ended after {waited:g} s"
    elif not screen and "Error" not in last:
        last = (
            "there is no X server to draw with; install Xvfb (Debian's package xvfb; for PyPI's VTK"
            " libosmesa6 does too), or set DISPLAY"
        )
    return f"not all pictures were drawn: {last}."


@contextmanager
def display() -> Iterator[dict[str, str]]:
    """Yield an environment for drawing, with its own X server if Xvfb is installed.

    The variables of MPI launchers are removed, so the child process is not a rank.
    """
    environment = environment_with_package() | {"PYTHONIOENCODING": "utf-8:backslashreplace"}
    program = shutil.which("Xvfb")
    if program is None:
        yield environment
        return
    reader, writer = os.pipe()
    # A random display number. Xvfb's own choice depends on lock files. It considers a lock file
    # stale if it cannot see the process, which may be in another container with the same /tmp.
    number = f":{random.SystemRandom().randrange(100, 60_000)}"
    command = [program, number, "-displayfd", str(writer), "-screen", "0", "1280x1024x24"]
    with subprocess.Popen(
        [*command, "-nolisten", "tcp"],
        pass_fds=[writer],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    ) as server:
        os.close(writer)
        with os.fdopen(reader) as pipe:
            if pipe.readline().strip():
                environment["DISPLAY"] = number
        try:
            yield environment
        finally:
            server.terminate()
