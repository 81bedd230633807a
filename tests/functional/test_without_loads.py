"""Test bodies without loads: ζ multiplies a press fit, a temperature or a settlement."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 300.0, expansion=1e-5)
HELD = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"), Support("top", "z")]
BLOCKS = case_text(
    {"builder": "stacked_blocks", "n": 1},
    {"lower": STEEL, "upper": STEEL},
    HELD,
    more="[output]\npictures = false\n",
).replace('[[load]]\non = "top"\npressure = 1.0\n', "")
CONTACT = '[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
WARM = "".join(f'[[temperature]]\non = "{body}"\nchange = 50.0\n' for body in ("lower", "upper"))
LOADING = "[loading]\nvalues = [1.0]\n"

ALONE = {
    "a press fit": BLOCKS + CONTACT + "gap = -1e-3\ninterference = true\n",
    "heating": BLOCKS + CONTACT + WARM,
    "a settlement": BLOCKS.replace(
        '[[support]]\non = "top"\n', '[[support]]\non = "top"\nvalue = -1e-3\n'
    )
    + CONTACT,
}
"""Strain 5e-4 over the height 2, or shortening 1e-3: pressure 100 with Young's modulus 2e5."""


@pytest.mark.parametrize("what", ALONE)
def test_one_level(what: str, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    case = write_case(comm, shared_tmp_path / "case.toml", ALONE[what] + LOADING)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "r")]) == SOLVED
    if comm.rank == 0:
        text = (shared_tmp_path / "r" / "summary.json").read_text(encoding="utf-8")
        last = json.loads(text)["steps"][-1]
        assert last["reactions"]["support bottom"] == pytest.approx([0, 0, 100.0], abs=1e-6)
        assert last["balance"] < 1e-9


@pytest.mark.parametrize(
    "text",
    [
        BLOCKS + CONTACT + LOADING,
        ALONE["heating"] + '[loading]\ncontrol = "work"\nuntil = "limit"\n',
        ALONE["a settlement"] + '[loading]\ncontrol = "bounds"\n',
    ],
    ids=["nothing at all", "a limit load", "bounds"],
)
def test_refused(
    text: str, comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["check", str(case)]) == BAD_INPUT
    assert "add a [[load]] table" in comm.bcast(capsys.readouterr().err)
