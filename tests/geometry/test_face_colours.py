"""Test faces of STEP files that have a separate colour."""

import re
from pathlib import Path

import gmsh
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, Survey
from perfplast_fenicsx.geometry.face_labels import hex_of, word_of
from perfplast_fenicsx.geometry.meshing_options import NamedFace
from tests.geometry.files import survey_of, write

pytestmark = pytest.mark.serial

RED, BLUE = (1.0, 0.0, 0.0), (0.2, 0.2, 0.8)
LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = range(6)
"""Faces of a box in the order of gmsh and of its STEP files."""

STYLE = """\
#{0}=COLOUR_RGB('',{1[0]},{1[1]},{1[2]});
#{0}1=FILL_AREA_STYLE_COLOUR('',#{0});
#{0}2=FILL_AREA_STYLE('',(#{0}1));
#{0}3=SURFACE_STYLE_FILL_AREA(#{0}2);
#{0}4=SURFACE_SIDE_STYLE('',(#{0}3));
#{0}5=SURFACE_STYLE_USAGE(.BOTH.,#{0}4);
#{0}6=PRESENTATION_STYLE_ASSIGNMENT((#{0}5));
#{0}7=STYLED_ITEM('color',(#{0}6),#{2});
#{0}8=MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#{0}7),#{3});
"""


def painted(path: Path, colours: dict[int, tuple[float, float, float]]) -> Path:
    """Give faces of a STEP file colours, as CAD systems write them."""
    text = path.read_text()
    faces = re.findall(r"#(\d+) = ADVANCED_FACE", text)
    (context, *_) = re.findall(r"#(\d+) = \( GEOMETRIC_REPRESENTATION_CONTEXT\(3\)", text)
    styles = "".join(
        STYLE.format(9000 + face, colour, faces[face], context) for face, colour in colours.items()
    )
    at = text.rindex("ENDSEC;")
    path.write_text(text[:at] + styles + text[at:])
    return path


def two_boxes() -> None:
    """Return a plate, and a block on a part of the plate."""
    gmsh.model.occ.addBox(0, 0, 0, 10, 4, 1)
    gmsh.model.occ.addBox(0, 0, 1, 5, 4, 4)


def found(folder: Path, *faces: NamedFace, **options: object) -> Survey:
    """Return the two boxes; some painted faces are cut, and others are not."""
    colours = {LOW_X: RED, HIGH_Z: BLUE, LOW_Z: BLUE, 6 + HIGH_X: RED}
    step = painted(write(folder / "boxes.step", two_boxes), colours)
    chosen = MeshingOptions(size=2.0, face=list(faces), **options)  # type: ignore[arg-type]
    return survey_of(step, folder / "boxes.msh", chosen)


@pytest.mark.parametrize("options", [{}, {"meshed": "apart"}, {"symmetry": {"y": 2.0}}])
def test_they_have_its_name_and_what_is_cut_off_too(
    shared_tmp_path: Path, options: dict[str, object]
) -> None:
    survey = found(shared_tmp_path, **options)
    half = 2 if "symmetry" in options else 1
    areas = {face.name: face.area for face in survey.faces}
    areas |= {one.name: one.area for one in survey.sets}
    plate, block = (body.name for body in survey.bodies)
    assert areas[f"{plate}_red"] == pytest.approx(4 / half)
    assert areas[f"{plate}_blue"] == pytest.approx((40 + 20) / half)  # below, free on top
    assert areas[f"{block}_red"] == pytest.approx(16 / half)
    assert sum("red" in face.shape or "blue" in face.shape for face in survey.faces) == 4
    total = sum(face.area for face in survey.faces)
    ends = 2 * (10 + 4) * 1 + 2 * 40 + 2 * (5 + 4) * 4 + 2 * 20 - 2 * 20
    if half == 1:
        assert total == pytest.approx(ends)


def test_they_are_chosen_by_it(shared_tmp_path: Path) -> None:
    survey = found(
        shared_tmp_path, NamedFace("held", colour="red"), NamedFace("b", colour="#3333cc")
    )
    assert (len(survey.faces_of("held")), len(survey.faces_of("b"))) == (2, 2)


def test_a_colour_that_there_is_not(shared_tmp_path: Path) -> None:
    with pytest.raises(InputError, match="are blue #3333cc, red #ff0000"):
        found(shared_tmp_path, NamedFace("held", colour="green"))


def test_a_body_of_one_colour_is_not_marked(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "box.step", lambda: gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1))
    survey = survey_of(painted(step, dict.fromkeys(range(6), RED)), shared_tmp_path / "box.msh")
    assert len(survey.faces) == 6
    assert not any("red" in face.name for face in survey.faces)


def test_words() -> None:
    assert [word_of(c) for c in ((221, 82, 40), (59, 97, 180), (225, 225, 225))] == [
        *("red", "blue", "white")
    ]
    assert hex_of((221, 82, 40)) == "#dd5228"
