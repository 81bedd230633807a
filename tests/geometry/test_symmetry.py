"""Test halves of symmetric bodies."""

from pathlib import Path

import gmsh
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions
from tests.geometry.files import survey_of, write

pytestmark = pytest.mark.serial


def mirrored() -> None:
    """Return a plate, a pin in its middle, and a block at each end."""
    occ = gmsh.model.occ
    plate, hole = occ.addBox(-10, -5, 0, 20, 10, 2), occ.addCylinder(0, 0, 0, 0, 0, 2, 2)
    occ.cut([(3, plate)], [(3, hole)])
    occ.addCylinder(0, 0, 0, 0, 0, 2, 2)
    occ.addBox(-10, -5, 2, 4, 10, 4)
    occ.addBox(6, -5, 2, 4, 10, 4)


def test_a_quarter(shared_tmp_path: Path) -> None:
    step, mesh = write(shared_tmp_path / "a.step", mirrored), shared_tmp_path / "a.msh"
    options = MeshingOptions(size=4.0, curvature=20.0, symmetry={"x": 0.0, "y": 0.0})
    found = survey_of(step, mesh, options)
    assert [body.name for body in found.bodies] == ["part_1", "part_2", "part_4"]
    assert found.bodies[2].volume == pytest.approx(80)
    assert sum(body.volume for body in found.bodies) == pytest.approx(100 + 80)
    cut = found.faces_of("symmetry_y")
    assert {face.body for face in cut} == {"part_1", "part_2", "part_4"}
    assert sum(face.area for face in cut) == pytest.approx(20 + 16)
    assert {joint.bodies for joint in found.joints} == {("part_1", "part_2"), ("part_1", "part_4")}


@pytest.mark.parametrize(
    ("plane", "says"),
    [
        ({"x": 1.0}, "not symmetric about x = 1: their centre is at x = "),
        ({"z": 1.0}, "not symmetric about z = 1"),
        ({"x": 30.0}, "bodies, which reach from -10 to 10"),
    ],
)
def test_no_symmetry(shared_tmp_path: Path, plane: dict[str, float], says: str) -> None:
    step = write(shared_tmp_path / "a.step", mirrored)
    with pytest.raises(InputError, match=says):
        survey_of(step, shared_tmp_path / "a.msh", MeshingOptions(symmetry=plane))
    assert not (shared_tmp_path / "a.msh").exists()
