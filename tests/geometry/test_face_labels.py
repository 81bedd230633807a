"""Test faces of STEP files that have a separate label."""

import re
from collections.abc import Callable
from pathlib import Path

import gmsh
import pytest

from perfplast_fenicsx.geometry import MeshingOptions, Survey
from perfplast_fenicsx.geometry.face_labels import labels_of, names_in, read_solids
from perfplast_fenicsx.geometry.parts import read_parts
from perfplast_fenicsx.mesh import gmsh_session
from tests.geometry.files import survey_of, write
from tests.geometry.test_face_colours import HIGH_X, HIGH_Z, LOW_X, LOW_Z, RED, painted, two_boxes

pytestmark = pytest.mark.serial


def labelled(path: Path, labels: dict[int, str]) -> Path:
    """Give faces of a STEP file labels, as CAD systems write them."""
    pieces = re.split(r"(?<=ADVANCED_FACE\()'[^']*'", path.read_text())
    names = [f"'{labels.get(k, 'NONE')}'" for k in range(len(pieces) - 1)]
    joined = [piece + name for piece, name in zip(pieces, [*names, ""], strict=True)]
    path.write_text("".join(joined))
    return path


def surveyed(
    folder: Path, make: Callable[[], None], labels: dict[int, str], **options: object
) -> Survey:
    """Return bodies whose faces have labels."""
    step = labelled(write(folder / "bodies.step", make), labels)
    chosen = MeshingOptions(size=2.0, **options)  # type: ignore[arg-type]
    return survey_of(step, folder / "bodies.msh", chosen)


@pytest.mark.parametrize("options", [{}, {"meshed": "apart"}, {"symmetry": {"y": 2.0}}])
def test_they_are_names_and_what_is_cut_off_too(
    shared_tmp_path: Path, options: dict[str, object]
) -> None:
    labels = {LOW_X: "pressed face", HIGH_Z: "It''s on \\X2\\00FC\\X0\\ (top); #9=", LOW_Z: "foot"}
    labels |= {6 + HIGH_X: "pressed face", 6 + HIGH_Z: "lid"}
    survey = surveyed(shared_tmp_path, two_boxes, labels, **options)
    half = 2 if "symmetry" in options else 1
    plate, block = (body.name for body in survey.bodies)
    found = {face.name: face for face in survey.faces}
    for name, area, axis, place in (
        (f"{plate}_pressed_face", 4, 0, 0.0),
        (f"{plate}_it_s_on_top_9", 20, 2, 1.0),
        (f"{plate}_foot", 40, 2, 0.0),
        (f"{block}_pressed_face", 16, 0, 5.0),
        (f"{block}_lid", 20, 2, 5.0),
    ):
        assert found[name].area == pytest.approx(area / half)
        assert found[name].centre[axis] == pytest.approx(place)
    assert found[f"{plate}_it_s_on_top_9"].shape == "flat, 'It's on ü (top); #9='"
    assert not any("label" in remark for remark in survey.remarks)


