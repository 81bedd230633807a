"""Test ``perfplast mesh`` with models in other formats, from the file to a case that runs."""

import json
import tomllib
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.case.case_schema import case_schema
from tests.models_of_others.meshes import bdf_text, unv_text, write_med

pytestmark = pytest.mark.usefixtures("undrawn")

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
    """Return a folder with models."""
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


@pytest.mark.long(but=["a.med"])
@pytest.mark.serial
@pytest.mark.parametrize("name", ["a.med", "a.unv", "a.bdf"])
def test_a_folder_for_each_format(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command writes a mesh, a case with all known data, and a schema for editors."""
    out = folder / "out"
    assert main(["mesh", str(folder / name), "-o", str(out), "--material", "s235"]) == SOLVED
    told = capsys.readouterr().out
    text = (out / "case.toml").read_text()
    assert text.splitlines()[0] == "#:schema ./case.schema.json"
    assert json.loads((out / "case.schema.json").read_text()) == case_schema()
    case = tomllib.loads(text)
    jsonschema = pytest.importorskip("jsonschema")
    assert jsonschema.Draft7Validator(case_schema()).is_valid(case)
    assert {one["yield_stress"] for one in case["material"].values()} == {235.0}
    assert case["units"] == {"stress": "MPa"}
    listed = text[text.index("# Surfaces") :]
    top = "pid_12" if name == "a.bdf" else "top"
    assert f" {top}," in listed and f" {top} " in told
    assert "'lower' and 'upper' share nodes, so they are connected" in text
    assert "upper_x_low" in listed  # a flat end without a name in the file
    assert (out / "case.msh").exists()


@pytest.mark.serial
def test_a_material_in_the_units_of_the_file(folder: Path) -> None:
    """Young's modulus determines the units."""
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
        ("soft.inp", "s235", "fit s235 in any"),
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


@pytest.mark.long
def test_from_the_file_to_the_limit_load(comm: MPI.Intracomm, folder: Path) -> None:
    """A steel cube under uniform pressure yields everywhere at its yield stress."""
    out = folder / "out"
    model = ["mesh", str(folder / "elastic.inp"), "-o", str(out), "--material", "s235"]
    assert main(model) == SOLVED
    comm.barrier()
    assert main(["run", str(out / "case.toml"), "-o", str(out / "results")]) == SOLVED
    summary = json.loads((out / "results" / "summary.json").read_text())
    assert summary["limit"]["estimate"] == pytest.approx(235.0, rel=1e-3)


@pytest.mark.mpi2("inp-")
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


TWO = """*PART, NAME=CUBE
{nodes}*ELEMENT, TYPE=C3D8, ELSET=ALL
{elements}*SOLID SECTION, ELSET=ALL, MATERIAL={lower}
*END PART
*PART, NAME=SMALL
{nodes}*ELEMENT, TYPE=C3D8, ELSET=ALL
{elements}*SOLID SECTION, ELSET=ALL, MATERIAL=SOFT
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=LOW, PART=CUBE
*END INSTANCE
*INSTANCE, NAME=HIGH, PART=SMALL
0.,0.,1.
*END INSTANCE
*NSET, NSET=FOOT, INSTANCE=LOW
{foot}
*ELSET, ELSET=BELOW, INSTANCE=LOW
{top}
*ELSET, ELSET=ABOVE, INSTANCE=HIGH
{bottom}
*ELSET, ELSET=PRESSED, INSTANCE=HIGH
{pressed}
*SURFACE, NAME=ONE, TYPE=ELEMENT
BELOW, S2
*SURFACE, NAME=OTHER, TYPE=ELEMENT
ABOVE, S1
*END ASSEMBLY
*MATERIAL, NAME=HARD
*ELASTIC
2.1E5, 0.3
*PLASTIC
355., 0.
*MATERIAL, NAME=SOFT
*ELASTIC
7E4, 0.33
*PLASTIC
160., 0.
*SURFACE INTERACTION, NAME=I
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD
*CONTACT PAIR, INTERACTION=I
OTHER, ONE
*BOUNDARY
FOOT, ENCASTRE
*STEP
*STATIC
*DLOAD
PRESSED, P2, 100.
*END STEP
"""
"""Two stacked cubes of 2 x 2 x 2 elements each; pressure acts on half of the upper cube."""

BY_HAND = """
[mesh]
file = "case.msh"
[material.low]
law = "von-mises"
young = 210e3
poisson = 0.3
yield_stress = 355.0
[material.high]
law = "von-mises"
young = 70e3
poisson = 0.33
yield_stress = 160.0
[[support]]
on = "foot"
[[contact]]
primary = "other"
secondary = "one"
[[load]]
on = "pressed_p2"
pressure = 100.0
[element]
degree = 2
[loading]
control = "work"
until = "limit"
"""


def _two_cubes() -> str:
    grid = [(x, y, z) for z in range(3) for y in range(3) for x in range(3)]
    nodes = "*NODE\n" + "".join(
        f"{k},{x / 2},{y / 2},{z / 2}\n" for k, (x, y, z) in enumerate(grid, start=1)
    )
    elements, first = "", [x + 3 * y + 9 * z + 1 for x, y, z in grid if max(x, y, z) < 2]
    for k, n in enumerate(first, start=1):
        around = [n, n + 1, n + 4, n + 3]
        elements += ",".join(map(str, [k, *around, *(a + 9 for a in around)])) + "\n"
    foot = ",".join(map(str, range(1, 10)))
    own = {"top": "5,6,7,8", "bottom": "1,2,3,4", "pressed": "5,6"}
    return TWO.format(nodes=nodes, elements=elements, foot=foot, lower="HARD", **own)


@pytest.mark.long
def test_contact_and_materials_of_a_file_are_those_of_a_case_by_hand(
    comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    out = shared_tmp_path / "out"
    if comm.rank == 0:
        (shared_tmp_path / "two.inp").write_text(_two_cubes())
    comm.barrier()
    assert main(["mesh", str(shared_tmp_path / "two.inp"), "-o", str(out)]) == SOLVED
    if comm.rank == 0:
        (out / "hand.toml").write_text(BY_HAND)
    comm.barrier()
    found = []
    for name in ("case", "hand"):
        assert main(["run", str(out / f"{name}.toml"), "-o", str(out / name)]) == SOLVED
        found.append(json.loads((out / name / "summary.json").read_text()))
    case, hand = (one["limit"] for one in found)
    assert case["estimate"] == pytest.approx(hand["estimate"], rel=2e-4)
    assert 0.5 < case["estimate"] / 1.6 < 1.5  # the soft cube yields below the loaded half
    assert found[0]["mesh"] == found[1]["mesh"]
