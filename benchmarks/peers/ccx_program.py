"""Find and run CalculiX, read its results, and measure its processor time."""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

LIMIT_TIME = 3600
"""Time (s) after which CalculiX is stopped."""


def program() -> str | None:
    """Return the path of CalculiX; None if it is not installed."""
    own = Path(os.environ.get("XDG_CACHE_HOME", "/nowhere")) / "calculix/usr/bin/ccx"
    return shutil.which("ccx") or (str(own) if own.is_file() else None)


def timed(command: Sequence[str], folder: Path, **environment: str) -> tuple[float, int, str]:
    """Run a command and return its processor time (s), exit status and output."""
    with tempfile.TemporaryFile("w+", errors="replace") as output:
        child = subprocess.Popen(
            command, cwd=folder, stdout=output, stderr=output, env={**os.environ, **environment}
        )
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        return used.ru_utime + used.ru_stime, child.returncode, output.read()


def calculix(folder: Path, nodes: int) -> dict[str, Any]:
    """Run CalculiX on ``model.inp`` in a folder; return its results at converged increments.

    Args:
        folder: The folder with the file.
        nodes: Number of nodes.
    """
    ccx = program()
    assert ccx is not None
    libraries = str(Path(ccx).parents[1] / "lib/x86_64-linux-gnu")
    path = ":".join(filter(None, (libraries, os.environ.get("LD_LIBRARY_PATH"))))
    command = ["timeout", str(LIMIT_TIME), ccx, "-i", "model"]
    seconds, status, output = timed(command, folder, LD_LIBRARY_PATH=path)
    text = (folder / "model.dat").read_text(errors="replace")
    times, fields = [], []
    for part in text.split(" displacements (vx,vy,vz) for set NALL and time")[1:]:
        head, rows = part.lstrip().split("\n", 1)
        numbers = [line.split()[1:] for line in rows.split("\n")[1 : nodes + 1]]
        times.append(float(head))
        fields.append(np.array(numbers, dtype=float))
    forces = [
        np.array(found.split(), dtype=float)[:3]
        for found in re.findall(r"total surface force \(fx,fy,fz\)[^\n]*\n\s*\n([^\n]+)\n", text)
    ]
    why = re.findall(r"\*ERROR[^\n]*\n?[^\n]*|best solution and residuals[^\n]*", output)
    return {
        "seconds": seconds,
        "status": status,
        "times": times,
        "fields": fields,
        "forces": forces,
        "iterations": len(re.findall(r"^ iteration +\d+", output, re.M)),
        "end": " ".join(why[-1].split()) if why else "",
    }
