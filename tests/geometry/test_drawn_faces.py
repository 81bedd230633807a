"""Test that each face of a drawing is a mesh surface: imprints, pads, feet, bores.

Areas in the file come from OpenCASCADE. The test compares areas of the mesh to 1e-9 for flat faces
with straight edges, and to the error of polygons for other faces.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import gmsh
import numpy as np
import numpy.typing as npt
import pytest
from dolfinx import fem

from perfplast_fenicsx import Pressure, TaggedMesh, Traction, read_gmsh
from perfplast_fenicsx.cli.understood import understood
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, Survey
from perfplast_fenicsx.geometry.mesher import mesh_file
from perfplast_fenicsx.geometry.meshing_options import NamedFace
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.mesh import gmsh_session
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.spread_forces import area_of
from perfplast_fenicsx.problem.declared.loads import Load
from tests.geometry.files import write

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]

EXACT = 1e-9
"""Relative difference below which areas count as equal."""


def block() -> int:
    return int(gmsh.model.occ.addBox(0, 0, 0, 10, 10, 5))


def imprinted(*surfaces: int) -> None:
    """Imprint surfaces on a block, without a change of the solid."""
    occ = gmsh.model.occ
    occ.fragment([(3, block())], [(2, surface) for surface in surfaces])


def disk(x: float, y: float, radius: float) -> int:
    return int(gmsh.model.occ.addDisk(x, y, 5, radius, radius))


def pad() -> None:
    imprinted(gmsh.model.occ.addRectangle(4, 4, 5, 2, 2))


def two_pads() -> None:
    occ = gmsh.model.occ
    imprinted(occ.addRectangle(1, 1, 5, 2, 2), occ.addRectangle(6, 5, 5, 3, 2))


def pad_at_an_edge() -> None:
    imprinted(gmsh.model.occ.addRectangle(0, 4, 5, 2, 2))


def round_pad() -> None:
    imprinted(disk(5, 5, 2))


def washer() -> None:
    """Return a block with a hole, and an imprint around the hole."""
    occ = gmsh.model.occ
    hole = occ.addCylinder(5, 5, 0, 0, 0, 5, 1)
    body, _ = occ.cut([(3, block())], [(3, hole)])
    occ.fragment(body, [(2, disk(5, 5, 2))])


def pads_on_two_sides() -> None:
    occ = gmsh.model.occ
    imprinted(occ.addRectangle(4, 4, 5, 2, 2), occ.addRectangle(2, 3, 0, 5, 1))


def feet(places: list[tuple[float, float]]) -> None:
    occ = gmsh.model.occ
    top = occ.addBox(0, 0, 2, 10, 10, 1)
    legs = [(3, occ.addBox(x, y, 0, 2, 2, 2)) for x, y in places]
    occ.fuse([(3, top)], legs)


def two_feet() -> None:
    feet([(0, 0), (8, 0)])


def four_feet() -> None:
    feet([(0, 0), (8, 0), (0, 8), (8, 8)])


def pockets() -> None:
    """Return a block with pockets; their floors lie in one plane, which is not a side."""
    occ = gmsh.model.occ
    holes = [(3, occ.addBox(x, y, 3, 2, 3, 2)) for x in (1, 6) for y in (1, 6)]
    occ.cut([(3, block())], holes)


def clevis() -> None:
    """Return two ears with bores on one axis."""
    occ = gmsh.model.occ
    ears = [(3, occ.addBox(x, 0, 2, 2, 4, 6)) for x in (0, 6)]
    body, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 8, 4, 2))], ears)
    occ.cut(body, [(3, occ.addCylinder(0, 2, 5, 8, 0, 0, 1))])


def lug() -> None:
    occ = gmsh.model.occ
    ear = [(3, occ.addCylinder(3, 0, 4, 0, 2, 0, 3))]
    body, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 6, 2, 4))], ear)
    occ.cut(body, [(3, occ.addCylinder(3, 0, 4, 0, 2, 0, 1))])


def bolt_circle() -> None:
    occ = gmsh.model.occ
    angles = np.arange(6) * math.pi / 3
    holes = [
        (3, occ.addCylinder(3 * math.cos(a), 3 * math.sin(a), 0, 0, 0, 1, 0.5)) for a in angles
    ]
    occ.cut([(3, occ.addCylinder(0, 0, 0, 0, 0, 1, 5))], holes)


def halves(x: float, y: float, radius: float, height: float) -> list[tuple[int, int]]:
    """Return a cylinder as two halves."""
    occ = gmsh.model.occ
    found = []
    for side in (0, 1):
        half = occ.addCylinder(x, y, 0, 0, 0, height, radius, angle=math.pi)
        occ.rotate([(3, half)], x, y, 0, 0, 0, 1, math.pi * side)
        found.append((3, half))
    return found


def split_bore() -> None:
    """Return a bore of two half cylinders, as many CAD systems draw it."""
    body = [(3, block())]
    for half in halves(5, 5, 2, 5):
        body, _ = gmsh.model.occ.cut(body, [half])


def split_clevis() -> None:
    occ = gmsh.model.occ
    ears = [(3, occ.addBox(0, 0, z, 4, 4, 1)) for z in (0, 3)]
    body, _ = occ.fuse([(3, occ.addBox(4, 0, 0, 2, 4, 4))], ears)
    for half in halves(2, 2, 1, 4):
        body, _ = occ.cut(body, [half])


def half_bearing() -> None:
    occ = gmsh.model.occ
    occ.cut([(3, block())], [(3, occ.addCylinder(0, 5, 5, 10, 0, 0, 2))])


def stepped_shaft() -> None:
    occ = gmsh.model.occ
    steps = [(3, occ.addCylinder(x, 0, 0, 3, 0, 0, radius)) for x, radius in ((3, 2), (6, 1))]
    occ.fuse([(3, occ.addCylinder(0, 0, 0, 3, 0, 0, 1))], steps)


def oblique() -> None:
    """Return two pads on a roof that is not parallel to a side."""
    imprinted(
        gmsh.model.occ.addRectangle(1, 1, 5, 2, 2), gmsh.model.occ.addRectangle(6, 5, 5, 3, 2)
    )
    gmsh.model.occ.rotate(gmsh.model.occ.getEntities(3), 0, 0, 0, 1, 0.3, 0, 0.4)


SOLIDS: list[tuple[Callable[[], None], str, dict[str, tuple[int, float]]]] = [
    (pad, "step", {"part_z_high": (2, 100.0)}),
    (pad, "brep", {"part_z_high": (2, 100.0)}),
    (pad, "iges", {"compound_z_high": (2, 100.0)}),
    (two_pads, "step", {"part_z_high": (3, 100.0)}),
    (pad_at_an_edge, "step", {"part_z_high": (2, 100.0)}),
    (round_pad, "step", {"part_z_high": (2, 100.0)}),
    (washer, "step", {"part_z_high": (2, 100 - math.pi)}),
    (pads_on_two_sides, "step", {"part_z_high": (2, 100.0), "part_z_low": (2, 100.0)}),
    (two_feet, "step", {"part_z_low": (2, 8.0)}),
    (four_feet, "step", {"part_z_low": (4, 16.0)}),
    (pockets, "step", {"part_plane_15": (4, 24.0)}),
    (clevis, "step", {"cylinder": (2, 8 * math.pi), "part_z_high": (2, 16.0)}),
    (lug, "step", {}),
    (bolt_circle, "step", {}),
    (split_bore, "step", {"cylinder": (2, 20 * math.pi)}),
    (split_bore, "iges", {"cylinder": (2, 20 * math.pi)}),
    (split_clevis, "step", {"cylinder": (4, 4 * math.pi), "part_x_low": (2, 8.0)}),
    (half_bearing, "step", {"part_z_high": (2, 60.0)}),
    (stepped_shaft, "step", {"cylinder": (2, 12 * math.pi)}),
    (oblique, "step", {"plane": (3, 100.0)}),
]
"""Drawings, the kind of file, and the faces and areas of sets, by name or by kind."""


def surveyed(source: Path, mesh: Path, **options: object) -> Survey:
    """Mesh a drawing coarsely in this process."""
    usual = {"curvature": 8.0} if source.suffix != ".geo" else {}
    with gmsh_session():
        return mesh_file(source, mesh, MeshingOptions(**(usual | options)))  # type: ignore[arg-type]


def drawn_areas(source: Path, dim: int) -> list[float]:
    """Return the sorted areas of all faces in a file with one body, from OpenCASCADE."""
    with gmsh_session():
        gmsh.model.occ.importShapes(str(source))
        gmsh.model.occ.synchronize()
        return sorted(gmsh.model.occ.getMass(dim, tag) for _, tag in gmsh.model.getEntities(dim))


def check_areas(survey: Survey, mesh: Path) -> None:
    """Compare each face and set in the list with the surface of the mesh, and with CAD."""
    read = read_gmsh(MPI.COMM_WORLD, mesh)
    by_number = {face.number: face for face in survey.faces}
    assert len(by_number) == len(survey.faces)
    for face in survey.faces:
        assert area_of(read, face.name) == pytest.approx(face.area, rel=EXACT)
    for one in survey.sets:
        assert area_of(read, one.name) == pytest.approx(one.area, rel=EXACT)
        if one.faces:
            together = sum(by_number[number].area for number in one.faces)
            assert together == pytest.approx(one.area, rel=EXACT)
    check_forces(survey, read)


def check_forces(survey: Survey, read: TaggedMesh) -> None:
    """Load each name by a traction, and each flat face by a pressure; compare forces with areas."""
    gdim = read.mesh.geometry.dim
    V = fem.functionspace(read.mesh, ("P", 1, (gdim,)))

    def force(load: Load) -> npt.NDArray[np.float64]:
        work = work_vector(V, read, [load])
        found = work.array_r.reshape(-1, gdim).sum(axis=0)
        work.destroy()
        return np.asarray(found)

    pull = np.array([1.0, 2.0, 3.0][:gdim])
    for one in (*survey.faces, *survey.sets):
        assert force(Traction(one.name, pull)) == pytest.approx(one.area * pull, rel=EXACT)
    for face in survey.faces:
        if face.shape == "flat":
            pressed = np.linalg.norm(force(Pressure(face.name, 1.0)))
            assert pressed == pytest.approx(face.area, rel=EXACT)


@pytest.mark.long(
    but=[
        "pad-step-sets0",
        "pad-brep-sets1",
        "pad-iges-sets2",
        "round_pad-step-sets5",
        "pads_on_two_sides-step-sets7",
        "two_feet-step-sets8",
        "clevis-step-sets11",
        "lug-step-sets12",
        "bolt_circle-step-sets13",
        "split_bore-step-sets14",
        "split_bore-iges-sets15",
        "half_bearing-step-sets17",
        "stepped_shaft-step-sets18",
        "oblique-step-sets19",
    ]
)
@pytest.mark.parametrize(("make", "kind", "sets"), SOLIDS)
def test_faces_of_solids_are_as_drawn(
    tmp_path: Path, make: Callable[[], None], kind: str, sets: dict[str, tuple[int, float]]
) -> None:
    source = write(tmp_path / f"part.{kind}", make)
    survey = surveyed(source, tmp_path / "part.msh")
    areas = sorted(face.cad or 0.0 for face in survey.faces)
    drawn = drawn_areas(source, 2)
    assert areas == pytest.approx(drawn, rel=EXACT)
    for face in survey.faces:
        straight = face.shape == "flat" and make not in (round_pad, washer, half_bearing)
        straight &= make not in (clevis, lug, bolt_circle, split_bore, split_clevis, stepped_shaft)
        assert face.area == pytest.approx(face.cad, rel=EXACT if straight else 0.2)
    found = {one.name: (len(one.faces), one.cad) for one in survey.sets}
    for name, (count, area) in sets.items():
        called = [other for other in found if name in other.split("_") or name == other]
        assert len(called) == 1, (name, found)
        assert found[called[0]] == (count, pytest.approx(area, rel=EXACT))
    assert not any(one.why == "the whole side" for one in survey.sets if one.name not in sets)
    check_areas(survey, tmp_path / "part.msh")


PLATES = {
    "points": (
        "Point(1) = {0, 0, 0}; Point(2) = {3, 0, 0}; Point(3) = {8, 0, 0}; Point(4) = {8, 4, 0};"
        "Point(5) = {5, 4, 0}; Point(6) = {0, 4, 0};"
        "\nFor k In {1:6}\n Line(k) = {k, k % 6 + 1};\n EndFor\n Curve Loop(1) = {1:6};"
        "Plane Surface(1) = {1};\n",
        {"part_y_low": (2, 8.0), "part_y_high": (2, 8.0)},
    ),
    "feet": (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 8, 4}; Rectangle(2) = {2, 0, 0, 4, 2};'
        "BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }",
        {"part_y_low": (2, 4.0)},
    ),
    "tunnel": (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, -5, 0, 10, 10}; Disk(2) = {0, 0, 0, 2};'
        "BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }",
        {"part_x_low": (2, 6.0)},
    ),
    "three feet": (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 9, 4}; Rectangle(2) = {2, 0, 0, 2, 2};'
        "Rectangle(3) = {6, 0, 0, 2, 2};"
        "BooleanDifference{ Surface{1}; Delete; }{ Surface{2, 3}; Delete; }",
        {"part_y_low": (3, 5.0)},
    ),
    "half bore": (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 8, 4}; Disk(2) = {4, 4, 0, 1};'
        "BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }",
        {"part_y_high": (2, 6.0)},
    ),
}
"""Scripts of plane bodies, and the sides that several lines form."""


@pytest.mark.parametrize("name", PLATES)
def test_lines_of_plane_bodies_are_as_drawn(tmp_path: Path, name: str) -> None:
    text, sets = PLATES[name]
    source = tmp_path / "plate.geo"
    source.write_text(text.replace("; ", ";\n") + "\n")
    survey = surveyed(source, tmp_path / "plate.msh", size=1.0)
    found = {one.name: (len(one.faces), one.area) for one in survey.sets}
    assert found == {
        key: (n, pytest.approx(length, rel=EXACT)) for key, (n, length) in sets.items()
    }
    check_areas(survey, tmp_path / "plate.msh")


def test_a_point_takes_the_face_in_which_it_lies(tmp_path: Path) -> None:
    faces = [
        NamedFace("pad", point=[5.0, 5.0, 5.0]),
        NamedFace("around", point=[1.0, 1.0, 5.0]),
        NamedFace("top", plane={"z": 5.0}),
        NamedFace("again", faces=["pad", "around"]),
        NamedFace("whole", number=6),
        NamedFace("high", box=[[-1.0, -1.0, 4.0], [11.0, 11.0, 6.0]]),
    ]
    source = write(tmp_path / "pad.step", pad)
    survey = surveyed(source, tmp_path / "pad.msh", face=faces)
    areas = {one.name: one.area for one in survey.sets}
    wanted = {"pad": 4.0, "around": 96.0}
    wanted |= dict.fromkeys(("part_z_high", "top", "again", "whole", "high"), 100.0)
    assert areas == pytest.approx(wanted, rel=EXACT)
    check_areas(survey, tmp_path / "pad.msh")


def test_an_angle_takes_what_is_smoothly_joined(tmp_path: Path) -> None:
    """Select both halves of a bore, and of a bent line, without corners."""
    near = NamedFace("bore", point=[5 + math.sqrt(2), 5 + math.sqrt(2), 2.0], angle=10.0)
    survey = surveyed(write(tmp_path / "a.step", split_bore), tmp_path / "a.msh", face=[near])
    (bore,) = (one for one in survey.sets if one.name == "bore")
    assert (len(bore.faces), bore.cad) == (2, pytest.approx(20 * math.pi))
    source = tmp_path / "points.geo"
    source.write_text(PLATES["points"][0])
    face = NamedFace("base", point=[1.0, 0.0], angle=1.0)
    survey = surveyed(source, tmp_path / "points.msh", size=2.0, face=[face])
    (base,) = (one for one in survey.sets if one.name == "base")
    assert (len(base.faces), base.area) == (2, pytest.approx(8.0))


def test_names_that_meant_several_faces_are_refused_with_what_they_are(tmp_path: Path) -> None:
    source = write(tmp_path / "pockets.step", pockets)
    survey = surveyed(source, tmp_path / "pockets.msh")
    (floor,) = (one for one in survey.sets if one.area == pytest.approx(24.0))
    read = read_gmsh(MPI.COMM_WORLD, tmp_path / "pockets.msh")
    with pytest.raises(InputError, match=rf"'{floor.name}' contains all of them"):
        read.facets(floor.name.replace("plane", "face"))
    with pytest.raises(InputError, match="'part_face_999' is not a surface"):
        read.facets("part_face_999")


GROUPS = """
Point(1) = {0, 0, 0}; Point(2) = {4, 0, 0}; Point(3) = {4, 1, 0}; Point(4) = {4, 3, 0};
Point(5) = {0, 3, 0}; Point(6) = {0, 1, 0};
For k In {1:6}
  Line(k) = {k, k % 6 + 1};
