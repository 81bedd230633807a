"""Test cases that draw their ground: bodies, names, joints, and results."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.understood import understood
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import mesh_geometry
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.mesh_table import GroundInCase
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh
from perfplast_fenicsx.problem.assembled.spread_forces import area_of
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.problem.problem import variant

SOIL = '{{ law = "mohr-coulomb", young = 1e4, poisson = 0.3, cohesion = {}, friction_angle = {} }}'

HEAD = """
title = "Slope"
geometry.size = 4.0
mesh.adapt = {{ until = 0.3, cells = 400 }}
loading.control = "strength"
output.pictures = false
gravity = {{ acceleration = [0.0, -1.0], density = {{ {density} }} }}
support = [{{ on = "base" }}, {{ on = "left", components = "x" }},
           {{ on = "right", components = "x" }}]

[material]
{materials}
"""

STRATA = """
[[stratum]]
name = "fill"
top = [[20, 25], [30, 25], [50, 35], [70, 35]]

[[stratum]]
name = "clay"
top = [[20, 25], [30, 25], [70, 31]]
bottom = 20
"""

REGIONS = """
[[region]]
name = "fill"
points = [[30, 25], [70, 31], [70, 35], [50, 35]]

[[region]]
name = "clay"
points = [[20, 20], [70, 20], [70, 31], [30, 25], [20, 25]]
"""

WET = """
[water]
table = [[20, {0}], [70, {0}]]
unit_weight = 9.81
saturated = {{ fill = 19.0, clay = 19.0 }}
"""

LOADED = """
[[line]]
name = "road"
points = [[55, 35], [65, 35]]

[[line]]
name = "seam"
points = [[30, 25], [70, 31]]
"""


def case(tmp_path: Path, drawn: str, **strengths: tuple[float, float]) -> Case:
    strengths = strengths or {"fill": (10.0, 30.0), "clay": (15.0, 20.0)}
    head = HEAD.format(
        density=", ".join(f"{name} = 19.0" for name in strengths),
        materials="\n".join(f"{name} = {SOIL.format(*of)}" for name, of in strengths.items()),
    )
    path = tmp_path / "slope.toml"
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(head + drawn, encoding="utf-8")
    MPI.COMM_WORLD.barrier()
    return read_case(path)


def lengths(mesh: TaggedMesh) -> dict[str, float]:
    return {name: area_of(mesh, name) for name in mesh.surfaces}


@pytest.mark.mpi2("regions")
@pytest.mark.parametrize("drawn", [STRATA, REGIONS], ids=["strata", "regions"])
def test_bodies_sides_and_joints(shared_tmp_path: Path, drawn: str) -> None:
    read = case(shared_tmp_path, drawn + LOADED)
    mesh = read.tagged_mesh(MPI.COMM_WORLD)
    assert sorted(mesh.volumes) == ["clay", "fill"]
    found = lengths(mesh)
    joint = float(np.hypot(40, 6))
    wanted = {"base": 50, "left": 5, "right": 15, "surface": 30 + np.hypot(20, 10)}
    wanted |= {"road": 10, "clay_seam": joint, "fill_seam": joint}
    assert {name: found[name] for name in wanted} == pytest.approx(wanted)
    (tie,) = read.problem(MPI.COMM_WORLD).given.ties
    assert {tie.primary, tie.secondary} == {"clay_joint_1", "fill_joint_1"}


@pytest.mark.serial
def test_what_is_glued_moves_together(tmp_path: Path) -> None:
    read = case(tmp_path, REGIONS + LOADED)
    meant = understood(read, read.problem(MPI.COMM_SELF))
    assert meant is not None
    lines = "\n".join(meant.lines)
    surface = 30 + float(np.hypot(20, 10))
    assert f"(length): 'surface' ({surface:.5g})" in lines
    assert "the drawing has one face for both" in lines and "all supports together" not in lines
    assert not {"clay_joint_1", "fill_joint_1"} & {*meant.marked}


@pytest.mark.serial
def test_a_contact_by_the_name_of_a_line_parts_the_ground(tmp_path: Path) -> None:
    contact = '[[contact]]\nprimary = "clay_seam"\nsecondary = "fill_seam"\n'
    problem = case(tmp_path, REGIONS + LOADED + contact).problem(MPI.COMM_WORLD)
    assert not problem.given.ties and len(problem.given.contacts) == 1


CRACKED = """
[[region]]
name = "a"
points = [[20, 20], [54, 20], [54, 35], [50, 35], [30, 25], [20, 25]]

