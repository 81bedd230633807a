"""Test models of Abaqus and CalculiX: the parts that are read, and remarks on the rest."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx import InputError
from perfplast_fenicsx.models.element_types import HEXAHEDRON, PYRAMID, WEDGE, Shape
from perfplast_fenicsx.models.foreign_model import ForeignModel, Held
from perfplast_fenicsx.models.inp_file import read_inp
from perfplast_fenicsx.models.model_case import case_of
from perfplast_fenicsx.models.solid_cells import divided, pieces

pytestmark = pytest.mark.serial

HEAD = """*HEADING
** a comment
*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
9,0,0,2
10,1.,0.,2.,
11,1,1,2
12,0,1,2
"""
ONE_BODY = """*Element, type=C3D8, elset=Eall
1,1,2,3,4,5,6,7,8
2,5,6,7,8,9,10,
11,12
"""
REST = """*NSET, NSET=BASE
1,2,3,4
*NSET, NSET=X0
1,4,5,8,9,12
*NSET, NSET=Y0
1,2,5,6,9,10
*MATERIAL, NAME=STEEL
*ELASTIC
210000,0.3
*PLASTIC
235,0
*DENSITY
7.8E-9
*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL
*SURFACE, NAME=TOP, TYPE=ELEMENT
2,S2
*BOUNDARY
BASE,3,3
X0,1
Y0,2,2
*STEP
*STATIC
*DSLOAD
TOP,P,1.
*END STEP
"""
SHAPES = {
    "hexahedron": (HEXAHEDRON, "000 100 110 010 001 101 111 011", 1.0),
    "wedge": (WEDGE, "000 100 010 001 101 011", 0.5),
    "pyramid": (PYRAMID, "000 100 110 010 001", 1 / 3),
}


def model(folder: Path, text: str) -> ForeignModel:
    path = folder / "model.inp"
    path.write_text(text)
    return read_inp(path)


@pytest.mark.parametrize("name", SHAPES)
def test_cells_are_divided_as_their_neighbours_see_them(name: str) -> None:
    """Any numbering preserves the volume. Only the corners of a face determine its division."""
    shape, places, volume = SHAPES[name]
    corners = np.array([[float(x) for x in place] for place in places.split()])
    random = np.random.default_rng(1)
    for _ in range(60):
        numbers = random.permutation(shape.corners)
        points = np.empty_like(corners)
        points[numbers] = corners
        cells, parents = divided(numbers[None], shape)
        edges = points[cells[:, 1:]] - points[cells[:, :1]]
        volumes = np.abs(np.linalg.det(edges)) / 6
        assert volumes.sum() == pytest.approx(volume)
        assert volumes.min() > 0.1 * volume
        assert not parents.any()
        sides = [tuple(sorted(side)) for cell in cells for side in combinations(cell, 3)]
        outer = {side for side in sides if sides.count(side) == 1}
        assert outer == _faces(shape, numbers)


def _faces(shape: Shape, numbers: np.ndarray) -> set[tuple[int, ...]]:
    cut = [pieces(numbers[None, list(face)]) for face in shape.faces]
    return {tuple(sorted(row)) for some in cut for piece, _ in some for row in piece}


def test_a_case_is_whole(tmp_path: Path) -> None:
    found = model(tmp_path, HEAD + ONE_BODY + REST)
    assert (found.dim, found.bodies, len(found.cells)) == (3, ["eall"], 12)
    assert sorted(found.surfaces) == ["base", "top", "x0", "y0"]
    expected = [Held("base", "z"), Held("x0", "x"), Held("y0", "y")]
    assert sorted(found.held, key=lambda one: one.on) == expected
    (load,) = found.pushed
    assert (load.on, load.kind, load.value) == ("top", "pressure", 1.0)
    assert [remark.split()[0] for remark in found.remarks] == ["2"]  # elements are divided
    text = case_of(found, "box", "model.inp", "case.msh")
    assert "<-" not in text
    assert "yield_stress = 235.0" in text


def test_surfaces_that_overlap_are_divided(tmp_path: Path) -> None:
    """A face with two supports becomes a separate surface, which both supports hold."""
    text = REST.replace("BASE,3,3", "BASE,3,3\nLOWER,1").replace(
        "*NSET, NSET=X0", "*NSET, NSET=LOWER\n1,2,3,4,5,8\n*NSET, NSET=X0"
    )
    found = model(tmp_path, HEAD + ONE_BODY + text)
    of = {name: (found.surface == k).sum() for k, name in enumerate(found.surfaces)}
    assert of["base_and_lower"] == 2
    assert sum(of.values()) == len(np.unique(np.sort(found.facets, axis=1), axis=0))
    held = {one.on: one.components for one in found.held if one.on != "base_and_lower"}
    assert {"x", "z"} == {one.components for one in found.held if one.on == "base_and_lower"}
    assert held["y0"] == "y"


def test_parts_are_moved_and_turned_and_have_sets_of_their_own(tmp_path: Path) -> None:
    """Two instances of one part are in contact with friction; sets in both have the same name."""
    cube = "\n".join(HEAD.splitlines()[2:11]) + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n"
    text = f"""*PART, NAME=CUBE
{cube}*ELSET, ELSET=SET-1, GENERATE
1,1,1
*SOLID SECTION, ELSET=SET-1, MATERIAL=STEEL
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=LOW, PART=CUBE
*END INSTANCE
*INSTANCE, NAME=HIGH, PART=CUBE
0,0,1
0,0,1,0,0,2,90.
*END INSTANCE
*NSET, NSET=FOOT, INSTANCE=LOW
1,2,3,4
*ELSET, ELSET=_UP, INSTANCE=LOW
1
*ELSET, ELSET=_DOWN, INSTANCE=HIGH
1
*SURFACE, NAME=UP, TYPE=ELEMENT
_UP,S2
*SURFACE, NAME=DOWN, TYPE=ELEMENT
_DOWN,S1
*END ASSEMBLY
*MATERIAL, NAME=STEEL
*ELASTIC
1,0.3
*SURFACE INTERACTION, NAME=RUB
1.,
*FRICTION
0.2
*CONTACT PAIR, INTERACTION=RUB
UP,DOWN
*BOUNDARY
FOOT,ENCASTRE
*STEP
*DLOAD
_DOWN,P2,3.
*END STEP
"""
    found = model(tmp_path, text)
    assert found.bodies == ["low", "high"]
    high = found.points[found.cells[found.body == 1]].reshape(-1, 3)
    assert high.min(axis=0) == pytest.approx([-1, 0, 1], abs=1e-12)  # rotated by 90° about z
    assert high.max(axis=0) == pytest.approx([0, 1, 2], abs=1e-12)
    (pair,) = found.joined
    assert (pair.primary, pair.secondary, pair.coulomb) == ("up", "down", 0.2)
    assert found.held == [Held("foot", "xyz")]
    assert any("friction 0.2" in remark for remark in found.remarks)
    assert "# coulomb = 0.2" in case_of(found, "a", "model.inp", "case.msh")


def test_forces_at_nodes_and_gravity(tmp_path: Path) -> None:
    """Nodal forces that form a face become a traction; weight is density times gravity."""
    text = REST.replace("*DSLOAD\nTOP,P,1.", "*CLOAD\n9,3,-1\n10,3,-2\n11,3,-3\n12,3,-2")
    text = text.replace("*END STEP", "*DLOAD\nEALL,GRAV,9810,0,0,-1\n*END STEP")
    found = model(tmp_path, HEAD + ONE_BODY + text)
    traction, weight = found.pushed
    assert (traction.on, traction.kind) == ("pushed_z", "traction")
    assert traction.value == pytest.approx((0, 0, -8))
    assert (weight.on, weight.kind) == ("eall", "body_force")
    assert weight.value == pytest.approx((0, 0, -9810 * 7.8e-9))


def test_collapsed_elements(tmp_path: Path) -> None:
    """A hexahedron with a repeated node is a wedge; one without volume is refused."""
    wedge = ONE_BODY.replace("1,1,2,3,4,5,6,7,8", "1,1,2,3,3,5,6,7,7")
    found = model(tmp_path, HEAD + wedge)
    edges = found.points[found.cells[:, 1:]] - found.points[found.cells[:, :1]]
    assert np.linalg.det(edges).sum() / 6 == pytest.approx(1.5)
    assert len(found.cells) == 3 + 6
    with pytest.raises(InputError, match=": 1 in all, one of them at"):
        model(
            tmp_path,
            HEAD.replace("7,1,1,1", "7,1,1,0").replace("8,0,1,1", "8,0,1,0")
            + "*ELEMENT, TYPE=C3D4\n1,1,2,3,7\n",
        )


FREECAD = """** written by FreeCAD inp file writer for CalculiX,Abaqus meshes
*Node, NSET=Nall
1, -2.22e-13, 0, 0
2, 1, 0, 0
3, 1, 1, 1.8e-12
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1

