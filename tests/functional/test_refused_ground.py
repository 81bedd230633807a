"""Test ground that is invalid or unsupported: one sentence each, and status 2."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.materials import MohrCoulomb
from tests.functional.test_command_line import one_line
from tests.models import write_case

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = """
[mesh]
builder = "stacked_blocks"
n = 1
[material.lower]
LAW
[material.upper]
LAW
[[tie]]
primary = "lower_top"
secondary = "upper_bottom"
[[support]]
on = "bottom"
[[load]]
on = "top"
pressure = 1.0
[loading]
values = [1.0]
"""
PYRAMID = 'law = "mohr-coulomb"\n'
CONE = 'law = "drucker-prager"\nmatch = "plane-strain"\n'
GIVEN = {"young": 3e4, "poisson": 0.3, "cohesion": 10.0, "friction_angle": 25.0}
ELASTIC = 'law = "elastic"\nyoung = 3e4\npoisson = 0.3'
GROWS = ("values = [1.0]", 'control = "strength"')
STAYS = ("pressure = 1.0", "pressure = 1.0\nconstant = true")


def ground(law: str, **numbers: float) -> str:
    """Return a law with its numbers, as TOML."""
    return law + "\n".join(f"{key} = {value}" for key, value in (GIVEN | numbers).items())


def changed(law: str, *changes: tuple[str, str]) -> str:
    """Return the case of a law with changes."""
    text = CASE.replace("LAW", law)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


NUMBERS = [
    ("friction_angle", -1.0, "friction_angle = -1.0 is not between 0 and 90"),
    ("friction_angle", 90.0, "friction_angle = 90.0 is not between 0 and 90"),
    ("friction_angle", 0.0, "for ground without friction"),
    ("friction_angle", float("nan"), "friction_angle = nan is not between 0 and 90"),
    ("cohesion", -1.0, "cohesion = -1.0 is "),
    ("cohesion", float("nan"), "cohesion = nan is "),
    ("dilatancy_angle", 30.0, "= 30 is not between 0 and friction_angle = 25"),
    ("dilatancy_angle", -5.0, "= -5 is not between 0 and friction_angle = 25"),
    ("dilatancy_angle", float("nan"), "dilatancy_angle = nan is not between 0 and"),
    ("dilatancy_angle", 5.0, "= 5 is less than friction_angle = 25"),
    ("dilatancy", 5.0, "did you mean 'dilatancy_angle'?"),
]

REFUSED = {
    "a cone without match": (
        changed(ground('law = "drucker-prager"\n')),
        "'match' is missing; give 'plane-strain', 'compression' or 'extension'",
    ),
    "levels of ground of which bounds are known": (
        changed(ground(PYRAMID + 'nonassociated = "radenkovic"\n', dilatancy_angle=5.0)),
        "the ground of 'lower' has nonassociated = 'radenkovic'",
    ),
    "nothing dilates less": (
        changed(ground(CONE + 'nonassociated = "davis-a"\n')),
        "nonassociated = 'davis-a' needs a dilatancy_angle smaller",
    ),
    "friction of a law without": (changed(ground('law = "tresca"\n')), "no key 'friction_angle'"),
    "strength of elastic bodies": (changed(ELASTIC, GROWS, STAYS), "all bodies are elastic"),
    "strength of loads that grow": (changed(ground(PYRAMID), GROWS), "the load on 'top' grows"),
    "a sheet of tetrahedra": (
        changed(ground(PYRAMID), ("[loading]", '[model]\nkind = "plane-stress"\n[loading]')),
        "a mesh of triangles",
    ),
    **{
        f"{key} = {value} of {law}": (changed(ground(law, **{key: value})), says)
        for law in (PYRAMID, CONE)
        for key, value, says in NUMBERS
    },
}


@pytest.mark.parametrize("fault", REFUSED)
def test_one_sentence(
    fault: str, comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, says = REFUSED[fault]
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["check", str(case)]) == BAD_INPUT
    told = one_line(comm, capsys)
    assert says in told
    assert told.count("case.toml") == 1


@pytest.mark.parametrize("law", [PYRAMID, CONE])
def test_dilatancy_of_friction(
    law: str, comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """This value is the one of associated ground."""
    text = changed(ground(law, dilatancy_angle=25.0))
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["check", str(case)]) == SOLVED
    assert capsys.readouterr().err == ""
    same = MohrCoulomb(3e4, 0.3, 10.0, 25.0, dilatancy_angle=25.0)
    assert same.divided_by(1.2) == MohrCoulomb(3e4, 0.3, 10.0, 25.0).divided_by(1.2)


@pytest.mark.long
def test_a_run_says_what_its_numbers_are_of(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The note accompanies bounds, and levels."""
    soil = ground(PYRAMID + 'nonassociated = "davis-c"\n', dilatancy_angle=5.0)
    case = write_case(comm, shared_tmp_path / "case.toml", changed(soil))
    assert main(["run", str(case), "-o", str(shared_tmp_path / "levels")]) == SOLVED
    told = "Davis' method C replaces it by associated ground with cohesion 9.3739"
    if comm.rank == 0:
        assert told in capsys.readouterr().out
    bounds = changed(soil, ("values = [1.0]", 'control = "bounds"'))
    case = write_case(comm, shared_tmp_path / "case.toml", bounds)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "bounds")]) == SOLVED
    verdict = json.loads((shared_tmp_path / "bounds" / "summary.json").read_text())["limit"]
    assert told in verdict["verdict"]
