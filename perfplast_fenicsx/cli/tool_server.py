"""``perfplast mcp FOLDER``: tools for programs, by the Model Context Protocol on standard input.

Each tool runs a command of this program in a separate process, so that a fault in one tool does not
end the others. A path outside the given folders is refused; a case file may still name a mesh or a
table that lies elsewhere. The package ``mcp`` is optional.
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
    "Limit loads of elastic-plastic bodies in contact. Call a number a bound only if 'claim' has"
    " returned it. A refusal has 'ok': false, and 'error' with its code, place and remedy. A number"
    " that is missing has to be asked for, because no tool guesses one."
)


@dataclass
class Tools:
    """The tools, for files in some folders.

    Attributes:
        folders: Folders that must contain all paths, resolved.
    """

    folders: tuple[Path, ...]
    _running: dict[Path, subprocess.Popen[bytes]] = field(default_factory=dict, init=False)

    def describe(self, path: str) -> Answer:
        """Return the meaning of a case: bodies, and the loads that the load factor multiplies.

        Args:
            path: A case file.
        """
        return self._command("info", self._inside(path))

    def template(self, name: str = "") -> Answer:
        """Return tables of factors that a code asks for, or the names of all codes.

        Args:
            name: Name of the check; empty for the names.
        """
        return self._command("template", *([name] if name else []))

    def mesh(self, drawing: str, folder: str, material: str) -> Answer:
        """Mesh a drawing, and write a first case file, in which supports and loads are missing.

        Args:
            drawing: A STEP, IGES, BREP or .geo file.
            folder: Folder for mesh, picture and case.
            material: Material of all bodies, of the list that ``perfplast materials`` prints.
        """
        into = self._inside(folder)
        return self._command("mesh", self._inside(drawing), "-o", into, "--material", material)

    def check(self, case: str) -> Answer:
        """Return how a case is understood, or the first reason why it cannot be run.

        Args:
            case: A case file.
        """
        return self._command("check", self._inside(case))

    def run(self, case: str, folder: str, ranks: int = 1) -> Answer:
        """Start a run, and return at once.

        Args:
            case: A case file.
            folder: A new folder for the results.
            ranks: Number of MPI ranks.
        """
        where = Path(self._inside(folder))
        if (where / "summary.json").exists():
            raise InputError(f"the folder '{folder}' has results already; name another folder.")
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
        """Return whether a run goes on, and the last lines that it printed.

        Args:
            folder: Folder of the run.
        """
        where = Path(self._inside(folder))
        log = where / "run.log"
        if not log.is_file() and where not in self._running:
            raise InputError(f"'{folder}' has no run.log, so no run was started there; call run.")
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
        """Return the bounds that the files of a run prove, checked again, with their SHA-256.

        Args:
            folder: Folder of the results.
        """
        return self._command("claim", self._inside(folder))

    def prove(self, file: str) -> Answer:
        """Return the verdict of the checker on a proof file.

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
        except ValueError:  # a fault that ended the process
            last = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
            fault = {"code": "fault", "message": " ".join(last), "where": "", "remedy": ""}
            return {"ok": False, "exit_status": done.returncode, "error": fault}

    def _inside(self, path: str) -> str:
        """Return a path, resolved.

        Raises:
            InputError: If it is in none of the folders.
        """
        first = self.folders[0]
        found = (first / path).resolve()
        if not any(found.is_relative_to(folder) for folder in self.folders):
            allowed = ", ".join(map(str, self.folders))
            raise InputError(f"'{path}' is in none of the folders {allowed}; give a path in one.")
        return str(found)


_PROGRAM = [sys.executable, "-m", "perfplast_fenicsx"]

NAMES = ("describe", "template", "mesh", "check", "run", "status", "claim", "prove")
"""The tools, by the names of their methods."""


def _ended(command: Sequence[str]) -> subprocess.CompletedProcess[bytes]:
    """Run a command to its end."""
    environment = environment_with_package()
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, env=environment, check=False
    )


def answering(tool: Callable[..., Answer]) -> Callable[..., Answer]:
    """Return a tool that returns its refusals as answers."""

    @wraps(tool)
    def answered(*args: Any, **kwargs: Any) -> Answer:
        try:
            return tool(*args, **kwargs)
        except InputError as error:
            return {"ok": False, "error": error.table()}

    return answered


def serve(folders: Sequence[str]) -> int:
    """Serve the tools on standard input and output until that ends. Not collective.

    Args:
        folders: Folders that must contain all paths.

    Raises:
        InputError: If a folder does not exist, or the package ``mcp`` is missing.
    """
    for folder in folders:
        if not Path(folder).is_dir():
            raise InputError(f"'{folder}' is not a folder; create it, or name another one.")
    try:
        from mcp.server import MCPServer
    except ImportError as error:
        raise InputError(
            "perfplast mcp needs the package mcp of PyPI, in version 2; install"
            " perfplast_fenicsx[mcp]."
        ) from error
    tools = Tools(tuple(Path(folder).resolve() for folder in folders))
    server = MCPServer("perfplast", instructions=INSTRUCTIONS)
    for name in NAMES:
        server.tool()(answering(getattr(tools, name)))
    server.run("stdio")
    return SOLVED
