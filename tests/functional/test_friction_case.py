"""Test friction and contact from a case file: pressed and pushed in stages, and refusals."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED

CASE = """
title = "Blocks on a floor"
[mesh]
builder = "stacked_blocks"
n = 1
[material.lower]
law = "elastic"
young = 200e3
poisson = 0.0
[material.upper]
law = "von-mises"
young = 200e3
poisson = 0.0
yield_stress = 400.0
[[support]]
on = "y0"
components = "y"
[[load]]
on = "top"
name = "press"
pressure = 1.0
[[load]]
on = "x0"
name = "push"
pressure = 1.0
[output]
pictures = false
"""
ONE_STEP = "[loading]\nvalues = [1.0]\n"
CONTACT = '[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
FLOOR = '[[obstacle]]\nshape = "plane"\non = "bottom"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n'
TIE = '[[tie]]\nprimary = "{}"\nsecondary = "{}"\n'
STAGES = """
[[stage]]
factors = { press = 100.0, push = 0.0 }
[[stage]]
factors = { push = 4.0 }
[[stage]]
factors = { push = 0.0 }
"""

REFUSED = {
    "far": (
        '[[contact]]\nprimary = "x0"\nsecondary = "top"\n',
        "nowhere opposite each other",
    ),
    "uncovered": (CONTACT.replace("lower_top", "x0"), "nowhere opposite each other"),
    "ring": (
        TIE.format("lower_top", "upper_bottom")
        + TIE.format("upper_bottom", "lower_top")
        + FLOOR
        + '[[support]]\non = "x0"\ncomponents = "x"\n',
        "has the same surfaces as tie 1",
    ),
    "shear stress": (CONTACT + "tresca = -1.0\n", "tresca = -1.0 is not valid"),
    "coefficient": (CONTACT + "coulomb = -0.1\n", "coulomb = -0.1 is not valid"),
    "name": (CONTACT + FLOOR + "coulomb = 0.1\n", "has friction, so it needs a name"),
    "tied": (
        CONTACT + "tresca = 1.0\n" + TIE.format("lower_top", "upper_bottom"),
        "has the same surfaces as contact 1",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_one_sentence(
    what: str, shared_tmp_path: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    tables, words = REFUSED[what]
    case = shared_tmp_path / "case.toml"
    if comm.rank == 0:
        case.write_text(CASE + ONE_STEP + tables, encoding="utf-8")
    comm.barrier()
    assert main(["run", str(case), "-o", str(shared_tmp_path / "results")]) == BAD_INPUT
    error = capsys.readouterr().err
    if comm.rank == 0:
        assert words in error
        assert error.count("\n") == 1


@pytest.mark.parametrize("law", ["tresca = 20.0", "coulomb = 0.2"])
def test_pressed_then_pushed_and_left(law: str, shared_tmp_path: Path, comm: MPI.Intracomm) -> None:
    """The floor carries the push, and its force returns to zero with the push."""
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        tables = f'{CONTACT}{law}\n{FLOOR}name = "floor"\n{law}\n'
        case.write_text(CASE + tables + STAGES, encoding="utf-8")
    comm.barrier()
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    steps = json.loads((results / "summary.json").read_text(encoding="utf-8"))["steps"]
    forces = [step["reactions"] for step in steps]
    pushes = [force["loads"][0] for force in forces]
    assert pushes[1] > 1.0
    held = [-force["obstacle floor"][0] for force in forces]
    assert held == pytest.approx(pushes, abs=1e-6)
    assert pushes[2] == pytest.approx(0.0, abs=1e-6)
    assert all(abs(step["duality_gap"]) < 1e-10 for step in steps)
