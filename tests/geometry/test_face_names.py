"""Test faces of the drawing: separate names, common names, and names that a user gives."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import read_gmsh
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions
from perfplast_fenicsx.geometry.meshing_options import NamedFace
from tests.geometry.files import pin_in_plate, survey_of, write

pytestmark = pytest.mark.serial


def named(folder: Path, *faces: NamedFace) -> dict[str, list[int]]:
    """Name free faces of the plate with a pin, and return the face numbers of each name."""
    step, mesh = write(folder / "pin.step", pin_in_plate), folder / "named.msh"
    found = survey_of(step, mesh, MeshingOptions(size=12.0, curvature=8.0, face=list(faces)))
    named = {face.name for face in found.faces} | {one.name for one in found.sets}
    assert named < set(read_gmsh(MPI.COMM_WORLD, mesh).surfaces)
    return {one.name: [face.number for face in found.faces_of(one.name)] for one in faces}


def test_by_plane_point_and_number(shared_tmp_path: Path) -> None:
    faces = named(
        shared_tmp_path,
        NamedFace("bottom", plane={"z": 0.0}),
        NamedFace("lid", point=[15.0, 0.0, 8.0]),
        NamedFace("second", number=2),
        NamedFace("end", plane={"x": -10.0}, body="part_1"),
    )
    assert {name: len(numbers) for name, numbers in faces.items()} == {
        **{"bottom": 3, "lid": 1},  # the pin, the plate and the separate block
        **{"second": 1, "end": 1},
    }
    assert faces["second"] == [2]


@pytest.mark.parametrize(
    ("face", "says"),
    [
        (NamedFace("a", plane={"z": 8.5}), r"in the plane z = 8.5; the nearest is .*, 0.5 away"),
        (NamedFace("a", plane={"z": 8.0}, body="part_2"), "'part_2' lies in the plane z = 8"),
        (NamedFace("a", plane={"z": 8.0}, body="part_5"), "no such body; did you mean 'part_"),
        (NamedFace("a", point=[20.0, 0.0, 8.0]), "give a point inside one face"),
        (NamedFace("a", point=[9e3, 0.0, 0.0]), r"no free face lies at \(9000, 0, 0\)"),
        (NamedFace("a", radius=5.0), "no free face lies with the radius 5"),
        (NamedFace("a", number=99), "number 99, but no free face"),
        (NamedFace("a", box=[[90.0, 0.0], [99.0, 1.0]]), "within the box .*; the nearest is"),
        (NamedFace("a", label="lid"), "the label 'lid'"),
        (NamedFace("a", faces=["part_1_x_lo"]), "did you mean 'part_1_x_low'"),
    ],
)
def test_no_such_face(shared_tmp_path: Path, face: NamedFace, says: str) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    with pytest.raises(InputError, match=says):
        survey_of(step, shared_tmp_path / "out.msh", MeshingOptions(face=[face]))
    assert not (shared_tmp_path / "out.msh").exists()


PLATE = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 4, 2};
Disk(2) = {1, 1, 0, 0.5};
Disk(3) = {3, 1, 0, 0.5};
BooleanDifference{ Surface{1}; Delete; }{ Surface{2, 3}; Delete; }
"""


def test_holes_by_radius(shared_tmp_path: Path) -> None:
    source, mesh = shared_tmp_path / "plate.geo", shared_tmp_path / "plate.msh"
    if MPI.COMM_WORLD.rank == 0:
        source.write_text(PLATE)
    MPI.COMM_WORLD.barrier()
    faces = [NamedFace("hole", radius=0.5, about=[3.0, 1.0]), NamedFace("top", plane={"y": 2.0})]
    survey = survey_of(source, mesh, MeshingOptions(face=faces))
    (hole,), (top,) = survey.faces_of("hole"), survey.faces_of("top")
    assert hole.centre == pytest.approx([3.0, 1.0, 0.0], abs=0.05)
    assert hole.shape == "round"
    assert top.area == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({}, "has no selection"),
        ({"number": 1, "point": [0.0, 0.0]}, "has point and number"),
        ({"plane": {"w": 1.0}}, "'w' is not a coordinate"),
        ({"plane": {"x": 1.0, "y": 1.0}}, "has 2 coordinates"),
        ({"point": [1.0]}, "is not a point"),
        ({"radius": -1.0}, "is not positive"),
        ({"number": 1, "about": [0.0, 0.0]}, "no key 'radius'"),
        ({"number": 1, "angle": 20.0}, "the key 'point'"),
        ({"point": [0.0, 0.0], "angle": 90.0}, "between 0 and 90 degrees"),
        ({"box": [[0.0, 0.0]]}, "has 1 corners"),
        ({"box": [[0.0, 0.0], [1.0]]}, "corner 2 of box = .* is not a point"),
        ({"faces": []}, "is empty"),
    ],
)
def test_choices(keys: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        NamedFace("a", **keys)  # type: ignore[arg-type]