[[region]]
name = "b"
points = [[54, 20], [70, 20], [70, 35], [54, 35]]

[[line]]
name = "crack"
points = [[54, 31], [54, 35]]
"""
WATER_IN_IT = 'crack = true\nwater = 35\n[units]\nsystem = "m-kN-kPa"\n'
OF_TWO = {"a": (40.0, 10.0), "b": (40.0, 10.0)}
SIDES_OF_IT = ("left", "right")


@pytest.mark.mpi2
def test_a_crack_is_open_and_its_water_presses_on_both_sides(shared_tmp_path: Path) -> None:
    """On one mesh, a crack permits more mechanisms and fewer stresses, and water pushes on it."""
    found = []
    for more in ("", "crack = true\n", WATER_IN_IT):
        read = case(shared_tmp_path, CRACKED + more, **OF_TWO)
        found.append(bounds_at_one(read))
    whole, dry, wet = found
    print(found)
    assert dry[0] < whole[0] and dry[1] < whole[1] * (1 + 1e-6)
    assert wet[0] < wet[1] < whole[1]
    problem = read.problem(MPI.COMM_WORLD)
    (tie,) = problem.given.ties
    assert {tie.primary, tie.secondary} == {"a_joint_1_rest", "b_joint_1_rest"}
    assert area_of(problem.tagged_mesh, "a_joint_1_rest") == pytest.approx(11)
    forces = {it.on: it.force for it in load_resultants(problem) if it.on.endswith("crack")}
    assert forces["a_crack"] == pytest.approx([-8 * 9.81, 0.0])  # 4 m deep
    assert forces["b_crack"] == pytest.approx([8 * 9.81, 0.0])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("water = 33", "'crack' has the key water, but"),
        ("crack = true\nwater = 33", "reaches y = 33, where the crack"),
        ("crack = true\nwater = 35", r"unit_weight is missing"),
    ],
)
@pytest.mark.serial
def test_cracks_that_cannot_be(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        case(tmp_path, f"{CRACKED}{more}\n", **OF_TWO)


IN_ONE = """
[[region]]
name = "a"
points = [[20, 20], [70, 20], [70, 35], [50, 35], [30, 25], [20, 25]]

