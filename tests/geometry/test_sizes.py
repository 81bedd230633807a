"""Sizes of the program's own: few elements on fine features, and others where gmsh fails."""

import math
from collections.abc import Callable
from pathlib import Path

import gmsh
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, mesh_geometry
from perfplast_fenicsx.geometry.first_loading import ADAPTED
from perfplast_fenicsx.mesh import gmsh_session

pytestmark = pytest.mark.serial

Made = Callable[[Callable[[], None]], Path]


@pytest.fixture
def made(tmp_path: Path) -> Made:
    """Writes a geometry."""

    def write(make: Callable[[], None]) -> Path:
        path = tmp_path / "body.brep"
        with gmsh_session():
            make()
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
        return path

    return write


def pierced() -> None:
    """A plate of 100 by 100 by 12 with 64 holes of radius 0.8: by 10 elements about each 43 000."""
    occ = gmsh.model.occ
    plate = occ.addBox(0, 0, 0, 100, 100, 12)
    places = [(12 * i + 8, 12 * j + 8) for i in range(8) for j in range(8)]
    holes = [(3, occ.addCylinder(x, y, -1, 0, 0, 14, 0.8)) for x, y in places]
    occ.cut([(3, plate)], holes)


def tube() -> None:
    """A thin one, whose inner and outer polygons cross each other on a coarse mesh."""
    occ = gmsh.model.occ
    outer, inner = (
        occ.addCylinder(0, 0, 0, 0, 0, 300, 10),
        occ.addCylinder(0, 0, -1, 0, 0, 302, 9.8),
    )
    occ.rotate([(3, inner)], 0, 0, 0, 0, 0, 1, math.pi / 9)
    occ.cut([(3, outer)], [(3, inner)])


def test_small_holes_do_not_take_all_elements(made: Made, tmp_path: Path) -> None:
    found = mesh_geometry(made(pierced), tmp_path / "body.msh")
    assert sum(body.cells for body in found.bodies) <= ADAPTED[3]
    assert found.bodies[0].volume == pytest.approx(found.bodies[0].cad, rel=0.01)


def test_where_faces_cross_on_a_coarse_mesh_a_finer_one_is_made(made: Made, tmp_path: Path) -> None:
    """A size that is given is kept, and the refusal says what to do."""
    path = made(tube)
    found = mesh_geometry(path, tmp_path / "body.msh")
    assert found.bodies[0].worst > 0
    assert found.size > 1.0
    with pytest.raises(InputError, match=r"cannot be meshed: .*or give another size"):
        mesh_geometry(path, tmp_path / "body.msh", MeshingOptions(size=8.0, curvature=10.0))
