"""The drawing program's process, with an X server of its own."""

import json
import logging
import os
import random
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

log = logging.getLogger(__name__)

PATIENCE = 300.0
"""Longest time for a picture (s)."""


def images(
    arrays: Mapping[str, npt.NDArray[Any]], about: Mapping[str, object], name: str
) -> npt.NDArray[np.uint8] | None:
    """Draw by :mod:`perfplast_fenicsx.render` in a process of its own.

    Args:
        arrays: What that reads.
        about: The same, as JSON.
        name: Of the picture, for warnings.

    Returns:
        The panels, shape (num_panels, height, width, 3); None after a warning that says why not.
    """
    program = Path(__file__).with_name("render.py")
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
                timeout=PATIENCE,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            log.warning("%s was not drawn (%s).", name, error)
            return None
        if done.returncode == 0 and target.exists():
            return np.asarray(np.load(target))
    log.warning("%s was not drawn: %s", name, _cause(environment, done))
    return None


def _cause(environment: Mapping[str, str], done: subprocess.CompletedProcess[str]) -> str:
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    if "DISPLAY" not in environment and "Error" not in last:
        return "there is no X server; install Xvfb (Debian package xvfb), or set DISPLAY."
    return f"the drawing program failed ({last})."


@contextmanager
def display() -> Iterator[dict[str, str]]:
    """An environment to draw in: with an X server of its own where Xvfb is installed.

    The variables of MPI launchers are left out, so that the child is no rank.
    """
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(hidden)}
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
