"""Test that geometry files become meshes with names, or cause one sentence."""

import math
import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import gmsh
import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import read_gmsh
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.mesh_command import PICTURE, describe
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, Survey, generated_mesh, mesher
from perfplast_fenicsx.geometry.first_case import Glued, first_case, is_thread
from perfplast_fenicsx.geometry.geometry_file import check_file
from perfplast_fenicsx.geometry.meshing_options import NamedFace
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.survey import Body, Face, Joint
from perfplast_fenicsx.mesh import gmsh_session
from tests.geometry.files import pin_in_plate, survey_of, write

pytestmark = pytest.mark.serial

FOREIGN = Path("/usr/share/opencascade/data")
"""Sample files in Debian's OpenCASCADE package."""


def nodes_in(mesh: Path) -> int:
    """Return the number of nodes in a .msh file. Collective."""
    count = 0
    if MPI.COMM_WORLD.rank == 0:
        with gmsh_session():
            gmsh.open(str(mesh))
            count = gmsh.model.mesh.getNodes(returnParametricCoord=False)[0].size
    return int(MPI.COMM_WORLD.bcast(count))


def test_bodies_joints_and_faces(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    mesh = shared_tmp_path / "pin.msh"
    found = survey_of(step, mesh, MeshingOptions(size=8.0, curvature=24.0))
    assert [body.name for body in found.bodies] == [f"part_{n}" for n in (1, 2, 3, 4)]
    volumes = [body.volume for body in found.bodies]
    assert volumes == pytest.approx([2400 - 100 * math.pi, 100 * math.pi, 800, 400], rel=0.02)
    assert sum(volumes[:2]) == pytest.approx(2400)  # the plate has the volume that the pin lacks
    joints = {joint.bodies: joint for joint in found.joints}
    assert set(joints) == {("part_1", "part_2"), ("part_1", "part_3"), ("part_1", "part_4")}
    assert joints["part_1", "part_2"].shapes == ("cylindrical",)
    assert joints["part_1", "part_2"].area == pytest.approx(40 * math.pi, rel=0.01)
    assert joints["part_1", "part_3"].area == pytest.approx(200)
    faces = {face.name: face for face in found.faces}
    assert faces["part_1_x_low"].area == pytest.approx(80)
    assert faces["part_2_z_high"].shape == "flat"
    assert faces["part_2_z_high"].centre == pytest.approx((0, 0, 4), abs=0.02)
    assert faces["part_3_z_high"].centre == pytest.approx((15, 0, 8), abs=1e-9)
    assert faces["part_4_x_high"].centre == pytest.approx((25, 0, 2), abs=1e-9)
    free = sum(face.area for face in found.faces if face.body == "part_3")
    assert free == pytest.approx(2 * (200 + 40 + 80) - 200)

    read = read_gmsh(MPI.COMM_WORLD, mesh)
    sides = {side for joint in found.joints for side in joint.surfaces}
    assert set(read.volumes) == {body.name for body in found.bodies}
    assert set(read.surfaces) == set(faces) | sides


def test_curved_elements(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "ball.step", lambda: gmsh.model.occ.addSphere(0, 0, 0, 1))
    mesh = shared_tmp_path / "ball.msh"
    found = survey_of(step, mesh, MeshingOptions(size=0.6, order=2))
    assert found.bodies[0].volume == pytest.approx(4 * math.pi / 3, rel=2e-3)
    assert found.faces[0].area == pytest.approx(4 * math.pi, rel=2e-3)
    assert found.nodes == nodes_in(mesh)


TOUCHING_FACES = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Rectangle(2) = {1, 0, 0, 1, 1};
Rectangle(3) = {0, 1, 0, 1, 1};
Coherence;
Physical Surface("a") = {1};
Physical Surface("a_x_low") = {2};
Physical Surface("A") = {3};
Physical Curve("a_2_y_low") = {1};
"""


@pytest.mark.long
def test_groups_with_names(shared_tmp_path: Path) -> None:
    source, mesh = shared_tmp_path / "faces.geo", shared_tmp_path / "faces.msh"
    if MPI.COMM_WORLD.rank == 0:
        source.write_text(TOUCHING_FACES)
    MPI.COMM_WORLD.barrier()
    found = survey_of(source, mesh, MeshingOptions(size=0.5))
    assert [body.name for body in found.bodies] == ["a_1", "a_x_low", "a_2"]
    assert [joint.bodies for joint in found.joints] == [("a_1", "a_x_low"), ("a_1", "a_2")]
    assert found.nodes == nodes_in(mesh)  # where all three meet, each has a separate node
    read = read_gmsh(MPI.COMM_WORLD, mesh)
    assert set(read.volumes) == {"a_1", "a_2", "a_x_low"}
    assert {face.name for face in found.faces} < set(read.surfaces)


TWO_NAMES = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Physical Surface("a") = {1};
Physical Surface("b") = {1};
"""


@pytest.mark.long
def test_bodies_apart(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "apart.step", lambda: pin_in_plate(beside=0.05))
    found = survey_of(step, shared_tmp_path / "apart.msh", MeshingOptions(size=10.0))
    assert {near.bodies for near in found.near} == {("part_1", "part_4"), ("part_3", "part_4")}
    assert [near.gap for near in found.near] == pytest.approx([0.05, 0.05])
    case = first_case(found, "apart", "apart.step")
    assert "# part_1 and part_4 are 0.05 apart and do not touch. If they should" in case


def test_command(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    folder = shared_tmp_path / "case"
    command = ["mesh", str(step), "-o", str(folder), "--size", "10", "--material", "S235"]
    assert main(command) == 0
    assert (folder / PICTURE).exists() or shutil.which("Xvfb") is None
    if MPI.COMM_WORLD.rank == 0:
        assert "part_1_joint_1  part_2_joint_1" in capfd.readouterr().out
        case = folder / "case.toml"
        text = case.read_text().replace("NAME", "part_1_x_low", 1).replace("NAME", "part_3_z_high")
        case.write_text(text.replace("[[contact]]", "[[tie]]"))
    MPI.COMM_WORLD.barrier()
    assert main(["check", str(folder / "case.toml"), "-o", str(folder / "seen.png")]) == 0
    capfd.readouterr()
    assert main(command) == 2
    if MPI.COMM_WORLD.rank == 0:
        assert "--force" in capfd.readouterr().err


def pyramid_in_block() -> None:
    """The apex of the pyramid has four normals, but a node has three components."""
    occ = gmsh.model.occ
    base = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    corners = [occ.addPoint(x, y, -1) for x, y in base]
    apex = occ.addPoint(0, 0, 1)
    around = [occ.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    up = [occ.addLine(corner, apex) for corner in corners]
    loops = [occ.addCurveLoop(around)]
    loops += [occ.addCurveLoop([around[k], up[(k + 1) % 4], up[k]]) for k in range(4)]
    faces = [occ.addPlaneSurface([loop]) for loop in loops]
    pyramid = occ.addVolume([occ.addSurfaceLoop(faces)])
    occ.fragment([(3, occ.addBox(-2, -2, -2, 4, 4, 4))], [(3, pyramid)])


@pytest.mark.usefixtures("undrawn")
def test_contacts_that_a_run_would_refuse(
    shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    step, folder = write(shared_tmp_path / "in.step", pyramid_in_block), shared_tmp_path / "case"
    command = ["mesh", str(step), "-o", str(folder), "--size", "2", "--force"]
    for glued, told in (([], True), (["--tied"], False)):
        assert main([*command, *glued]) == 0
        if MPI.COMM_WORLD.rank == 0:
            said = capfd.readouterr().out
            assert (
                "warning: perfplast run would refuse these contacts: too many faces" in said
            ) == told


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.step", None, "cannot be read: No such file"),
        ("broken.step", "ISO-10303-21;\nDATA;\n#1=OOPS(;\nEND", "broken.step'"),
        ("nothing.geo", "a = 1;", "has no volume and no surface"),
        ("wrong.geo", "Box(1) = {0, 0", "cannot be read"),
        ("twice.geo", TWO_NAMES, "in the physical groups 'a' and 'b'"),
    ],
)
def test_no_geometry(shared_tmp_path: Path, name: str, content: str | None, says: str) -> None:
    if content is not None and MPI.COMM_WORLD.rank == 0:
        (shared_tmp_path / name).write_text(content)
    MPI.COMM_WORLD.barrier()
    mesh = shared_tmp_path / "out.msh"
    with pytest.raises(InputError, match=says):
        survey_of(shared_tmp_path / name, mesh)
    assert not mesh.exists()


@pytest.mark.long
def test_bodies_that_touch_along_an_edge(shared_tmp_path: Path) -> None:
    def two() -> None:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.addBox(1, 1, 0, 1, 1, 1)

    step, mesh = write(shared_tmp_path / "edge.step", two), shared_tmp_path / "edge.msh"
    found = survey_of(step, mesh, MeshingOptions(size=1.0))
    assert "'part_1' and 'part_2' touch only along an edge" in found.remarks[0]
    assert not found.joints
    assert not found.near


def test_patience(shared_tmp_path: Path) -> None:
    step, mesh = write(shared_tmp_path / "pin.step", pin_in_plate), shared_tmp_path / "pin.msh"
    with pytest.raises(InputError, match=r"not meshed within 0\.01 s"):
        survey_of(step, mesh, MeshingOptions(patience=0.01))
    assert not mesh.exists()


def test_bolts_with_nuts() -> None:
    bodies = [Body(name, name, 1.0, (0.0,) * 3, (1.0,) * 3, 1, 1.0) for name in ("bolt_1", "nut")]
    joint = Joint(("bolt_1", "nut"), ("bolt_1_joint_1", "nut_joint_1"), 1.0, ("cylindrical",))
    for glued, kind in ((Glued.NOTHING, "contact"), (Glued.BOLTS, "tie"), (Glued.ALL, "tie")):
        text = first_case(Survey(3, 1, 4, bodies, [joint]), "a", "a.step", glued=glued)
        assert kind in tomllib.loads(text)
        assert tomllib.loads(text)["loading"]["control"] == "bounds"
    with pytest.raises(InputError, match="no body named as a bolt touches"):
        first_case(Survey(3, 1, 4, bodies), "a", "a.step", glued=Glued.BOLTS)


@pytest.mark.parametrize(
    ("bodies", "bore", "threaded"),
    [
        (("nut_1", "rod"), "nut_1", True),
        (("axle", "ecrou"), "ecrou", True),
        (("nut_1", "bracket"), "bracket", False),
        (("rod", "bracket"), "bracket", False),
        (("nut_1", "rod"), "", False),
        (("nut_1", "bolt_1"), "", True),
        (("hex_nut_m8", "rod"), "hex_nut_m8", True),
        (("nut_1", "cotter_pin"), "nut_1", False),
        (("nutating_disc", "shaft"), "nutating_disc", False),
        (("nabe_mit_nut", "welle"), "nabe_mit_nut", False),
        (("soldado_block", "axle"), "soldado_block", False),
    ],
)
def test_a_nut_around_a_rod_is_on_a_thread(
    bodies: tuple[str, str], bore: str, threaded: bool
) -> None:
    """A nut in the bore of another body is on no thread there, and a bearing has no thread."""
    surfaces = (f"{bodies[0]}_joint_1", f"{bodies[1]}_joint_1")
    joint = Joint(bodies, surfaces, 1.0, ("cylindrical",), bore=bore)
    assert is_thread(joint) == threaded


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.step", "", "is empty"),
        ("other.step", "solid teapot", "is not in STEP format"),
        ("teapot.stl", "solid teapot", "the suffix of a geometry file"),
        (
            "teapot.mesh",
            "MeshVersionFormatted 2",
            "reads models with a mesh",
        ),
        (
            "teapot.msh",
            "$MeshFormat",
            "a case, as file = 'teapot.msh'",
        ),
    ],
)
def test_no_geometry_at_first_sight(tmp_path: Path, name: str, content: str, says: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=says):
        check_file(tmp_path / name)


