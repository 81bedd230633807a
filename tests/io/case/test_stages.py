"""Test stages in case files: the resulting stages, and one sentence for each fault."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Elastic, Flow, Hardening, InputError, Stage, VonMises
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import read_case
from tests.io.case.test_case import assert_one_sentence
from tests.models import write_case

pytestmark = pytest.mark.serial

BASE = """
[mesh]
builder = "stacked_blocks"
n = 1
[material.lower]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 300.0
[material.upper]
law = "von-mises-hardening"
young = 2e5
poisson = 0.3
yield_stress = 300.0
kinematic = 2000.0
[[support]]
on = "bottom"
[[load]]
name = "push"
on = "top"
pressure = 1.0
[[load]]
name = "weight"
on = "upper"
body_force = [0.0, 0.0, -1.0]
constant = true
[[contact]]
primary = "lower_top"
secondary = "upper_bottom"
"""

STAGES = """
[[stage]]
factors = { push = 200.0 }
steps = 4
[[stage]]
name = "off"
factors = { push = 0 }
"""

OBSTACLE = """
[[obstacle]]
shape = "plane"
on = "top"
point = [0.0, 0.0, 2.0]
normal = [0.0, 0.0, -1.0]
move = [0.0, 0.0, -1.0]
"""

Read = Callable[[str], Case]


@pytest.fixture
def read(shared_tmp_path: Path, comm: MPI.Intracomm) -> Read:
    return lambda text: read_case(write_case(comm, shared_tmp_path / "case.toml", text), comm)


def test_everything_arrives(read: Read) -> None:
    case = read(BASE + STAGES)
    assert case.stages == [Stage({"push": 200.0}, 4), Stage({"push": 0.0}, 1, "off")]
    assert case.materials == {
        "lower": Flow(VonMises(2e5, 0.3, 300.0)),
        "upper": Flow(Hardening(2e5, 0.3, 300.0, kinematic=2000.0)),
    }
    assert case.method == "newton"
    assert "2 stages" in repr(case)


def test_what_moves_follows_the_stage_that_names_it(read: Read) -> None:
    """Motions follow the stage that gives their name or surface.

    Motions that no stage names, and motions with the name of a load, stay.
    """
    moved = [
        '[[support]]\nname = "press"\non = "x0"\ncomponents = "x"\nvalue = 1.0\n',
        '[[support]]\non = "y0"\ncomponents = "y"\nvalue = 2.0\n',
        '[[support]]\non = "top"\ncomponents = "x"\nvalue = 3.0\n',
        '[[rigid_surface]]\nname = "end"\non = "upper_bottom"\nrotation = [0.0, 1.0, 0.0]\n',
    ]
    loaded = BASE.replace('name = "push"\n', "")
    stage = "[[stage]]\nfactors = { press = 1.0, end = 2.0, top = 1.0, y0 = 0.5 }\n"
    case = read(loaded + "".join(moved) + stage)
    assert [(a.name, a.constant) for a in case.supports[1:]] == [
        *(("press", False), ("", False), ("", True)),
    ]
    assert [surface.constant for surface in case.rigid] == [False]
    without = '[material.lower]\nlaw = "elastic"\nyoung = 1.0\npoisson = 0.0\n'
    only = f'[mesh]\nbuilder = "stacked_blocks"\nn = 1\n{without}{without.replace("low", "upp")}'
    case = read(only + OBSTACLE + "[[stage]]\nfactors = { top = 1.0 }\n")
    assert case.loads == []


def test_without_stages_nothing_is_remembered(read: Read) -> None:
    case = read(BASE + "[loading]\nvalues = [1.0]\n")
    assert case.materials["lower"] == VonMises(2e5, 0.3, 300.0)
    assert not case.stages


def test_elastic_bodies_have_nothing_to_remember(read: Read) -> None:
    elastic = BASE.replace('"von-mises"', '"elastic"').replace("yield_stress = 300.0\n", "", 1)
    assert read(elastic + STAGES).materials["lower"] == Elastic(2e5, 0.3)


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("push = 200.0", "weight = 2.0", ["stage 1", "'weight', which is constant"]),
        ("push = 200.0", "pusch = 2.0", ["stage 1", "factor for 'pusch'", "did you mean 'push'"]),
        ("factors = { push = 200.0 }", "", ["number 1", "'factors' is missing"]),
        ("push = 200.0", "push = nan", ["number 1", "'push' is nan"]),
        ("push = 200.0", "push = 1e200", ["number 1", "factor of 'push' = 1e+200 is too large"]),
        ("push = 200.0", 'push = "much"', ["number 1", "table of numbers"]),
        ("steps = 4", "steps = 0", ["number 1", "steps = 0"]),
        ('[[load]]\nname = "push"', '[[load]]\nname = "press"', ["factor for 'push'"]),
        ("[[stage]]\nname", "[loading]\nvalues = [1.0]\n[[stage]]\nname", ["both [loading] and"]),
        (
            "[[stage]]\nname",
            '[solve]\nmethod = "work-newton"\n[[stage]]\nname',
            ["stages prescr"],
        ),
        (STAGES, "", ["'loading' is missing"]),
        (STAGES, STAGES + OBSTACLE, ["motion of 'top' is in no stage"]),
        (STAGES, '[loading]\ncontrol = "work"\nuntil = "limit"', ["of 'upper' hardens"]),
        (STAGES, '[loading]\ncontrol = "bounds"', ["of 'upper' hardens"]),
        ("kinematic = 2000.0", "", ["[material.upper]", "both zero"]),
        (
            "steps = 4",
            "steps = 1000000000000",
            ["number 1", "steps = 1000000000000 is not a valid number"],
        ),
        (
            STAGES,
            '[[support]]\non = "top"\nvalue = 1.0\nconstant = false\n' + STAGES,
            ["the loading does not move it", "a stage that names it"],
        ),
    ],
)
def test_what_is_refused(
    read: Read, comm: MPI.Intracomm, old: str, new: str, parts: list[str]
) -> None:
    text = BASE + STAGES
    assert old in text
    with pytest.raises(InputError) as refusal:
        read(text.replace(old, new, 1))
    assert_one_sentence(comm, refusal.value, "case.toml", *parts)


def test_a_load_in_no_stage(read: Read, comm: MPI.Intracomm) -> None:
    more = '[[load]]\non = "x0"\npressure = 1.0\n'
    with pytest.raises(InputError) as refusal:
        read(BASE + more + STAGES)
    assert_one_sentence(comm, refusal.value, "'x0' is in no stage")
