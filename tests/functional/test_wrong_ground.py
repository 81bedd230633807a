"""Test invalid ground and water: ``check`` and ``run`` refuse each and name the place."""

from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT
from tests.functional.test_command_line import one_line
from tests.models import write_case

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = """
units.system = "m-kN-kPa"
geometry.size = 8.0
loading.control = "strength"
gravity = { acceleration = [0.0, -1.0], density = { clay = 19.0, sand = 18.0 } }
support = [{ on = "base" }, { on = "left", components = "x" }, { on = "right", components = "x" }]

[[region]]
name = "sand"
points = [[30, 25], [70, 31], [70, 35], [50, 35]]

[[region]]
name = "clay"
points = [[20, 20], [70, 20], [70, 31], [30, 25], [20, 25]]

[material]
sand = { law = "mohr-coulomb", young = 1e4, poisson = 0.3, cohesion = 5.0, friction_angle = 30.0 }
clay = { law = "tresca", young = 1e4, poisson = 0.3, cohesion = 30.0 }
"""
WATER = "\n[water]\ntable = [[20, 25], [70, 30]]\n"
FLOW = """
[seepage]
conductivity = {{ sand = 1e-5, clay = 1e-7 }}
outlet = ["surface"]
[[seepage.head]]
on = "right"
level = {}
presses = false
"""
STRATA = """
[[stratum]]
name = "sand"
top = [[20, 35], [70, 35]]
[[stratum]]
name = "clay"
top = [[20, 30], [50, 30], [70, 36]]
bottom = 20
"""
REGIONS = CASE[CASE.index("[[region]]") : CASE.index("[material]")]

REFUSED: dict[str, tuple[Sequence[tuple[str, str]], Sequence[str]]] = {
    "a water table beside the ground": (
        [("", WATER.replace("[70, 30]", "[60, 29]"))],
        ["from x = 20 to 60", "the ground from 20 to 70"],
    ),
    "a water table below the ground": (
        [("", WATER.replace("25", "15").replace("30", "16"))],
        ["entirely below the ground", "(20, 20)"],
    ),
    "a unit weight of water in other units": (
        [("m-kN-kPa", "mm-N-MPa"), ("", WATER + "unit_weight = 9.81\n")],
        ["unit_weight = 9.81 N/mm^3 is 1e+06 times"],
    ),
    "strata that cross": ([(REGIONS, STRATA)], ["'clay'", "at x = 70"]),
    "regions that overlap": ([("[70, 31], [70, 35]", "[70, 29], [70, 35]")], ["overlap", "("]),
    "regions with a gap": (
        [("[70, 31], [30, 25]", "[70, 31], [60, 28], [30, 25]")],
        ["with an area of", "around ("],
    ),
    "a negative strength at one corner": (
        [("cohesion = 30.0", 'cohesion = "30 - 4*(y - 20)*(x - 20)/50"')],
        ["clay", "30 - 4*(y - 20)*(x - 20)/50", "is -"],
    ),
    "a strength that falls below zero in cells alone": (
        [("cohesion = 30.0", 'cohesion = "30*abs(y - 22) + 1e-3"')],
        ["of 'clay' varies so steeply"],
    ),
    "an angle of friction that is negative at one corner": (
        [("friction_angle = 30.0", 'friction_angle = "30 - 0.9*(x - 30)"')],
        ["'sand': friction_angle, 30 - 0.9*(x - 30), is -6 degrees at (70, 3"],
    ),
    "an angle of friction above 90 degrees in cells alone": (
        [("friction_angle = 30.0", 'friction_angle = "89.9 - 5*abs(y - 33.123)"')],
        ["friction_angle", "so steeply in the cell at ("],
    ),
    "a table that does not cover its body": (
        [("cohesion = 30.0", "cohesion = [[31, 30], [25, 40]]")],
        ["covers 25 to 31", "material at ("],
    ),
    "a head below the base": ([("", FLOW.format(18.0))], ["18", "right", "20"]),
}


@pytest.mark.long(
    but=[
        "a water table beside the ground",
        "a water table below the ground",
        "a unit weight of water in other units",
        "strata that cross",
        "regions that overlap",
        "regions with a gap",
        "a negative strength at one corner",
        "a strength that falls below zero in cells alone",
        "an angle of friction that is negative at one corner",
    ]
)
@pytest.mark.parametrize("fault", REFUSED)
def test_one_sentence_with_its_place(
    fault: str, comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes, says = REFUSED[fault]
    text = CASE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new) if old else text + new
    case = write_case(comm, shared_tmp_path / "ground.toml", text)
    folder = str(shared_tmp_path / "out")
    told = []
    for command in (["check", str(case)], ["run", str(case), "-o", folder]):
        assert main(command) == BAD_INPUT, command
        told.append(one_line(comm, capsys))
    assert told[0] == told[1]
    for word in says:
        assert word in told[0]