def test_overlap(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "overlap.step", lambda: pin_in_plate(shift=0.5))
    mesh = shared_tmp_path / "overlap.msh"
    with pytest.raises(InputError, match="'part_1' and 'part_2' overlap by"):
        survey_of(step, mesh)
    found = survey_of(step, mesh, MeshingOptions(overlap=0.1, size=8.0))
    assert found.bodies[1].volume == pytest.approx(100 * math.pi, rel=0.1)


def test_unknown_body(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    with pytest.raises(InputError, match="for 'part_9'"):
        survey_of(step, shared_tmp_path / "out.msh", MeshingOptions(sizes={"part_9": 1.0}))


@pytest.mark.long
def test_smaller_elements_in_one_body(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    cells = []
    for sizes in ({}, {"part_4": 1.5}):
        options = MeshingOptions(size=10.0, sizes=sizes)
        found = survey_of(step, shared_tmp_path / "out.msh", options)
        cells.append([body.cells for body in found.bodies])
    assert cells[1][3] > 5 * cells[0][3]
    assert cells[1][1] < 2 * cells[0][1]


@pytest.mark.parametrize(
    ("values", "says"),
    [({"size": -1.0}, "size"), ({"curvature": 1e3}, "curvature"), ({"overlap": 2.0}, "overlap")],
)
def test_options(values: dict[str, float], says: str) -> None:
    with pytest.raises(InputError, match=says):
        MeshingOptions(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("title", ["Ü \"1\" \\ '2'", "two\nlines = 1\t", "\x7f\x00"])
def test_any_title(title: str) -> None:
    body = Body("a", title, 1.0, (0.0,) * 3, (1.0,) * 3, 1, 1.0)
    case = tomllib.loads(first_case(Survey(3, 1, 4, [body]), title, "a.step"))
    assert case["title"] == title
    assert case["material"].keys() == {"a"}


SHAFT = (0, 0, 0, 0, 0, 40, 10)
"""Place, axis and radius."""


def test_names() -> None:
    wanted = ["Bolt M12", "bolt-m12", "12", "ÄÖ", "bolt_m12_1", "Nut"]
    names = unique_names(wanted)
    assert len(set(names)) == len(wanted)
    assert names[5] == "nut"


@pytest.mark.long
@pytest.mark.skipif(not FOREIGN.exists(), reason="OpenCASCADE's data are not installed")
def test_a_file_of_others_without_solids(shared_tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the faces enclose no volume"):
        survey_of(FOREIGN / "occ" / "face1.brep", shared_tmp_path / "out.msh")


@pytest.mark.long
@pytest.mark.skipif(not FOREIGN.exists(), reason="OpenCASCADE's data are not installed")
def test_a_drawing_of_others_that_is_sewn(shared_tmp_path: Path) -> None:
    """With its round faces the mesh would exceed the cells of a first mesh: 2.4 % are missing."""
    found = survey_of(FOREIGN / "iges" / "hammer.iges", shared_tmp_path / "hammer.msh")
    for body in found.bodies:
        assert body.cad is not None
        assert body.volume == pytest.approx(body.cad, rel=0.03)


def test_faces_are_sewn_to_solids(shared_tmp_path: Path) -> None:
    def box() -> None:
        gmsh.model.occ.addBox(0, 0, 0, 10, 20, 30)

    iges = write(shared_tmp_path / "box.igs", box)
    (body,) = survey_of(iges, shared_tmp_path / "box.msh", MeshingOptions(size=8.0)).bodies
    assert body.volume == pytest.approx(6000.0, rel=1e-9)
    assert body.cad == pytest.approx(6000.0, rel=1e-9)


@pytest.mark.long
def test_faces_of_bodies_that_touch_are_sewn_to_several_solids(shared_tmp_path: Path) -> None:
    """Edges belong to faces of both bodies. Sewn together, the faces enclosed no volume."""

    def stacked() -> None:
        gmsh.model.occ.addBox(0, 0, 0, 10, 20, 30)
        gmsh.model.occ.addCylinder(5, 10, 30, 0, 0, 10, 4)

    iges = write(shared_tmp_path / "stacked.igs", stacked)
    options = MeshingOptions(size=8.0, curvature=6)
    found = survey_of(iges, shared_tmp_path / "stacked.msh", options)
    assert [joint.shapes for joint in found.joints] == [("flat",)]
    volumes = sorted(body.cad or 0.0 for body in found.bodies)
    assert volumes == pytest.approx([160 * math.pi, 6000.0], rel=0.01)  # splines, by OpenCASCADE
    assert not any("enclose no solid" in remark for remark in found.remarks)


@pytest.mark.long
def test_faces_of_no_solid_are_told(shared_tmp_path: Path) -> None:
    def beside() -> None:
        gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10)
        gmsh.model.occ.addRectangle(20, 0, 0, 20, 10)

    iges = write(shared_tmp_path / "beside.igs", beside)
    found = survey_of(iges, shared_tmp_path / "beside.msh", MeshingOptions(size=8.0))
    assert [body.cad for body in found.bodies] == [pytest.approx(1000.0)]
    assert any("faces with 25 % of the total area" in it for it in found.remarks)


@pytest.mark.long
def test_small_gaps_are_closed(shared_tmp_path: Path) -> None:
    """A plate lies over another plate, and a pin is too thin for its hole in the lower plate."""

    def plates() -> None:
        occ = gmsh.model.occ
        plate, hole = occ.addBox(0, 0, 0, 40, 20, 5), occ.addCylinder(20, 10, 0, 0, 0, 5, 4)
        occ.cut([(3, plate)], [(3, hole)])
        occ.addCylinder(20, 10, 0, 0, 0, 5, 3.99)
        occ.addBox(10, 0, 5.01, 30, 20, 5)

    step = write(shared_tmp_path / "plates.step", plates)
    mesh = shared_tmp_path / "plates.msh"
    options = MeshingOptions(size=10.0, curvature=8)
    apart = survey_of(step, mesh, options)
    assert not apart.joints
    assert [pair.gap for pair in apart.near] == pytest.approx([0.01] * len(apart.near), rel=1e-3)
    assert "close_gaps = 0.011 under [geometry]" in first_case(apart, "plates", "plates.step")
    closed = survey_of(step, mesh, replace(options, close_gaps=0.02))
    assert not closed.near
    found = {frozenset(joint.bodies): joint.area for joint in closed.joints}
    assert len(found) == 3
    assert found[frozenset({"part_1", "part_3"})] == pytest.approx(600 - 16 * math.pi, rel=0.02)
    with gmsh_session():  # contact on a bent face would push bodies aside
        gmsh.open(str(mesh))
        groups = {
            gmsh.model.getPhysicalName(*group): group for group in gmsh.model.getPhysicalGroups()
        }
        names = [joint.surfaces[0] for joint in closed.joints if joint.shapes == ("flat",)]
        for name in names:
            points = gmsh.model.mesh.getNodesForPhysicalGroup(*groups[name])[1].reshape(-1, 3)
            assert np.ptp(points[:, 2]) < 1e-9
    assert len(names) == 2
    assert {"part_1_x_low", "part_3_z_high"} <= {face.name for face in closed.faces}
    case = first_case(closed, "plates", "plates.step", replace(options, close_gaps=0.02))
    assert "close_gaps = 0.02" in case
    with pytest.raises(
        InputError, match=r"close_gaps = 8 changes the volume|cannot divide the bodies"
    ):
        survey_of(step, mesh, replace(options, close_gaps=8.0))


def test_bodies_that_are_left_out(shared_tmp_path: Path) -> None:
    step = write(shared_tmp_path / "pin.step", pin_in_plate)
    mesh = shared_tmp_path / "pin.msh"
    bodies = {body.name for body in survey_of(step, mesh, MeshingOptions(size=8.0)).bodies}
    gone = sorted(bodies)[1:3]
    found = survey_of(step, mesh, MeshingOptions(size=8.0, without=gone))
    assert {body.name for body in found.bodies} == bodies - set(gone)
    assert not {name for joint in found.joints for name in joint.bodies} & set(gone)
    with pytest.raises(InputError, match="'without' contains 'lid'"):
        survey_of(step, mesh, MeshingOptions(without=["lid"]))
    with pytest.raises(InputError, match="contains all bodies"):
        survey_of(step, mesh, MeshingOptions(without=sorted(bodies)))


@pytest.mark.long
def test_areas_are_right_to_one_percent(shared_tmp_path: Path) -> None:
    """With ten elements around the shaft, its ends would be 6.5 % too small."""
    step = write(shared_tmp_path / "shaft.step", lambda: gmsh.model.occ.addCylinder(*SHAFT))
    mesh = shared_tmp_path / "shaft.msh"
    found = survey_of(step, mesh, MeshingOptions(size=20.0))
    for face in found.faces:
        assert face.cad is not None
        assert face.area == pytest.approx(face.cad, rel=0.01)
    assert {face.round_of for face in found.faces} == {"", "shaft, R 10, along z"}
    assert sum(face.cad or 0.0 for face in found.faces) == pytest.approx(1000 * math.pi)
    assert not any("areas of faces" in remark for remark in found.remarks)
    coarse = survey_of(step, mesh, MeshingOptions(size=20.0, curvature=8.0))
    (remark,) = [remark for remark in coarse.remarks if "areas of faces" in remark]
    assert "errors up to 10 % (" in remark
    assert "--curvature" in remark
    worst, large = Face(1, "lug", "shaft", "flat", 70.0, (0.0,) * 3, 100.0), coarse.faces
    (remark,) = mesher.area_remarks(0.1, [*large, worst])
    assert "errors up to 30 % ('lug'), those of large faces up to 10 %, because" in remark
    assert not [*mesher.area_remarks(0.001, [worst])]


@pytest.mark.serial
@pytest.mark.parametrize(("body", "says"), [("pump_carter_sup_20_03_2006", True), ("rod", False)])
def test_long_names_of_bodies_bring_advice_on_short_names_of_faces(body: str, says: bool) -> None:
    """The list shows the key of the case file, with the number of a face."""
    measures = (1.0, (0.0,) * 3, (1.0,) * 3, 9, 0.5, 1.0)
    faces = [Face(7, f"{body}_face_7", body, "flat", 1.0, (0.0,) * 3, 1.0)]
    listed = describe(Survey(3, 1, 8, [Body(body, body, *measures)], faces=faces))
    (line,) = [line for line in listed.splitlines() if "short name" in line] or [""]
    assert bool(line) == says
    if says:
        (wanted,) = tomllib.loads(line.partition("[geometry]: ")[2])["face"]
        assert MeshingOptions(face=[NamedFace(**wanted)]).face[0].number == 7


@pytest.mark.long
def test_one_element_through_the_thickness(shared_tmp_path: Path) -> None:
    plate = write(shared_tmp_path / "plate.step", lambda: gmsh.model.occ.addBox(0, 0, 0, 50, 50, 2))
    mesh = shared_tmp_path / "plate.msh"

    def warned(size: float) -> bool:
        remarks = survey_of(plate, mesh, MeshingOptions(size=size)).remarks
        return any("one element through its thickness" in remark for remark in remarks)

    assert warned(6.0)
    assert not warned(1.2)


@pytest.mark.long
def test_a_round_rod_with_few_edges_around_it(shared_tmp_path: Path) -> None:
    """The remark names the missing volume, and recommends a size that is small enough."""
    cylinder = (0, 0, 0, 150, 0, 0, 5)
    rod = write(shared_tmp_path / "rod.step", lambda: gmsh.model.occ.addCylinder(*cylinder))
    mesh = shared_tmp_path / "rod.msh"

    def remark(**sizes: Any) -> str:
        remarks = survey_of(rod, mesh, MeshingOptions(curvature=4, **sizes)).remarks
        return next((it for it in remarks if "differ in volume" in it), "")

    coarse = remark(size=12.0)
    assert "'part' (-3" in coarse  # a square is 36 % smaller than its circle
    advice = re.search(r"--size-of part=([\d.]+)", coarse)
    assert advice is not None
    assert remark(size=12.0, sizes={"part": float(advice[1])}) == ""


@pytest.mark.long
@pytest.mark.skipif(not FOREIGN.exists(), reason="OpenCASCADE's data are not installed")
def test_a_screw_of_others(shared_tmp_path: Path) -> None:
    found = survey_of(FOREIGN / "step" / "screw.step", shared_tmp_path / "out.msh")
    assert len(found.bodies) == 1
    assert found.bodies[0].volume == pytest.approx(3734, rel=0.02)


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="one process meshes")
def test_elements_without_volume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After flat elements, the program tries the next algorithm, and uses the best mesh or none."""
    step = write(tmp_path / "block.step", lambda: gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1))

    def meshed(*worst: float) -> list[tuple[float, ...]]:
        """Mesh with algorithms of given qualities, and return the algorithms that were tried."""
        tried: list[tuple[float, ...]] = []

        def worst_of(dim: int, part: Part) -> npt.NDArray[np.float64]:
            names = ("Mesh.Algorithm", "Mesh.Algorithm3D")
            now = tuple(gmsh.option.getNumber(name) for name in names)
            if not tried or tried[-1] != now:
                tried.append(now)
            return np.array([worst[generated_mesh.ALGORITHMS.index(now)], 0.5])  # type: ignore[arg-type]

        monkeypatch.setattr(generated_mesh, "qualities", worst_of)
        with gmsh_session():
            mesher.mesh_file(step, tmp_path / "block.msh", MeshingOptions(size=0.5))
        return tried

    first, second, third = generated_mesh.ALGORITHMS
    assert meshed(0.3, 0.0, 0.0) == [first]
    assert meshed(0.0, 0.3, 0.0) == [first, second]
    assert meshed(-1e-12, 2e-8, 1e-9) == [first, second, third, second]
    (tmp_path / "block.msh").unlink()
    with pytest.raises(InputError, match="'part' cannot be meshed"):
        meshed(0.0, -1e-3, 1e-12)
    assert not (tmp_path / "block.msh").exists()


@pytest.mark.long
@pytest.mark.skipif(not (FOREIGN / "occ" / "CrankArm.brep").exists(), reason="no such file")
def test_a_drawing_of_others_with_tiny_edges(shared_tmp_path: Path) -> None:
    """By default gmsh makes elements without volume in this drawing."""
    found = survey_of(FOREIGN / "occ" / "CrankArm.brep", shared_tmp_path / "crank.msh")
    assert min(body.worst for body in found.bodies) > generated_mesh.NO_VOLUME
    assert read_gmsh(MPI.COMM_WORLD, shared_tmp_path / "crank.msh").volumes
