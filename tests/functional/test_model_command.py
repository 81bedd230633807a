"""Test ``perfplast mesh MODEL.inp`` and the run with its mesh."""

import json
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from tests.functional.test_command_line import one_line
from tests.models_of_others.test_inp_file import HEAD, ONE_BODY, REST

pytestmark = pytest.mark.usefixtures("undrawn")

TWO = """*ELEMENT, TYPE=C3D8, ELSET=LOWER
1,1,2,3,4,5,6,7,8
*NODE
105,0,0,1
106,1,0,1
107,1,1,1
108,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=UPPER
2,105,106,107,108,9,10,11,12
*SURFACE, NAME=UP
1,S2
*SURFACE, NAME=DOWN
2,S1
*CONTACT PAIR, INTERACTION=NONE
UP,DOWN
*SOLID SECTION, ELSET=LOWER, MATERIAL=STEEL
*SOLID SECTION, ELSET=UPPER, MATERIAL=STEEL
"""


@pytest.mark.long(but=["two in contact"])
@pytest.mark.parametrize("bodies", [ONE_BODY, TWO], ids=["one body", "two in contact"])
def test_from_a_model_to_its_limit_load(
    comm: MPI.Intracomm, shared_tmp_path: Path, bodies: str
) -> None:
    """Bars in uniaxial stress carry exactly the yield stress."""
    rest = REST.replace("X0,1\n", "X0,1\n105,1,1\n108,1,1\n").replace("Y0,2,2", "Y0,2,2\n")
    if bodies is TWO:
        rest = rest.replace("1,4,5,8,9,12", "1,4,5,8,9,12,105,108")
        rest = rest.replace("1,2,5,6,9,10", "1,2,5,6,9,10,105,106")
        rest = rest.replace("105,1,1\n108,1,1\n", "")
        rest = rest.replace("*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL\n", "")
    else:
        rest = rest.replace("105,1,1\n108,1,1\n", "")
    source, folder = shared_tmp_path / "bar.inp", shared_tmp_path / "bar"
    if comm.rank == 0:
        source.write_text(HEAD + bodies + rest)
    comm.barrier()
    assert main(["mesh", str(source), "-o", str(folder)]) == SOLVED
    results = folder / "results"
    assert main(["run", str(folder / "case.toml"), "-o", str(results)]) == SOLVED
    if comm.rank == 0:
        limit = json.loads((results / "summary.json").read_text())["limit"]
        assert limit["estimate"] == pytest.approx(235, rel=2e-3)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--size", "2"], "has a mesh"),
        (["--tied"], "has a mesh"),
        (["--material", "s235"], "has a yield stress in the file"),
    ],
)
def test_options_of_geometry_files_are_refused(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    arguments: list[str],
    named: str,
) -> None:
    source = shared_tmp_path / "bar.inp"
    if comm.rank == 0:
        source.write_text(HEAD + ONE_BODY + REST)
    comm.barrier()
    assert main(["mesh", str(source), "-o", str(shared_tmp_path / "x"), *arguments]) == BAD_INPUT
    assert named in one_line(comm, capsys)
