"""Answer questions about cases with a given statement by running the program."""

import contextlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh

from meshes.apart import write_apart
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, NO_SOLUTION, SOLVED
from perfplast_fenicsx.mesh import gmsh_session, write_split
from tests.combinations.questions import asked
from tests.combinations.statements import CONTACT, HELD, PRESSURE, VON_MISES, Statement

SIZE = 0.5
"""Edge length of the cells."""


@dataclass(frozen=True)
class Answer:
    """The answer to a question.

    Attributes:
        status: Exit status of the run.
        words: "yes", the answered part, or the sentence on why there is no answer.
    """

    status: int
    words: str

    @property
    def given(self) -> bool:
        """Return whether the question has a complete or partial answer."""
        return self.status == SOLVED and not self.words.startswith("no")


def answer(statement: Statement, question: str, folder: Path) -> Answer:
    """Answer a question by writing and running a case file. On one process."""
    tables: dict[str, Any] = {
        "model": {"kind": "plane-strain"},
        "mesh": _mesh(statement.mesh, folder),
        "element": {"degree": 2},
        "material.lower": VON_MISES,
        "material.upper": VON_MISES,
        "support": HELD,
        "load": [PRESSURE],
        "contact": [CONTACT],
        "output": {"pictures": False, "fields": False},
    }
    if not isinstance(statement.mesh, str):
        del tables["model"]
    tables |= statement.tables
    for key, of in asked(question, statement, tables).items():
        tables[key] = tables[key] | of if key == "mesh" else of
    case, results = folder / "case.toml", folder / "results"
    case.write_text(_toml(tables), encoding="utf-8")
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        status = main(["run", str(case), "-o", str(results), "--force"])
    if status == BAD_INPUT:
        sentence = said.getvalue().strip().splitlines()[-1]
        return Answer(status, sentence.replace(str(folder) + "/", ""))
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    if status == NO_SOLUTION:
        return Answer(status, f"no: {summary.get('reason') or said.getvalue().strip()}")
    if "bounds" in question or "adapted" in question:
        return Answer(status, _of_bounds(summary["limit"]["body"]))
    return Answer(status, "yes")


def _of_bounds(body: Mapping[str, Any]) -> str:
    """Return "yes", or the bound that exists and the reason why the other bound is missing."""
    there = [kind for kind in ("lower", "upper") if body[kind] is not None]
    if len(there) == 2 and body["strict"]:
        return "yes"
    why = "; ".join(body["why_not"])
    return f"the {there[0]} one: {why}" if len(there) == 1 else f"no: {why}"


def _mesh(what: str | Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return the table [mesh], and write its file if the file is missing."""
    if not isinstance(what, str):
        return what
    path = folder / f"{what}.msh"
    if not path.exists():
        _write(path, what)
    return {"file": path.name}


def _write(path: Path, what: str) -> None:
    """Mesh the two blocks."""
    left = 0.0 if what == "axis" else -1.0
    with gmsh_session():
        occ = gmsh.model.occ
        blocks = [add_box([left, -1.0], [1.0 - left, 1.0])]
        blocks.append(
            (2, _bulging()) if what == "round" else add_box([left, 0.0], [1.0 - left, 1.0])
        )
        _, ((low,), (high,)) = occ.fragment(blocks[:1], blocks[1:])
        occ.synchronize()
        name(2, {"lower": [low[1]], "upper": [high[1]]})
        sides = {"left": (0, left), "right": (0, 1.0), "bottom": (1, -1.0), "top": (1, 1.0)}
        name_planes(1, sides)
        name(1, {"seam": interface(1)})
        order = 2 if what == "round" else 1

        def mesh(body: str = "") -> None:
            size = SIZE / 1.4 if what == "apart" and body == "upper" else SIZE
            generate(2, lambda x, y, z: size, order)

        if what == "apart":
            write_apart(path, mesh)
        else:
            mesh()
            write_split(path)


def _bulging() -> int:
    """Give the upper block a rounded right side."""
    occ = gmsh.model.occ
    a, b, c, d = (occ.addPoint(x, y, 0.0) for x, y in [(-1, 0), (1, 0), (1, 1), (-1, 1)])
    arc = occ.addCircleArc(b, occ.addPoint(0.0, 0.5, 0.0), c)
    return add_polygon([occ.addLine(a, b), arc, occ.addLine(c, d), occ.addLine(d, a)])


def _toml(tables: Mapping[str, Any]) -> str:
    """Return a case file from tables by their headings."""
    text = []
    for heading, table in tables.items():
        several = isinstance(table, list)
        for one in table if several else [table]:
            text.append(f"[[{heading}]]" if several else f"[{heading}]")
            text += [f"{key} = {_value(value)}" for key, value in one.items()]
    return "\n".join(text) + "\n"


def _value(value: object) -> str:
    """Return a value as TOML; a table becomes an inline table."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(of)}" for key, of in value.items()) + " }"
    return json.dumps(value)
