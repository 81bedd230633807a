"""Answer a command with one JSON object on standard output (``--json``).

The lines for readers go to standard error, and are in the object as well. Nothing here starts MPI.
"""

import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.errors import InputError

OPTION = "--json"

COMMON = {
    "program": "name and version of the program",
    "command": "the command; empty for `--version`",
    "exit_status": "the exit status",
    "text": "lines that the command prints without this option",
    "warnings": "warnings, each with `code` and `message`",
    "error": "null, or `code`, `message`, `where` and `remedy` of a refusal",
}
"""Keys of every answer."""

FILES = "names of the files in the folder"

FIELDS = {
    "run": {
        "folder": "result folder",
        "files": FILES,
        "summary": "content of `summary.json`; null if the folder has none, as of combinations",
    },
    "sweep": {"folder": "result folder", "files": FILES, "rows": "rows of `sweep.csv`, as texts"},
    "mesh": {
        "folder": "folder of mesh and case",
        "files": FILES,
        "bodies": "bodies with name, number of elements, volume and corners of their box",
        "faces": "free faces with number, name, body, shape, area and centre",
        "sets": "names of several faces, with the numbers of these",
        "joints": "pairs of surfaces that touch, with their area",
        "remarks": "remarks on the drawing",
    },
    "setup": {"page": "address of the page"},
    "check": {
        "title": "title of the case",
        "bodies": "names of the bodies",
        "cells": "number of cells",
        "dofs": "number of unknowns",
        "contact_pairs": "number of contact pairs",
        "method": "method that would solve the case",
        "picture": "path of the picture; null if none was drawn",
    },
    "plot": {"files": "paths of the pictures"},
    "animate": {"files": "paths of the animation"},
    "report": {"files": "path of the page"},
    "claim": {
        "quantity": "load factor, multiple of the loads that stay, or factor of safety",
        "sentence": "the bounds in words",
        "meaning": "the loads that the quantity multiplies, or the strengths that it divides",
        "lower": "proven lower bound; null if none is proven",
        "upper": "proven upper bound; null if none is proven",
        "proofs": "`half`, `file`, `sha256` and `check` (a command) of each proof",
        "taken_as_written": "data for which the proof holds",
        "assumptions": "assumptions of the results",
        "not_proven": "reasons why a bound is missing",
        "units": "units of the numbers",
        "version": "version of the program",
    },
    "export": {"files": "paths of the files"},
    "materials": {
        "system": "system of units",
        "materials": "materials with `name`, `what`, `source` and `keys` of a case file as TOML",
    },
    "template": {
        "names": "names of all templates",
        "tables": "tables of the named template; null without a name",
    },
    "info": {
        "versions": "versions and data of the machine; null for a case",
        "title": "title of the case; null without a case",
        "bodies": "names of the bodies; null without a case",
        "meaning": "sentences on the load factor and the units; null without a case",
    },
    "doctor": {"tests": "`name`, `verdict` (ok, none or FAULT) and `text` of each test"},
    "schema": {
        "schema": "the JSON Schema of case files",
        "file": "the file; null if none was named",
    },
}
"""Keys of the answer of each command, besides :data:`COMMON`; null after a refusal."""


@dataclass
class Answer:
    """The answer of a command, which the command fills.

    Attributes:
        command: The command; empty as long as the arguments have not been read.
        fields: Values by the keys in :data:`FIELDS`.
        warnings: Code and message of each warning.
        error: Code, message, place and remedy of a refusal.
    """

    command: str = ""
    fields: dict[str, Any] = field(default_factory=dict)
    warnings: list[dict[str, str]] = field(default_factory=list)
    error: dict[str, str] | None = None

    def refuse(self, error: InputError) -> None:
        """Store a refusal."""
        self.error = error.table()

    def fail(self, code: str, message: str) -> None:
        """Store another end than a result or a refusal, such as a fault of the program."""
        self.error = {"message": message, "code": code, "where": "", "remedy": ""}

    def table(self, status: int, text: str) -> dict[str, Any]:
        """Return the object for an exit status and the printed lines."""
        known = dict.fromkeys(FIELDS.get(self.command, {}))
        return {
            "program": f"perfplast {__version__}",
            "command": self.command,
            "exit_status": status,
            "text": text.splitlines(),
            "warnings": self.warnings,
            "error": self.error,
            **known,
            **self.fields,
        }


class _Heard(io.TextIOBase):
    """A stream that writes to standard error, and keeps the text."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        """Write and keep a text."""
        self.text += text
        return sys.stderr.write(text)

    def flush(self) -> None:
        """Flush standard error."""
        sys.stderr.flush()

    def fileno(self) -> int:
        """Return the descriptor of standard error."""
        return sys.stderr.fileno()


def wants_json(arguments: Sequence[str]) -> bool:
    """Return whether the arguments of the command line have ``--json``."""
    ours = arguments[: arguments.index("--")] if "--" in arguments else arguments
    return OPTION in ours


def answer_by(run: Callable[[Answer], int], first: Callable[[], bool]) -> int:
    """Run a command, and print its answer.

    Args:
        run: Function that runs the command, fills the answer, and returns the exit status.
        first: Function that returns whether this process prints.
    """
    answer, heard, output = Answer(), _Heard(), sys.stdout
    sys.stdout = heard
    try:
        status = run(answer)
    finally:
        sys.stdout = output
    if first():
        table = answer.table(status, heard.text)
        text = json.dumps(table, indent=2, ensure_ascii=False, allow_nan=False)
        print(text, file=output, flush=True)
    return status


@contextmanager
def libraries_on_stderr() -> Iterator[None]:
    """Send what libraries in C print to standard error instead of standard output."""
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
