"""``perfplast mesh`` of models of others, from the file to a case that runs."""

import json
import tomllib
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.run import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.case.case_schema import case_schema
from tests.models_of_others.meshes import bdf_text, unv_text, write_med

ELASTIC = """*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=CUBE
1,1,2,3,4,5,6,7,8
*NSET, NSET=X
1,4,5,8
*NSET, NSET=Y
1,2,5,6
*NSET, NSET=Z
1,2,3,4
*MATERIAL, NAME=M
*ELASTIC
2.1E11,0.3
*SOLID SECTION, ELSET=CUBE, MATERIAL=M
*BOUNDARY
X,1
Y,2
Z,3
*STEP
*STATIC
*DLOAD
1,P2,1E6
*END STEP
"""


@pytest.fixture
def folder(comm: MPI.Intracomm, shared_tmp_path: Path) -> Path:
    """With models in it."""
    if comm.rank == 0:
        write_med(shared_tmp_path / "a.med")
        (shared_tmp_path / "a.unv").write_text(unv_text())
        (shared_tmp_path / "a.bdf").write_text(bdf_text())
        (shared_tmp_path / "elastic.inp").write_text(ELASTIC)
        (shared_tmp_path / "soft.inp").write_text(ELASTIC.replace("2.1E11", "10"))
        yields = ELASTIC.replace("*SOLID", "*PLASTIC\n235E6,0\n*SOLID")
        (shared_tmp_path / "yields.inp").write_text(yields)
    comm.barrier()
    return shared_tmp_path


@pytest.mark.serial
@pytest.mark.parametrize("name", ["a.med", "a.unv", "a.bdf"])
def test_a_folder_for_each_format(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Mesh, case with all that is known, and a schema beside it by which an editor marks faults."""
    out = folder / "out"
    assert main(["mesh", str(folder / name), "-o", str(out), "--material", "s235"]) == SOLVED
    told = capsys.readouterr().out
    text = (out / "case.toml").read_text()
    assert text.splitlines()[0] == "#:schema ./case.schema.json"
    assert json.loads((out / "case.schema.json").read_text()) == case_schema()
    case = tomllib.loads(text)
    assert {one["yield_stress"] for one in case["material"].values()} == {235.0}
    assert case["units"] == {"stress": "MPa"}
    listed = text[text.index("# Surfaces") :]
    top = "pid_12" if name == "a.bdf" else "top"
    assert f" {top}," in listed and f" {top} " in told
    assert "'lower' and 'upper' share nodes, and are one piece there" in text
    assert "upper_x_low" in listed  # a flat end, which the file has no name for
    assert (out / "case.msh").exists()


@pytest.mark.serial
def test_a_material_in_the_units_of_the_file(folder: Path) -> None:
    """Young's modulus tells them."""
    case, out = folder / "elastic.inp", folder / "out"
    assert main(["mesh", str(case), "-o", str(out), "--material", "s235"]) == SOLVED
    found = tomllib.loads((out / "case.toml").read_text())
    assert found["material"]["cube"]["yield_stress"] == pytest.approx(235e6)
    assert found["units"] == {"stress": "Pa"}
    assert "<-" not in (out / "case.toml").read_text()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("name", "material", "says"),
    [
        ("yields.inp", "s235", "has a yield stress in the file"),
        ("soft.inp", "s235", "those of s235 in no unit"),
        ("elastic.inp", "butter", "no material 'butter'"),
    ],
)
def test_a_material_that_does_not_go(
    folder: Path, name: str, material: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder / "out"
    arguments = ["mesh", str(folder / name), "-o", str(out), "--material", material]
    assert main(arguments) == BAD_INPUT
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_from_the_file_to_the_limit_load(comm: MPI.Intracomm, folder: Path) -> None:
    """A cube of steel that is pressed uniformly yields all over at its yield stress."""
    out = folder / "out"
    model = ["mesh", str(folder / "elastic.inp"), "-o", str(out), "--material", "s235"]
    assert main(model) == SOLVED
    comm.barrier()
    assert main(["run", str(out / "case.toml"), "-o", str(out / "results")]) == SOLVED
    summary = json.loads((out / "results" / "summary.json").read_text())
    assert summary["limit"]["estimate"] == pytest.approx(235.0, rel=1e-3)


@pytest.mark.parametrize("text", ["", "\0\1\2", "no model\n"])
@pytest.mark.parametrize("ending", ["inp", "med", "unv", "bdf"])
def test_what_is_no_model_is_one_sentence_on_all_ranks(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    ending: str,
    text: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = shared_tmp_path / f"a.{ending}"
    if comm.rank == 0:
        path.write_text(text)
    comm.barrier()
    assert main(["mesh", str(path), "-o", str(shared_tmp_path / "out")]) == BAD_INPUT
    told = capsys.readouterr().err.strip()
    if comm.rank == 0:
        assert told.startswith("perfplast: ")
        assert "\n" not in told
    assert not (shared_tmp_path / "out").exists()
