"""Test element sizes that the program chooses: smaller ones where gmsh fails."""

import math
from collections.abc import Callable
from pathlib import Path

import gmsh
import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, Survey, mesh_geometry
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


BOX = 'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\n'


@pytest.fixture
def from_script(tmp_path: Path) -> Callable[..., Survey]:
    """Mesh a box by a script with some more lines."""

    def meshed(lines: str, **options: float) -> Survey:
        path = tmp_path / "box.geo"
        path.write_text(BOX + lines)
        return mesh_geometry(path, tmp_path / "box.msh", MeshingOptions(**options), trust=True)

    return meshed


def cells(found: Survey) -> int:
    """Return the number of elements."""
    return sum(body.cells for body in found.bodies)


def test_sizes_in_a_script_apply(from_script: Callable[..., Survey]) -> None:
    """A larger smallest size or a factor also counts."""
    plain = from_script("Mesh.MeshSizeMax = 0.25;\n")
    assert plain.size == pytest.approx(0.25)
    assert not plain.remarks
    assert cells(plain) == cells(from_script("", size=0.25))
    finer = from_script("Mesh.MeshSizeMax = 0.25;\nMesh.MeshSizeFactor = 0.7;\n")
    assert finer.size == pytest.approx(0.7 * 0.25)
    assert cells(finer) > 1.5 * cells(plain)


def test_a_factor_in_a_script_counts_once_on_arcs(tmp_path: Path) -> None:
    """Arcs are refined until areas are accurate, to the same lengths with and without a factor."""
    counts = []
    for lines in (
        "Mesh.MeshSizeMax = 0.5;\n",
        "Mesh.MeshSizeMax = 0.25;\nMesh.MeshSizeFactor = 2;\n",
    ):
        path = tmp_path / "hole.geo"
        hole = "Cylinder(2) = {0.5, 0.5, 0, 0, 0, 1, 0.3};\n"
        cut = "BooleanDifference{ Volume{1}; Delete; }{ Volume{2}; Delete; }\n"
        path.write_text(BOX + hole + cut + lines)
        counts.append(cells(mesh_geometry(path, tmp_path / "hole.msh", trust=True)))
    assert counts[1] == pytest.approx(counts[0], rel=0.05)


def test_a_given_size_replaces_those_in_a_script(from_script: Callable[..., Survey]) -> None:
    found = from_script("Mesh.MeshSizeMax = 0.5;\nMesh.MeshSizeFactor = 3;\n", size=0.25)
    assert cells(found) == cells(from_script("", size=0.25))
    (remark,) = found.remarks
    assert "Mesh.MeshSizeMax = 0.5 (size = 0.25 is given)" in remark
    assert "Mesh.MeshSizeFactor = 3" in remark


def test_options_that_a_script_may_not_set(from_script: Callable[..., Survey]) -> None:
    found = from_script("Mesh.Algorithm = 5;\nMesh.ElementOrder = 2;\n", size=0.5)
    (remark,) = found.remarks
    assert "Mesh.Algorithm = 5 (the program tries" in remark
    assert "Mesh.ElementOrder = 2 (order = 1" in remark
    assert found.degree == 1
    assert from_script("Mesh.ElementOrder = 2;\n", size=0.5, order=2).remarks == []


def test_elements_around_a_small_hole_do_not_depend_on_the_unit(made: Made, tmp_path: Path) -> None:
    """Elements of a fifth of the largest size surround it in any unit.

    The test counts nodes on both rims, which the sizes determine. Counts of tetrahedra inside
    differ by a tenth or more between units and versions of gmsh: its tolerances have units.
    """
    counts = []
    for unit in (1.0, 1000.0):

        def plate(unit: float = unit) -> None:
            occ = gmsh.model.occ
            block = occ.addBox(0, 0, 0, unit, unit, 0.5 * unit)
            hole = occ.addCylinder(0.5 * unit, 0.5 * unit, 0, 0, 0, 0.5 * unit, 0.05 * unit)
            occ.cut([(3, block)], [(3, hole)])

        output = tmp_path / "body.msh"
        mesh_geometry(made(plate), output, MeshingOptions(size=0.5 * unit))
        with gmsh_session():
            gmsh.open(str(output))
            nodes = gmsh.model.mesh.getNodes()[1].reshape(-1, 3) / unit
        radius = np.hypot(nodes[:, 0] - 0.5, nodes[:, 1] - 0.5)
        for z in (0.0, 0.5):
            rim = (abs(radius - 0.05) < 1e-6) & (abs(nodes[:, 2] - z) < 1e-6)
            counts.append(int(np.count_nonzero(rim)))
    assert min(counts) >= 20
    assert max(counts) <= min(counts) + 2
