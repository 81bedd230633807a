"""Test that bodies can slide along cylindrical joints, whose facets lie along the axis."""

from collections.abc import Callable
from pathlib import Path

import gmsh
import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry import MeshingOptions, Survey, mesh_geometry
from perfplast_fenicsx.mesh import gmsh_session

pytestmark = pytest.mark.serial

Sleeve = Callable[[Callable[[], None]], tuple[Survey, Floats]]


@pytest.fixture
def sleeve(tmp_path: Path) -> Sleeve:
    """Mesh a geometry; return its survey, and the normals of the facets of the first joint."""

    def meshed(make: Callable[[], None], **options: float) -> tuple[Survey, Floats]:
        path, mesh = tmp_path / "bodies.step", tmp_path / "bodies.msh"
        with gmsh_session():
            make()
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
        survey = mesh_geometry(path, mesh, MeshingOptions(**options))
        with gmsh_session():
            gmsh.open(str(mesh))
            return survey, _normals(survey.joints[0].surfaces[0])

    return meshed


def _normals(name: str) -> Floats:
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    group = next(
        g for _, g in gmsh.model.getPhysicalGroups(2) if gmsh.model.getPhysicalName(2, g) == name
    )
    corners = np.concatenate(
        [
            gmsh.model.mesh.getElements(2, entity)[2][0].reshape(-1, 3)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(2, group)
        ]
    )
    x = points.reshape(-1, 3)[order[np.searchsorted(tags[order], corners)]]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return np.asarray(normals / np.linalg.norm(normals, axis=1)[:, None])


def rod_and_nut(turn: float = 0.0, height: float = 3.0) -> None:
    """Return a rod of radius 5 along z, in the bore of a block of some height."""
    occ = gmsh.model.occ
    occ.addCylinder(0, 0, -10, 0, 0, 26, 5)
    block, hole = occ.addBox(-9, -9, 0, 18, 18, height), occ.addCylinder(0, 0, -10, 0, 0, 26, 5)
    occ.rotate([(3, hole)], 0, 0, 0, 0, 0, 1, turn)
    occ.cut([(3, block)], [(3, hole)])


def in_halves(turn: float) -> None:
    """Return the same bodies, each with two half cylinders, as many CAD systems write them."""
    occ = gmsh.model.occ
    tags = []
    for begin, angle in ((0.0, 0.0), (-10.0, turn)):
        quarter = [
            occ.addCylinder(0, 0, begin, 0, 0, 3 if not begin else 26, 5, angle=np.pi)
            for _ in range(2)
        ]
        occ.rotate([(3, quarter[1])], 0, 0, 0, 0, 0, 1, np.pi)
        occ.rotate([(3, tag) for tag in quarter], 0, 0, 0, 0, 0, 1, angle)
        tags.append(quarter)
    block = occ.addBox(-9, -9, 0, 18, 18, 3)
    occ.cut([(3, block)], [(3, tag) for tag in tags[0]])
    occ.fuse([(3, tags[1][0])], [(3, tags[1][1])])


@pytest.mark.parametrize("turn", [0.0, 0.7, 3.0])
@pytest.mark.parametrize("make", [rod_and_nut, in_halves])
def test_facets_lie_along_the_axis(
    sleeve: Sleeve, make: Callable[[float], None], turn: float
) -> None:
    """Seams at different angles on both bodies divide the circle unequally."""
    survey, normals = sleeve(lambda: make(turn))
    assert survey.joints[0].shapes == ("cylindrical",)
    assert np.abs(normals[:, 2]).max() < 1e-9
    around = np.unique(np.round(np.degrees(np.arctan2(normals[:, 1], normals[:, 0])), 3))
    assert 8 <= len(around) <= 24
    assert survey.joints[0].area == pytest.approx(2 * np.pi * 5 * 3, rel=0.02)
    assert min(body.worst for body in survey.bodies) > 0.05
    for body in survey.bodies:
        assert body.volume == pytest.approx(body.cad, rel=0.05)


def test_an_oblique_axis_and_many_rows(sleeve: Sleeve) -> None:
    axis = np.array([1.0, 2.0, 2.0]) / 3

    def make() -> None:
        rod_and_nut(0.3, height=12.0)
        everything = gmsh.model.occ.getEntities(3)
        turn = np.arccos(axis[2])
        gmsh.model.occ.rotate(everything, 0, 0, 0, *np.cross([0, 0, 1], axis), turn)
        gmsh.model.occ.translate(everything, 100, 20, -30)

    _, normals = sleeve(make, curvature=16.0)
    assert np.abs(normals @ axis).max() < 1e-9
    assert len(normals) >= 2 * 16 * 2


def test_the_body_with_the_bore_has_a_name(sleeve: Sleeve) -> None:
    survey, _ = sleeve(rod_and_nut)
    block = max(survey.bodies, key=lambda body: body.high[0])
    assert survey.joints[0].bore == block.name


def test_a_joint_that_is_no_rectangle_is_meshed_otherwise(sleeve: Sleeve) -> None:
    """The end of the block is oblique, so its bore is no rectangle when unrolled."""

    def make() -> None:
        rod_and_nut(height=8.0)
        occ = gmsh.model.occ
        wedge = occ.addBox(-20, -20, 5, 40, 40, 20)
        occ.rotate([(3, wedge)], 0, 0, 5, 0, 1, 0, 0.3)
        block = max(occ.getEntities(3)[:-1], key=lambda one: occ.getBoundingBox(*one)[3])
        occ.cut([block], [(3, wedge)])

    survey, normals = sleeve(make)
    assert 1e-3 < np.abs(normals[:, 2]).max() < 0.5
    assert len(survey.bodies) == 2