EndFor
Line(7) = {6, 3};
Curve Loop(1) = {1, 2, -7, 6}; Plane Surface(1) = {1};
Curve Loop(2) = {7, 3, 4, 5}; Plane Surface(2) = {2};
Physical Surface("Clay") = {1};
Physical Surface(9) = {2};
Physical Curve("ends") = {2, 3, 5, 6};
Physical Curve("right") = {2, 3};
Physical Curve(12) = {1};
Physical Curve("seam") = {7};
Physical Point("corner") = {1};
"""


@pytest.mark.parametrize("kernel", ["", 'SetFactory("OpenCASCADE");'])
@pytest.mark.parametrize("meshed", ["together", "apart"])
def test_physical_groups_of_a_script_are_kept(tmp_path: Path, kernel: str, meshed: str) -> None:
    if meshed == "apart" and not kernel:
        pytest.skip("gmsh's own bodies cannot be parted")
    source, mesh = tmp_path / "layers.geo", tmp_path / "layers.msh"
    source.write_text(kernel + GROUPS)
    survey = surveyed(source, mesh, size=1.0, meshed=meshed)
    assert [body.name for body in survey.bodies] == ["clay", "9"]
    lengths = {"ends": 6.0, "right": 3.0, "12": 4.0, "clay_seam": 4.0, "9_seam": 4.0}
    read = read_gmsh(MPI.COMM_WORLD, mesh)
    found = {one.name: one.area for one in survey.sets}
    assert found == pytest.approx(lengths, rel=EXACT)
    assert {name: area_of(read, name) for name in lengths} == pytest.approx(lengths, rel=EXACT)
    told = " ".join(survey.remarks)
    assert "the physical point 'corner' of 'layers.geo' is ignored" in told
    assert "the physical surface 'Clay' of 'layers.geo' is called 'clay'" in told


COVERED = """
SetFactory("OpenCASCADE");
Box(1) = {-2, -1, 0, 4, 2, 1};
Box(2) = {-1, -1, 1, 2, 2, 1};
Physical Volume("low") = {1};
Physical Volume("high") = {2};
Physical Surface("top") = {6, 12};
"""


def test_physical_groups_of_what_is_cut(tmp_path: Path) -> None:
    """Another body covers half of a top, and a symmetry plane cuts both bodies."""
    source, mesh = tmp_path / "cut.geo", tmp_path / "cut.msh"
    source.write_text(COVERED)
    survey = surveyed(source, mesh, size=1.0, symmetry={"x": 0.0})
    areas = {one.name: one.area for one in survey.sets}
    wanted = {"top": 4.0, "low_top": 2.0, "high_top": 2.0, "symmetry_x": 4.0}
    assert areas == pytest.approx(wanted, rel=EXACT)
    check_areas(survey, mesh)


@pytest.mark.parametrize("name", ["prop.step"])
def test_faces_of_drawings_in_the_documentation(tmp_path: Path, name: str) -> None:
    """Free faces and joints together have the whole area of the drawing."""
    survey = surveyed(ROOT / "docs" / name, tmp_path / "a.msh", curvature=8.0)
    joints = sum(joint.area for joint in survey.joints)
    areas = sum(drawn_areas(ROOT / "docs" / name, 2))
    free = sum(face.cad or 0.0 for face in survey.faces)
    assert free + 2 * joints == pytest.approx(areas, rel=0.02)
    check_areas(survey, tmp_path / "a.msh")


OPENCASCADE = Path("/usr/share/opencascade/data")
"""Drawings that Debian distributes with OpenCASCADE."""


@pytest.mark.long
@pytest.mark.parametrize("name", ["step/screw.step", "occ/CrankArm.brep"])
def test_faces_of_drawings_of_others(tmp_path: Path, name: str) -> None:
    if not (OPENCASCADE / name).exists():
        pytest.skip("OpenCASCADE's drawings are not installed")
    survey = surveyed(OPENCASCADE / name, tmp_path / "a.msh", curvature=6.0)
    areas = sorted(face.cad or 0.0 for face in survey.faces)
    if not survey.joints:
        assert areas == pytest.approx(drawn_areas(OPENCASCADE / name, 2), rel=EXACT)
    check_areas(survey, tmp_path / "a.msh")


BORED = """
[geometry]
file = "part.step"
curvature = 8.0
[material.part]
law = "elastic"
young = 1.0
poisson = 0.0
[[support]]
on = "part_y_low"
[[load]]
on = "part_face_8"
pressure = 1.0
[[load]]
on = "part_face_9"
traction = [0.0, 0.0, -1.0]
total = true
[loading]
values = [1.0]
"""


def test_areas_of_the_drawing_are_kept_with_the_mesh_and_told(tmp_path: Path) -> None:
    write(tmp_path / "part.step", split_bore)
    path = tmp_path / "case.toml"
    path.write_text(BORED)
    case = read_case(path)
    problem = case.problem(MPI.COMM_WORLD)
    flat = ("x_low", "x_high", "y_low", "y_high")
    wanted = {f"part_{side}": 50.0 for side in flat}
    wanted |= {f"part_{side}": 100 - 4 * math.pi for side in ("z_low", "z_high")}
    halves = ("part_face_8", "part_face_9")
    wanted |= dict.fromkeys(halves, 10 * math.pi) | {"part_cylinder_7": 20 * math.pi}
    tagged = problem.tagged_mesh
    assert tagged.drawn == pytest.approx(wanted, rel=EXACT)
    sizes = {name: area_of(tagged, name) for name in wanted}
    assert [sizes[f"part_{side}"] for side in flat] == pytest.approx([50.0] * 4, rel=EXACT)
    meant = understood(case, problem)
    assert meant is not None
    for name in halves:
        less = 100 * (sizes[name] / wanted[name] - 1)
        assert less < -0.1
        (line,) = (it for it in meant.lines if it.startswith(f"  {name}:"))
        assert f"area {sizes[name]:.5g} (31.416 in the drawing, {less:+.2g} %);" in line
    assert "force (0, 0, -1)" in next(it for it in meant.lines if it.startswith("  part_face_9:"))
    assert "holds x, y, z; area 50;" in next(it for it in meant.lines if "part_y_low:" in it)


@pytest.mark.parametrize(
    ("more", "count"),
    [
        ("", 1),
        ('[[contact]]\nprimary = "clay_seam"\nsecondary = "9_seam"', 0),
        ('[[tie]]\nprimary = "9_joint_1"\nsecondary = "clay_joint_1"', 1),
    ],
)
def test_bodies_that_share_a_line_are_glued_where_nothing_else_is_said(
    tmp_path: Path, more: str, count: int
) -> None:
    (tmp_path / "layers.geo").write_text(GROUPS)
    laws = "".join(
        f'[material.{name}]\nlaw = "elastic"\nyoung = 1.0\npoisson = 0.0\n'
        for name in ("clay", "9")
    )
    case = tmp_path / "case.toml"
    case.write_text(
        f'[geometry]\nfile = "layers.geo"\nsize = 1.0\n{laws}[[support]]\non = "12"\n'
        f'[[support]]\non = "right"\n[[load]]\non = "9_y_high"\npressure = 1.0\n{more}\n'
        "[loading]\nvalues = [1.0]\n"
    )
    problem = replace(read_case(case), trust=True).problem(MPI.COMM_WORLD)
    assert len(problem.given.ties) == count
