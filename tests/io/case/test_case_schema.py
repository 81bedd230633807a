"""Test the JSON Schema of case files: it accepts valid cases, and marks seeded faults."""

import json
import tomllib
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.case.case_schema import case_schema

jsonschema = pytest.importorskip("jsonschema")

ROOT = Path(__file__).parents[3]
CASES = sorted([*ROOT.glob("demos/*.toml"), *ROOT.glob("docs/gallery/*.toml")])

STAGED = """
[mesh]
file = "a.msh"
[material.block]
law = "elastic"
young = 1.0
poisson = 0.3
[[support]]
on = "bottom"
[[stage]]
factors = {push = 1.0}
"""


@pytest.fixture(scope="module")
def validator() -> Any:
    """Return a validator of whole cases, after a validation of the schema itself."""
    schema = case_schema()
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def test_there_are_cases() -> None:
    assert len(CASES) >= 8


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_every_case_that_is_shipped_passes(validator: Any, path: Path) -> None:
    assert [error.message for error in validator.iter_errors(read(path))] == []


def test_stages_pass(validator: Any) -> None:
    assert validator.is_valid(tomllib.loads(STAGED))


def read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text())


def at(case: dict[str, Any], *keys: str | int) -> Any:
    """Return the value at a place of a case."""
    for key in keys:
        case = case[key]  # type: ignore[index]
    return case


SOME = "material", "block"
FAULTS: dict[str, tuple[tuple[str | int, ...], dict[str, Any], str | None]] = {
    "a law that there is not": (SOME, {"law": "mises"}, None),
    "no law": (SOME, {}, "law"),
    "no yield stress": (SOME, {}, "yield_stress"),
    "a misspelt key of a material": (SOME, {"yeild_stress": 1.0}, None),
    "a number as text": (SOME, {"young": "206.9e3"}, None),
    "a number of another law": (SOME, {"cohesion": 1.0}, None),
    "an unknown table": ((), {"supports": []}, None),
    "no materials": ((), {}, "material"),
    "no mesh": ((), {}, "mesh"),
    "no loading": ((), {}, "loading"),
    "stages beside a loading": ((), {"stage": [{"factors": {}}]}, None),
    "a table for an array of tables": ((), {"support": {"on": "bottom"}}, None),
    "a support on nothing": (("support", 0), {}, "on"),
    "a misspelt key of a support": (("support", 0), {"component": "xyz"}, None),
    "components as a list": (("support", 0), {"components": ["x"]}, None),
    "a load of an unknown kind": (("load", 0), {"tracton": [0, 0, 1]}, None),
    "a traction that is no list": (("load", 0), {"traction": 1.0}, None),
    "a flag as text": (("load", 0), {"constant": "true"}, None),
    "a contact without its other side": (("contact", 0), {}, "secondary"),
    "an unknown control": (("loading",), {"control": "force"}, None),
    "a key of another control": (("loading",), {"limit_tolerance": 1e-3}, None),
    "values as text": (("loading",), {"values": "10, 20"}, None),
    "a degree that there is not": ((), {"element": {"degree": 3}}, None),
    "an unknown method": ((), {"solve": {"method": "newtons"}}, None),
    "an option of another method": ((), {"solve": {"method": "newton", "penalty": 1.0}}, None),
    "an unknown kind of model": ((), {"model": {"kind": "plane"}}, None),
    "an unknown system of units": ((), {"units": {"system": "imperial"}}, None),
    "a number of a report that is no text": ((), {"report": {"number": 17}}, None),
    "an unknown builder": ((), {"mesh": {"builder": "three_blocks", "n": 1}}, None),
    "an argument that the builder has not": (("mesh",), {"size": 1.0}, None),
}
"""Place in the case below, entries to add there, and the key to remove."""

CASE = """
[mesh]
builder = "two_blocks"
n = 2
[material.block]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0
[[support]]
on = "left"
components = "xyz"
[[load]]
on = "top"
traction = [0.0, 0.0, -1.0]
[[contact]]
primary = "lower_top"
secondary = "upper_bottom"
[loading]
control = "load"
values = [50.0, 60.0]
"""


def test_the_case_of_the_faults_is_right(validator: Any) -> None:
    assert validator.is_valid(tomllib.loads(CASE))


@pytest.mark.parametrize("fault", FAULTS)
def test_seeded_faults_are_marked(validator: Any, fault: str) -> None:
    place, change, missing = FAULTS[fault]
    case = tomllib.loads(CASE)
    table = at(case, *place)
    table.update(change)
    if missing is not None:
        del table[missing]
    assert not validator.is_valid(case)


def test_the_command_shows_and_writes_it(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    assert main(["schema"]) == SOLVED
    shown = capsys.readouterr().out
    file = shared_tmp_path / "case.schema.json"
    assert main(["schema", "-o", str(file)]) == SOLVED
    if comm.rank == 0:
        assert json.loads(shown) == json.loads(file.read_text()) == case_schema()
    assert main(["schema", "-o", str(shared_tmp_path / "no" / "x.json")]) == BAD_INPUT
