"""Implement ``perfplast mcp FOLDER``: serve tools by the Model Context Protocol.

The server reads requests on standard input and answers on standard output. Each tool runs a command
of this program in a separate process, so a fault in one tool does not end the server. A tool
refuses a path outside the given folders, but a case file may name files outside these folders.
The package ``mcp`` is optional.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any

from perfplast_fenicsx.cli.json_answer import OPTION
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.environment import environment_with_package
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import ENDED, is_held

Answer = dict[str, Any]

INSTRUCTIONS = (
    "Limit loads of elastic-plastic bodies in contact. Call a number a bound only if 'claim' has "
    "returned it. If a tool refuses its input, the answer has 'ok': false, and 'error' with code, "
    "place and remedy. No tool guesses a missing number: ask the user for it."
)


@dataclass
class Tools:
    """The tools, which accept only paths in the given folders.

    Attributes:
        folders: Resolved paths of the folders that must contain all given paths.
    """

    folders: tuple[Path, ...]
    _running: dict[Path, subprocess.Popen[bytes]] = field(default_factory=dict, init=False)

    def describe(self, path: str) -> Answer:
        """Return the bodies of a case, and the loads that its load factor multiplies.

        Args:
            path: A case file.
        """
        return self._command("info", self._inside(path))

    def template(self, name: str = "") -> Answer:
        """Return the tables of factors that a design code requires, or the names of all checks.

        Args:
            name: Name of the check; empty for the names of all checks.
        """
        return self._command("template", *([name] if name else []))

    def mesh(self, drawing: str, folder: str, material: str) -> Answer:
        """Mesh a drawing, and write a first case file without supports and loads.

        Args:
            drawing: A STEP, IGES, BREP or .geo file.
            folder: Folder for the mesh, the picture and the case file.
            material: Material of all bodies; ``perfplast materials`` lists the names.
        """
        into = self._inside(folder)
        return self._command("mesh", self._inside(drawing), "-o", into, "--material", material)

    def check(self, case: str) -> Answer:
        """Return a description of a case, or the first reason why the case cannot be run.

        Args:
            case: A case file.
        """
        return self._command("check", self._inside(case))

    def run(self, case: str, folder: str, ranks: int = 1) -> Answer:
        """Start a run, and return without waiting for its end.

        Args:
            case: A case file.
            folder: A new folder for the results.
            ranks: Number of MPI ranks.
        """
        where = Path(self._inside(folder))
        if (where / "summary.json").exists():
            raise InputError(f"the folder '{folder}' already has results; name another folder.")
        checked = self.check(case)
        if not checked["ok"]:
            return checked
        several = ["-n", str(ranks)] if ranks > 1 else []
        command = [*_PROGRAM, "run", self._inside(case), "-o", str(where), "--watch", *several]
        where.mkdir(parents=True, exist_ok=True)
        with (where / "output.txt").open("wb") as output:
            self._running[where] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=environment_with_package(),
            )
        return {"ok": True, "folder": str(where), "report": str(where / "report.html")}

    def status(self, folder: str) -> Answer:
        """Return whether a run is in progress, and the last lines that it printed.

        Args:
            folder: Folder of the run.
        """
        where = Path(self._inside(folder))
        log = where / "run.log"
        if not log.is_file() and where not in self._running:
            raise InputError(
                f"'{folder}' has no run.log, so no run was started in it; call the tool 'run' "
                "first."
            )
        process = self._running.get(where)
        alive = process.poll() is None if process is not None else is_held(log)
        printed = where / "output.txt"
        lines = printed.read_text("utf-8", "replace").splitlines()[-8:] if printed.is_file() else []
        ended = log.is_file() and ENDED in log.read_text("utf-8", "replace")[-400:]
        state = "going on" if alive else "ended" if ended else "killed or refused"
        answer: Answer = {"ok": True, "state": state, "lines": lines}
        if process is not None and not alive:
            answer["exit_status"] = process.returncode
        return answer

    def claim(self, folder: str) -> Answer:
        """Check the proof files of a run again; return the proven bounds and the files' SHA-256.

        Args:
            folder: Folder of the results.
        """
        return self._command("claim", self._inside(folder))

    def prove(self, file: str) -> Answer:
        """Check a proof file, and return the checker's verdict.

        Args:
            file: A proof file, such as bounds.h5.
        """
        done = _ended([sys.executable, "-m", "perfplast_fenicsx.proof", self._inside(file)])
        text = (done.stdout + done.stderr).decode("utf-8", "replace").splitlines()
        return {"ok": done.returncode == SOLVED, "exit_status": done.returncode, "text": text}

    def _command(self, *arguments: str) -> Answer:
        done = _ended([*_PROGRAM, *arguments, OPTION])
        try:
            return {"ok": done.returncode == SOLVED} | json.loads(done.stdout)
        except ValueError:  # a fault has ended the process
            last = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
            fault = {"code": "fault", "message": " ".join(last), "where": "", "remedy": ""}
            return {"ok": False, "exit_status": done.returncode, "error": fault}

    def _inside(self, path: str) -> str:
        """Return the resolved path of a file or folder.

        Raises:
            InputError: If the path is outside the given folders.
        """
        first = self.folders[0]
        found = (first / path).resolve()
        if not any(found.is_relative_to(folder) for folder in self.folders):
            allowed = ", ".join(map(str, self.folders))
            raise InputError(
                f"'{path}' is outside the folders {allowed}; give a path inside one of them."
            )
        return str(found)


_PROGRAM = [sys.executable, "-m", "perfplast_fenicsx"]

NAMES = ("describe", "template", "mesh", "check", "run", "status", "claim", "prove")
"""Names of the tools, which are the names of their methods."""


def _ended(command: Sequence[str]) -> subprocess.CompletedProcess[bytes]:
    """Run a command, wait for its end, and return its output."""
    environment = environment_with_package()
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, env=environment, check=False
    )


def answering(tool: Callable[..., Answer]) -> Callable[..., Answer]:
    """Return a function that calls a tool and returns an InputError as an answer."""

    @wraps(tool)
    def answered(*args: Any, **kwargs: Any) -> Answer:
        try:
            return tool(*args, **kwargs)
        except InputError as error:
            return {"ok": False, "error": error.table()}

    return answered


def serve(folders: Sequence[str]) -> int:
    """Serve the tools on standard input and output until the input ends. Not collective.

    Args:
        folders: Folders that must contain all given paths.

    Raises:
        InputError: If a folder does not exist, or if the package ``mcp`` is missing.
    """
    for folder in folders:
        if not Path(folder).is_dir():
            raise InputError(f"'{folder}' is not a folder; create it, or name another one.")
    try:
        from mcp.server import MCPServer
    except ImportError as error:
        raise InputError(
            "perfplast mcp needs version 2 of the package mcp from PyPI; install "
            "perfplast_fenicsx[mcp]."
        ) from error
    tools = Tools(tuple(Path(folder).resolve() for folder in folders))
    server = MCPServer("perfplast", instructions=INSTRUCTIONS)
    for name in NAMES:
        server.tool()(answering(getattr(tools, name)))
    server.run("stdio")
    return SOLVED
