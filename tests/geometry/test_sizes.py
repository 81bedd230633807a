"""Test element sizes that the program chooses: smaller ones where gmsh fails."""

import math
from collections.abc import Callable
from pathlib import Path

import gmsh
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, mesh_geometry
from perfplast_fenicsx.mesh import gmsh_session

pytestmark = pytest.mark.serial

Made = Callable[[Callable[[], None]], Path]


@pytest.fixture
def made(tmp_path: Path) -> Made:
    """Write a geometry."""

    def write(make: Callable[[], None]) -> Path:
        path = tmp_path / "body.brep"
        with gmsh_session():
            make()
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
        return path

    return write


def tube() -> None:
    """Return a thin tube, whose inner and outer polygons cross each other on a coarse mesh."""
    occ = gmsh.model.occ
    outer, inner = (
        occ.addCylinder(0, 0, 0, 0, 0, 300, 10),
        occ.addCylinder(0, 0, -1, 0, 0, 302, 9.8),
    )
    occ.rotate([(3, inner)], 0, 0, 0, 0, 0, 1, math.pi / 9)
    occ.cut([(3, outer)], [(3, inner)])


@pytest.mark.long
def test_where_faces_cross_on_a_coarse_mesh_a_finer_one_is_made(made: Made, tmp_path: Path) -> None:
    """A given size remains, and the refusal names a remedy."""
    path = made(tube)
    found = mesh_geometry(path, tmp_path / "body.msh")
    assert found.bodies[0].worst > 0
    assert found.size > 1.0
    with pytest.raises(InputError, match=r"cannot be meshed: .*or give another size"):
        mesh_geometry(path, tmp_path / "body.msh", MeshingOptions(size=8.0, curvature=10.0))
