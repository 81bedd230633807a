"""The drawing program's process, with an X server of its own."""

import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.child_process import environment_apart

PATIENCE = 300.0
"""Longest time for a picture (s), and for each further frame a tenth of it."""


class DrawingError(RuntimeError):
    """Nothing can be drawn; the message is a sentence that says why, and what to install."""


def not_installed(package: str) -> DrawingError:
    """The error where a Python package is missing."""
    return DrawingError(
        f"{package} is not installed; install Debian's package python3-{package}, or use"
        f" pip install {package}."
    )


def images(
    arrays: Mapping[str, npt.NDArray[Any]], about: Mapping[str, object], num_frames: int = 1
) -> npt.NDArray[np.uint8]:
    """Draw by :mod:`perfplast_fenicsx.pictures.render_program` in a process of its own.

    Args:
        arrays: What that reads.
        about: The same, as JSON.
        num_frames: In there.

    Returns:
        The panels of each frame, shape (num_frames, num_panels, height, width, 3).

    Raises:
        DrawingError: If there is no graphics system, or it fails.
    """
    program = Path(__file__).with_name("render_program.py")
    with tempfile.TemporaryDirectory() as folder, display() as environment:
        source, target = Path(folder) / "scene.npz", Path(folder) / "images.npy"
        everything: dict[str, Any] = {"about": json.dumps(about), **arrays}
        np.savez(source, **everything)
        command = [sys.executable, "-P", str(program), str(source), str(target)]
        try:
            done = subprocess.run(
                command,
                env=environment,
                capture_output=True,
                text=True,
                timeout=PATIENCE * (1 + 0.1 * num_frames),
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise DrawingError(f"the drawing program cannot be run ({error}).") from error
        if done.returncode == 0 and target.exists():
            return np.asarray(np.load(target))
    raise _cause(environment, done)


def _cause(environment: Mapping[str, str], done: subprocess.CompletedProcess[str]) -> DrawingError:
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    missing = re.fullmatch(r"ModuleNotFoundError: No module named '(\w+)'", last)
    if missing:
        return not_installed(missing[1])
    if "DISPLAY" not in environment and "Error" not in last:
        return DrawingError(
            "there is no X server to draw with; install Xvfb (Debian's package xvfb), or set"
            " DISPLAY."
        )
    return DrawingError(f"the drawing program failed ({last}).")


@contextmanager
def display() -> Iterator[dict[str, str]]:
    """An environment to draw in: with an X server of its own where Xvfb is installed.

    The variables of MPI launchers are left out, so that the child is no rank.
    """
    environment = environment_apart()
    program = shutil.which("Xvfb")
    if program is None:
        yield environment
        return
    reader, writer = os.pipe()
    # a number by lot: Xvfb's own choice goes by lock files, which it takes for left over where they
    # are those of a process that it cannot see, as in another container with the same /tmp
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