def drilled() -> None:
    """Return a block with a bore, whose faces have different kinds."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 4, 3, 2))], [(3, occ.addCylinder(1, 1, -1, 0, 0, 4, 0.5))])


def test_faces_of_one_label_are_one_surface(shared_tmp_path: Path) -> None:
    survey = surveyed(shared_tmp_path, drilled, {1: "held", 3: "held", 6: "bore"})
    (held,) = (one for one in survey.sets if one.name.endswith("_held"))
    assert (len(held.faces), held.why) == (2, "label 'held'")
    assert held.area == pytest.approx(2 * 4 * 2)  # at y = 0 and y = 3
    (bore,) = (face for face in survey.faces if face.name.endswith("_bore"))
    assert bore.shape == "cylindrical, 'bore'"
    assert bore.round_of == "bore, R 0.5, along z"


def test_a_label_goes_before_a_colour(shared_tmp_path: Path) -> None:
    step = labelled(write(shared_tmp_path / "box.step", drilled), {0: "held", 1: "held"})
    survey = survey_of(painted(step, {1: RED, 2: RED}), shared_tmp_path / "box.msh")
    (held,) = (one for one in survey.sets if one.name.endswith("_held"))
    assert len(held.faces) == 2
    (red,) = (face for face in survey.faces if face.name.endswith("_red"))
    assert red.number not in held.faces


def twice() -> None:
    """Return two equal blocks."""
    for x in (0, 9):
        gmsh.model.occ.addBox(x, 0, 0, 3, 2, 1)


def test_equal_bodies_where_they_are_drawn(shared_tmp_path: Path) -> None:
    survey = surveyed(shared_tmp_path, twice, {LOW_X: "left", 6 + HIGH_X: "right"})
    found = {face.name.rpartition("_")[2]: face.centre[0] for face in survey.faces}
    assert (found["left"], found["right"]) == pytest.approx((0.0, 12.0))


def test_equal_bodies_that_are_moved_are_not_told_apart(shared_tmp_path: Path) -> None:
    step = labelled(write(shared_tmp_path / "bodies.step", twice), {LOW_X: "left", 6: "right"})
    text = step.read_text()
    place = re.findall(r"ITEM_DEFINED_TRANSFORMATION\('[^']*','[^']*',#\d+,#(\d+)\)", text)[-1]
    point = re.findall(rf"#{place} = AXIS2_PLACEMENT_3D\('',#(\d+)", text)[0]
    moved = re.sub(rf"(#{point} = CARTESIAN_POINT\('',)\([^)]*\)", r"\1(0.,7.,0.)", text)
    assert moved != text
    step.write_text(moved)
    survey = survey_of(step, shared_tmp_path / "bodies.msh")
    assert max(body.high[1] for body in survey.bodies) == pytest.approx(9.0)
    assert not any(face.name.endswith(("left", "right")) for face in survey.faces)
    (left_out,) = (remark for remark in survey.remarks if "labels of faces" in remark)
    assert left_out.endswith("uncertain: 'left', 'right'")


def test_instances_have_them_each(shared_tmp_path: Path) -> None:
    step = labelled(write(shared_tmp_path / "bodies.step", twice), {LOW_X: "left", 6: "left"})
    text = step.read_text()
    place = re.findall(r"ITEM_DEFINED_TRANSFORMATION\('[^']*','[^']*',#\d+,#(\d+)\)", text)[-1]
    (across,) = re.findall(rf"#{place} = AXIS2_PLACEMENT_3D\('',#\d+,#\d+,(#\d+)", text)
    step.write_text(re.sub(rf"({across} = DIRECTION\('',)\([^)]*\)", r"\1(0.,1.,0.)", text))
    survey = survey_of(step, shared_tmp_path / "bodies.msh")
    left = sorted(face.centre for face in survey.faces if face.name.endswith("_left"))
    assert left == [pytest.approx((-1.0, 9.0, 0.5)), pytest.approx((0.0, 1.0, 0.5))]  # turned


def test_the_order_is_the_shells(shared_tmp_path: Path) -> None:
    step = labelled(write(shared_tmp_path / "box.step", drilled), {0: "left"})
    solids, in_place = read_solids(step)
    assert in_place
    assert solids[0].labels == ("left", *6 * ("NONE",))
    step.write_text(
        re.sub(
            r"CLOSED_SHELL\('',\((#\d+),(.*?)\)",
            r"CLOSED_SHELL('',(\2,\1)",
            step.read_text(),
            flags=re.DOTALL,
        )
    )
    survey = survey_of(step, shared_tmp_path / "box.msh")
    (left,) = (face for face in survey.faces if face.name.endswith("_left"))
    assert left.centre[0] == pytest.approx(0.0)


@pytest.mark.parametrize("moved", [True, False])
def test_another_order_than_gmsh_has_is_noticed(shared_tmp_path: Path, moved: bool) -> None:
    step = labelled(write(shared_tmp_path / "box.step", drilled), {0: "left"})
    other = shared_tmp_path / "other.step"
    text = re.sub(
        r"CLOSED_SHELL\('',\((#\d+),(.*?)\)",
        r"CLOSED_SHELL('',(\2,\1)",
        step.read_text(),
        flags=re.DOTALL,
    )
    at = text.rindex("ENDSEC;")
    other.write_text(text[:at] + moved * "#9999=MAPPED_ITEM('',#1,#2);" + text[at:])
    assert read_solids(other)[1] is not moved
    with gmsh_session():
        parts = read_parts(step).parts
        assert list(labels_of(step, parts)[0].values()) == ["left"]
        found, remarks = labels_of(other, parts)
    assert not found
    assert "'left'" in remarks[0]


@pytest.mark.parametrize("cut", [r"VERTEX_POINT", r"CLOSED_SHELL", r"'", r"#\d+,"])
def test_text_that_is_not_understood(shared_tmp_path: Path, cut: str) -> None:
    step = labelled(write(shared_tmp_path / "box.step", drilled), {0: "left"})
    for count in (1, 3, 0):
        step.write_text(re.sub(cut, "", step.read_text(), count=count))
        read_solids(step)


def test_labels_that_name_nothing() -> None:
    assert names_in(["NONE", "", "Face 12", "#12", "F3", "lid"]) == {"lid"}
    assert names_in(["lid", "lid"]) == set()