[[line]]
name = "crack"
points = [[54, 35], [54, 33], [53, 31]]
"""
OF_ONE = {"a": (40.0, 10.0)}


def test_a_crack_inside_one_region(shared_tmp_path: Path) -> None:
    """On one mesh the crack permits more mechanisms, and water pushes on both its sides."""
    whole, dry, wet = (
        bounds_at_one(read := case(shared_tmp_path, IN_ONE + more, **OF_ONE))
        for more in ("", "crack = true\n", WATER_IN_IT)
    )
    assert dry[0] < whole[0] and dry[1] < whole[1] * (1 + 1e-6)
    assert wet[0] < wet[1] < whole[1]
    problem = read.problem(MPI.COMM_WORLD)
    long = 2 + float(np.hypot(1, 2))
    found = {f"crack_{side}": area_of(problem.tagged_mesh, f"crack_{side}") for side in SIDES_OF_IT}
    assert found == pytest.approx({"crack_left": long, "crack_right": long})
    assert not problem.given.ties and not problem.given.contacts
    water = 9.81 * np.array([8.0, 3.0])  # 4 m deep; the lower part leans by 1 m
    forces = {it.on: it.force for it in load_resultants(problem) if it.on.startswith("crack")}
    assert forces["crack_left"] == pytest.approx([water[0], -water[1]])
    assert forces["crack_right"] == pytest.approx([-water[0], water[1]])


@pytest.mark.serial
@pytest.mark.long(but=["[60, 24], [62, 30]-1", "[50, 35], [50, 20]-2"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("points", ["[60, 24], [62, 30]", "[50, 35], [50, 20]"])
def test_a_crack_parts_nodes_but_those_of_its_tips(tmp_path: Path, points: str, order: int) -> None:
    """Inside the ground the crack tips connect both sides.

    A crack from side to side divides the body.
    """
    mesh = {}
    for crack in ("", "crack = true\n"):
        drawn = IN_ONE[: IN_ONE.index("points = [[54")] + f"points = [{points}]\n{crack}"
        text = case(tmp_path, drawn, **OF_ONE).text
        sized = text.replace("geometry.size = 4.0", f"geometry = {{ size = 4.0, order = {order} }}")
        (tmp_path / "slope.toml").write_text(sized, encoding="utf-8")
        mesh[crack] = read_case(tmp_path / "slope.toml").tagged_mesh(MPI.COMM_SELF)
    whole, open_ = mesh.values()
    edges = len(open_.facets("crack_left"))
    assert edges == len(open_.facets("crack_right")) > 1
    copies = open_.mesh.geometry.x.shape[0] - whole.mesh.geometry.x.shape[0]
    tips = 2 if points.startswith("[60") else 0
    assert copies == edges * order + 1 - tips
    assert lengths(open_)["crack_left"] == pytest.approx(lengths(open_)["crack_right"])


@pytest.mark.serial
@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        (CRACKED.replace("[54, 31], [54, 35]", "[54, 30], [60, 31]"), "'a' and 'b' at (54, 30)"),
        (CRACKED.replace("[54, 31], [54, 35]", "[50, 30], [60, 30]"), "'a' and 'b' at (54, 30)"),
        (CRACKED.replace("[54, 31], [54, 35]", "[55, 35], [60, 35]"), "boundary of the ground at"),
        (
            IN_ONE + "crack = true\n[[line]]\nname = 'crack_left'\npoints = [[20, 20], [70, 20]]\n",
            "has a side 'crack_left'",
        ),
    ],
)
def test_cracks_in_a_region_that_are_refused(tmp_path: Path, drawn: str, words: str) -> None:
    drawn = drawn if "crack = true" in drawn else drawn + "crack = true\n"
    with pytest.raises(InputError, match=re.escape(words)):
        case(tmp_path, drawn, **(OF_TWO if '"b"' in drawn else OF_ONE))


@pytest.mark.serial
def test_names_of_a_joint_that_end_in_left_and_right_make_no_crack(tmp_path: Path) -> None:
    """Two lines between two regions are joints, with a name for each region."""
    lines = CRACKED[CRACKED.index("[[line]]") :]
    drawn = CRACKED.replace(lines, "") + "".join(
        lines.replace('"crack"', f'"seam_{side}"') for side in SIDES_OF_IT
    )
    mesh = case(tmp_path, drawn, **OF_TWO).tagged_mesh(MPI.COMM_SELF)
    names = {f"{body}_seam_{side}" for body in "ab" for side in SIDES_OF_IT}
    assert names <= {*mesh.surfaces}


SCRIPT = """
Point(1) = {0, 0, 0, 0.5}; Point(2) = {2, 0, 0, 0.5}; Point(3) = {2, 1, 0, 0.5};
Point(4) = {0, 1, 0, 0.5}; Point(5) = {1, 0.4, 0, 0.5}; Point(6) = {1, 0.7, 0, 0.5};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Line(5) = {5, 6};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Curve {5} In Surface {1};
Physical Surface("soil") = {1};
"""


@pytest.mark.serial
@pytest.mark.parametrize("curves", ["5", "5, 2", "2"])
def test_a_crack_of_a_script_lies_inside_a_body(tmp_path: Path, curves: str) -> None:
    """On the boundary, two names do not define a crack."""
    named = "".join(f'Physical Curve("c_{side}") = {{{curves}}};\n' for side in SIDES_OF_IT)
    script, target = tmp_path / "soil.geo", tmp_path / "soil.msh"
    script.write_text(SCRIPT + named, encoding="utf-8")
    if "," in curves:
        with pytest.raises(InputError, match="'c_left' and 'c_right' name both sides"):
            mesh_geometry(script, target, trust=True)
        return
    mesh_geometry(script, target, trust=True)
    mesh = read_gmsh(MPI.COMM_SELF, target)
    one, other = (mesh.facets(f"c_{side}") for side in SIDES_OF_IT)
    assert len(one) == len(other) > 0
    assert (curves == "2") == bool(np.isin(one, other).any())


@pytest.mark.serial
def test_a_contact_on_a_part_of_a_glued_joint_is_refused(tmp_path: Path) -> None:
    """Earlier, the contact also separated the rest of the joint, without a message."""
    contact = '[[contact]]\nprimary = "a_crack"\nsecondary = "b_crack"\n'
    read = case(tmp_path, CRACKED + contact, **OF_TWO)
    with pytest.raises(InputError, match="'a_joint_1' or 'b_joint_1'"):
        read.problem(MPI.COMM_SELF)


@pytest.mark.serial
def test_the_mesh_is_made_again_after_the_drawing_has_changed(tmp_path: Path) -> None:
    case(tmp_path, REGIONS).tagged_mesh(MPI.COMM_SELF)
    first = (tmp_path / "slope.msh").read_bytes()
    mesh = case(tmp_path, REGIONS.replace("31", "30")).tagged_mesh(MPI.COMM_SELF)
    assert (tmp_path / "slope.msh").read_bytes() != first
    assert lengths(mesh)["right"] == pytest.approx(15)


def factors(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> list[float]:
    """Return the two factors of safety that a run prints."""
    assert main(["run", str(case.path), "-o", str(tmp_path / "out"), "--force"]) == 0
    printed = capsys.readouterr().out
    (found,) = re.findall(r"stands with F = ([\d.]+).*falls at F = ([\d.]+)", printed)
    return [float(text) for text in found]


@pytest.mark.long
@pytest.mark.serial
def test_strata_and_regions_of_the_same_ground_have_the_same_factor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    low, high = factors(case(tmp_path, STRATA), tmp_path, capsys)
    assert low < high < 1.4 * low
    other = factors(case(tmp_path, REGIONS), tmp_path, capsys)
    assert other == pytest.approx([low, high], rel=1e-2)


def bounds_at_one(case: Case) -> list[float]:
    """Return the bounds on the factor of all loads on the first mesh."""
    problem = case.problem(MPI.COMM_WORLD)
    loads: list[Any] = list(problem.given.loads)
    live = [replace(load, constant=False) for load in loads]
    found = limit_bounds(variant(problem, loads=live))
    assert found.lower.value is not None and found.upper.value is not None
    return [found.lower.value, found.upper.value]


@pytest.mark.serial
def test_a_slope_under_water_has_the_factor_of_its_buoyant_weight(tmp_path: Path) -> None:
    """Any water depth gives the same factor: pressures differ by hydrostatic pressures."""
    soil = {"fill": (10.0, 15.0), "clay": (15.0, 10.0)}
    buoyant = case(tmp_path, REGIONS, **soil).text.replace("19.0", "9.19")
    found = []
    for text in (buoyant, *(WET.format(level) for level in (35.0, 50.0))):
        head = buoyant.replace("9.19", "18.0") + text if text is not buoyant else buoyant
        (tmp_path / "slope.toml").write_text(head, encoding="utf-8")
        found.append(bounds_at_one(read_case(tmp_path / "slope.toml")))
    assert found[0][0] < found[0][1] < 2 * found[0][0]
    assert found[1] == pytest.approx(found[0], rel=1e-4)
    assert found[2] == pytest.approx(found[0], rel=1e-4)


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        (LOADED, r"\[\[line\]\]: a line needs ground"),
        (REGIONS + "[[region]]\nname = 'x'\n", r"\[\[region\]\] number 3: 'points' is missing"),
        (REGIONS.replace("[70, 31], [70, 35]", "[70, 30], [70, 35]"), "'fill' and 'clay' overlap"),
        (REGIONS + "[[stratum]]\nname = 'a'\ntop = 3\n", "top = 3 cannot be used"),
        (REGIONS + WET.format(30.0) + "[seepage]\n", r"\[water\]: the case also has \[seepage\]"),
    ],
)
@pytest.mark.serial
def test_what_is_refused_before_it_is_meshed(tmp_path: Path, drawn: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        case(tmp_path, drawn)


@pytest.mark.parametrize("other", ['mesh.file = "a.msh"', 'geometry.file = "a.step"'])
@pytest.mark.serial
def test_a_mesh_or_file_beside_drawn_ground_is_refused(tmp_path: Path, other: str) -> None:
    text = case(tmp_path, REGIONS).text
    (tmp_path / "slope.toml").write_text(f"{other}\n{text}", encoding="utf-8")
    with pytest.raises(InputError, match=r"draws ground .*; remove one"):
        read_case(tmp_path / "slope.toml")


DRAWN = sorted((Path(__file__).parents[2] / "demos/verification/drawn_ground").glob("*.toml"))


@pytest.mark.serial
@pytest.mark.parametrize("path", DRAWN, ids=lambda path: path.stem)
def test_published_slopes_take_25_lines(path: Path) -> None:
    read = read_case(path)
    assert read.text.count("\n") <= 25 and ".geo" not in read.text
    assert isinstance(read.mesh, GroundInCase) and "Surface" in read.mesh.ground.script()
