"""Print the answer of a command as one JSON object on standard output (``--json``).

The lines for human readers go to standard error; the object contains them too. This module does not
start MPI.
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
    "text": "the lines that the command prints without this option",
    "warnings": "warnings, each with `code` and `message`",
    "error": "null, or `code`, `message`, `where` and `remedy` of the error",
}
"""Keys of every answer, with their meaning."""

FILES = "names of the files in the folder"

FIELDS = {
    "run": {
        "folder": "result folder",
        "files": FILES,
        "summary": "content of `summary.json`; null if the folder has no such file, as after a "
        "run of combinations",
    },
    "sweep": {
        "folder": "result folder",
        "files": FILES,
        "rows": "rows of `sweep.csv`, all values as strings",
    },
    "mesh": {
        "folder": "folder with the mesh and the case",
        "files": FILES,
        "bodies": (
            "bodies with name, number of elements, volume, and two corners of the bounding box"
        ),
        "faces": "free faces with number, name, body, shape, area and centre",
        "sets": "names that cover several faces, with the numbers of these faces",
        "joints": "pairs of surfaces that touch, with the area of contact",
        "remarks": "remarks on the drawing",
    },
    "setup": {"page": "address of the page"},
    "check": {
        "title": "title of the case",
        "bodies": "names of the bodies",
        "cells": "number of cells",
        "dofs": "number of degrees of freedom",
        "contact_pairs": "number of contact pairs",
        "method": "method that `perfplast run` would use",
        "picture": "path of the picture; null if none was drawn",
    },
    "plot": {"files": "paths of the pictures"},
    "animate": {"files": "paths of the animation"},
    "report": {"files": "path of the page"},
    "claim": {
        "quantity": "the bounded quantity: load factor, multiple of the constant loads, or "
        "factor of safety",
        "sentence": "the bounds in words",
        "meaning": (
            "the loads that the quantity multiplies, or the strengths that the quantity divides"
        ),
        "lower": "proven lower bound; null without a proof",
        "upper": "proven upper bound; null without a proof",
        "proofs": "for each proof `half` (the bound that it proves), `file`, `sha256` and `check` "
        "(a command)",
        "taken_as_written": "data that the checker takes as given",
        "assumptions": "assumptions of the results",
        "not_proven": "reasons why bounds are not proven",
        "units": "units of the numbers",
        "version": "version of the program",
    },
    "export": {"files": "paths of the files"},
    "materials": {
        "system": "system of units",
        "materials": "materials with `name`, `what` (description), `source` and `keys` (keys of a "
        "case file with values in TOML)",
    },
    "template": {
        "names": "names of all templates",
        "tables": "tables of the template that was named; null without a name",
    },
    "info": {
        "versions": "versions, and data of the machine; null if a case is given",
        "title": "title of the case; null without a case",
        "bodies": "names of the bodies; null without a case",
        "meaning": "sentences that explain the load factor and the units; null without a case",
    },
    "doctor": {
        "tests": (
            "`name`, `verdict` (ok, none or FAULT) and `text` of each test; none means not "
            "installed"
        )
    },
    "schema": {
        "schema": "the JSON Schema of case files",
        "file": "the file that was written; null without an output file",
    },
}
"""Keys of each command's answer besides :data:`COMMON`; their values are null after an error."""


@dataclass
class Answer:
    """The answer of a command; the command adds its values.

    Attributes:
        command: Name of the command; empty until the arguments are read.
        fields: Values of the keys in :data:`FIELDS`.
        warnings: Code and message of each warning.
        error: Code, message, place and remedy of the error that ended the command; None if there
            was no error.
    """

    command: str = ""
    fields: dict[str, Any] = field(default_factory=dict)
    warnings: list[dict[str, str]] = field(default_factory=list)
    error: dict[str, str] | None = None

    def refuse(self, error: InputError) -> None:
        """Store the error that the command has found in its input."""
        self.error = error.table()

    def fail(self, code: str, message: str) -> None:
        """Store a failure that is not an input error, such as a fault of the program."""
        self.error = {"message": message, "code": code, "where": "", "remedy": ""}

    def table(self, status: int, text: str) -> dict[str, Any]:
        """Return the JSON object as a dictionary, for an exit status and the printed text."""
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
    """A stream that writes to standard error and stores the text."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        """Write and store a text."""
        self.text += text
        return sys.stderr.write(text)

    def flush(self) -> None:
        """Flush standard error."""
        sys.stderr.flush()

    def fileno(self) -> int:
        """Return the descriptor of standard error."""
        return sys.stderr.fileno()


def wants_json(arguments: Sequence[str]) -> bool:
    """Return whether the command-line arguments contain ``--json``."""
    ours = arguments[: arguments.index("--")] if "--" in arguments else arguments
    return OPTION in ours


def answer_by(run: Callable[[Answer], int], first: Callable[[], bool]) -> int:
    """Run a command, print its answer as JSON, and return its exit status.

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
    """Redirect output that C libraries print on standard output to standard error."""
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