*Element, TYPE=C3D8R, ELSET=Evolumes
1, 1, 2, 3, 4, 5, 6, 7,
8

** Define element set Eall
*ELSET, ELSET=Eall
Evolumes

*ELSET,ELSET=FemMaterialSolid
Evolumes

*NSET,NSET=Fixed
1,
2,
3,
4,

*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0, STEFAN BOLTZMANN=5.670374419e-11
*MATERIAL, NAME=FemMaterial
*ELASTIC
210000,0.3
*EXPANSION, ZERO=0
0
*SOLID SECTION, ELSET=FemMaterialSolid, MATERIAL=FemMaterial
*STEP, INC=2000
*STATIC
*BOUNDARY
Fixed,1
Fixed,2
Fixed,3
*CLOAD
** node loads on shape: Box:Face2
5,3,-1.5
6,3,-0.5
7,3,-1.5
8,3,-0.5
*NODE FILE
U
*EL FILE
S, E
*NODE PRINT, NSET=Fixed, TOTALS=ONLY
RF
*OUTPUT, FREQUENCY=1
*END STEP
"""


def test_the_form_that_freecad_writes(tmp_path: Path) -> None:
    """The file has sets of sets, one member per line, and nodal forces; nothing is omitted."""
    found = model(tmp_path, FREECAD)
    assert (found.bodies, len(found.cells)) == (["femmaterialsolid"], 6)
    assert found.held == [Held("fixed", "xyz")]
    (load,) = found.pushed
    assert load.value == pytest.approx((0, 0, -4))
    assert not any("ignored" in remark for remark in found.remarks)


def test_plane_models(tmp_path: Path) -> None:
    text = HEAD.replace("5,0,0,1", "5,0,2,0").replace("6,1,0,1", "6,1,2,0")
    quads = "*ELEMENT, TYPE=CAX4, ELSET=EALL\n1,1,2,3,4\n2,4,3,6,5\n"
    found = model(tmp_path, text + quads)
    assert (found.dim, found.turned, found.bodies, len(found.cells)) == (2, True, ["eall"], 4)
    with pytest.raises(InputError, match="plane strain and plane stress"):
        model(tmp_path, text + quads.replace("CAX4", "CPS4").replace("2,4,3,6,5\n", CPE))


CPE = "*ELEMENT, TYPE=CPE4, ELSET=OTHER\n2,4,3,6,5\n"
PLANE = HEAD.replace("5,0,0,1", "5,0,2,0").replace("6,1,0,1", "6,1,2,0")
SHEET = (
    "*ELEMENT, TYPE=CPS4, ELSET=EALL\n1,1,2,3,4\n2,4,3,6,5\n*NSET, NSET=BASE\n1,2\n"
    "*NSET, NSET=TOP\n5,6\n*MATERIAL, NAME=STEEL\n*ELASTIC\n210000,0.3\n*PLASTIC\n235,0\n"
    "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL\n0.5\n*BOUNDARY\nBASE,1,2\n*STEP\n*STATIC\n"
)


def test_sheets_in_plane_stress(tmp_path: Path) -> None:
    """Nodal forces refer to the whole thickness, pressures to the area."""
    loads = "*CLOAD\n5,2,-1\n6,2,-1\n"
    found = model(tmp_path, PLANE + SHEET + loads)
    assert (found.dim, found.turned, found.thickness) == (2, False, 0.5)
    (load,) = found.pushed
    assert load.value == pytest.approx((0, -4))
    assert '[model]\nkind = "plane-stress"\nthickness = 0.5\n' in case_of(
        found, "a", "a.inp", "a.msh"
    )
    strain = model(tmp_path, PLANE + SHEET.replace("CPS4", "CPE4") + loads)
    assert strain.thickness is None
    assert strain.pushed[0].value == pytest.approx((0, -4))
    other = SHEET.replace("*BOUNDARY", "*SOLID SECTION, ELSET=BASE, MATERIAL=STEEL\n2\n*BOUNDARY")
    with pytest.raises(InputError, match=r"the thicknesses 0\.5 and 2"):
        model(tmp_path, PLANE + other + loads)


def test_beams_do_not_keep_solids_from_being_read(tmp_path: Path) -> None:
    """Omitted line elements may have another number of nodes."""
    beams = "*ELEMENT, TYPE=B31, ELSET=BEAMS\n20,9,10\n21,10\n"
    found = model(tmp_path, HEAD + ONE_BODY + beams + REST)
    assert found.bodies == ["eall"]
    assert any("B31" in remark and "ignored" in remark for remark in found.remarks)


def test_a_step_that_supports_drive(tmp_path: Path) -> None:
    """The case moves the supports, and requires no load that is missing in the file."""
    found = model(tmp_path, PLANE + SHEET + "*BOUNDARY\nTOP,2,2,-0.01\n")
    text = case_of(found, "a", "a.inp", "a.msh")
    assert 'on = "top"\ncomponents = "y"\nvalue = -0.01\nconstant = false\n' in text
    assert 'control = "displacement"' in text
    assert "[[load]]" not in text
    assert "<-" not in text


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (("BASE,3,3", "7,3,3"), "whose nodes do not form a surface"),
        (("*STATIC", "*STATIC\n*CREEP"), "*CREEP has no counterpart"),
        (("235,0", "235,0\n300,0.1"), "first yield stress 235 is used"),
        (("*STATIC", "*STATIC\n*DLOAD\nEALL,GRAV,1,0,0,-1\n*DENSITY\n1"), None),
    ],
)
def test_what_has_no_counterpart_is_said(
    tmp_path: Path, change: tuple[str, str], named: str | None
) -> None:
    found = model(tmp_path, HEAD + ONE_BODY + REST.replace(*change))
    assert named is None or any(named in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "no keywords"),
        ("hello\n", "before the first keyword"),
        ("\0\0\0", "not text"),
        ("*NODE\n1,0,0,0\n", "no solid elements"),
        ("*NODE\n1,0,0,nan\n*ELEMENT,TYPE=C3D4\n1,1,1,1,1\n", "are not finite numbers"),
        (HEAD + "*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7\n", "cut off or damaged"),
        (
            HEAD + "*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,99\n",
            "no node of the model with the number 99",
        ),
        (HEAD + "*ELEMENT, TYPE=C3D8\n1,1,2,x,4,5,6,7,8\n", "an entry that is not"),
        (HEAD + "*ELEMENT, TYPE=S4\n1,1,2,3,4\n", "shells"),
        (HEAD + ONE_BODY + "*INCLUDE, INPUT=/etc/passwd\n", "outside the folder of the model"),
        (HEAD + ONE_BODY + "*INCLUDE, INPUT=model.inp\n", "in a cycle"),
        (HEAD + ONE_BODY + "*INCLUDE, INPUT=missing.inp\n", "cannot be read"),
        (HEAD + ONE_BODY + REST.replace("TOP,P,1.", "TOP,P,much"), "'much'"),
        (HEAD + ONE_BODY + "*ELASTIC\n1,0.3\n", "belongs to no *MATERIAL"),
        (HEAD + ONE_BODY + REST.replace("BASE,3,3", "ONE,3,3"), "*BOUNDARY refers to 'ONE'"),
        (HEAD + ONE_BODY + REST.replace("BASE,3,3", "77,3,3"), "*BOUNDARY refers to '77'"),
        (HEAD + ONE_BODY + REST.replace("TOP,P,1.", "SIDE,P,1."), "*DSLOAD refers to 'SIDE'"),
        (HEAD + ONE_BODY + REST.replace("2,S2", "LID,S2"), "*SURFACE 'TOP' refers to 'LID'"),
        (HEAD + ONE_BODY + REST + "*TIE\nTOP,LID\n", "*TIE refers to 'LID'"),
        (HEAD + ONE_BODY + REST.replace("*DSLOAD\nTOP,P", "*DLOAD\nLID,P1"), "P1 refers to 'LID'"),
        (
            HEAD + ONE_BODY + REST.replace("*DSLOAD\nTOP,P", "*CLOAD\nLID,1"),
            "*CLOAD refers to 'LID'",
        ),
    ],
)
def test_broken_files_are_one_sentence(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(InputError, match=named.replace("*", r"\*")):
        model(tmp_path, text)
