"""Stages in case files: what they become, and one sentence for each thing wrong in them."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Elastic, Flow, Hardening, InputError, Stage, VonMises
from perfplast_fenicsx.io.case.case import Case, read_case
from tests.io.case.test_case import assert_one_sentence
from tests.models import write_case

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


def test_without_stages_nothing_is_remembered(read: Read) -> None:
    case = read(BASE + "[loading]\nvalues = [1.0]\n")
    assert case.materials["lower"] == VonMises(2e5, 0.3, 300.0)
    assert case.stages == []


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
        (STAGES, STAGES + OBSTACLE, ["[[stage]]: the obstacle at 'top' has a move"]),
        (STAGES, '[loading]\ncontrol = "work"\nuntil = "limit"', ["of 'upper' hardens"]),
        (STAGES, '[loading]\ncontrol = "bounds"', ["of 'upper' hardens"]),
        ("kinematic = 2000.0", "", ["[material.upper]", "both zero"]),
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
