"""Test the words, marks and the curve of the page."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx.contact.declared.obstacles import Cylinder, Plane, Sphere
from perfplast_fenicsx.formulas import WordedFormula
from perfplast_fenicsx.io.results.result_folder import given_table
from perfplast_fenicsx.io.results.summary import Summary
from perfplast_fenicsx.outcome_words import force_rows
from perfplast_fenicsx.pictures.result_reader import StoredLimit
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.problem.declared.loads import (
    Bearing,
    BodyForce,
    FieldPores,
    Force,
    ForceBelow,
    PorePressure,
    Pressure,
    Traction,
)
from perfplast_fenicsx.problem.declared.supports import RigidSurface
from perfplast_fenicsx.proof.verdict import Checked
from perfplast_fenicsx.report.case_words import CaseWords, folded
from perfplast_fenicsx.report.curve import NARROW, curve_of, far_ticks, ticks, to_svg
from perfplast_fenicsx.report.page import _warnings, command_of, head_of, mesh_in_words
from perfplast_fenicsx.report.proof_section import proof_section
from perfplast_fenicsx.report.tables import (
    bolt_table,
    force_table,
    grade,
    level_table,
    pairs,
    reaction_table,
)
from perfplast_fenicsx.report.view_data import words_of
from perfplast_fenicsx.units import Units
from tests.io.results.test_result_folder import report

pytestmark = pytest.mark.serial

GIVEN: dict[str, Any] = {
    "materials": {
        "a<b": {"kind": "von-mises", "young": 2e5, "yield_stress": 300.0, "expansion": 0.0},
        "c": {"kind": "Flow", "body": {"kind": "Soft", "isotropic": 5.0, "odd_one": 7}},
    },
    "supports": [
        {"on": "left", "components": "xz", "value": 0.0, "constant": True},
        {"on": "right", "components": "y", "value": -0.5, "constant": False},
    ],
    "loads": [
        {"kind": "pressure", "on": "top", "value": "3*x", "name": "", "constant": False},
        {"kind": "body_force", "on": "c", "value": [0, -2.5], "name": "w", "constant": True},
    ],
    "contacts": [{"primary": "p", "secondary": "s", "gap": None, "coulomb": 0.3}],
    "obstacles": [{"kind": "plane", "on": "top", "move": [0, -1], "tresca": None}],
    "ties": [{"primary": "p", "secondary": "q"}],
    "rigid": [],
    "initial": [{"kind": "temperature", "on": "c", "change": 20.0}],
}


def test_the_case_in_words() -> None:
    words = CaseWords(GIVEN, Units("mm", "MPa").table(whole=False), "rz")
    assert words.bodies() == [
        (
            "a<b",
            "elastic, perfectly plastic (von Mises): Young's modulus 200000 MPa, yield stress 300"
            " MPa",
        ),
        (
            "c",
            "Soft; keeps plastic strains from level to level: isotropic hardening 5 MPa, odd one 7",
        ),
    ]
    held, moved = words.supports()
    assert held == ("left", "held in r")
    assert moved == ("right", "moved by -0.5 mm in z, times ζ")
    assert words.loads() == [
        ("top", "pressure 3*x MPa, times ζ"),
        ("c", "w: force per volume (0, -2.5) N/mm^3, constant"),
        ("c", "change of temperature 20"),
    ]
    assert words.contacts() == [
        ("p – s", "contact, friction coefficient 0.3 (Coulomb), gap measured in the mesh"),
        ("top", "rigid plane, without friction, moves by (0, -1) mm times ζ"),
        ("p – q", "glued together"),
    ]
    assert words.number([1, -0.0], "force") == "(1, 0) N/mm"
    turned = {"kind": "force", "on": "lid", "value": [], "moment": 3.0, "constant": False}
    both = turned | {"value": [0, -2.5]}
    assert CaseWords({"loads": [turned, both]}, Units("mm", "MPa").table(False), "xy").loads() == [
        ("lid", "moment 3 N mm/mm, times ζ"),
        ("lid", "force (0, -2.5) N/mm and moment 3 N mm/mm, times ζ"),
    ]
    wet = {"kind": "ForceBelow", "on": "c", "value": [0, -1.5], "constant": True, "depth": "-y"}
    assert CaseWords({"loads": [wet]}, Units("m", "kPa").table(False), "xy").loads() == [
        ("c", "force per volume below a line (0, -1.5) kN/m^3, where -y > 0, constant")
    ]
    assert CaseWords(GIVEN, {}, "xy").number(2.0, "force") == "2"
    staged = CaseWords(GIVEN, {}, "rz", staged=True)
    assert "times ζ" not in str(staged.loads() + staged.supports() + staged.contacts())
    assert "times its factor" in str(staged.loads())
    assert "&lt;" in pairs(words.bodies())
    stones = CaseWords({"materials": {"a": {"kind": "rigid"}, "b": {"kind": "rigid"}}}, {}, "xy")
    assert stones.bodies() == [("a", "rigid"), ("b", "rigid")]
    assert "Taken as rigid: a, b." in stones.assumptions("plane-strain", (), True)


def test_loads_are_told_as_declared() -> None:
    """No point of application, total or line below which a load acts is left out."""
    depth = WordedFormula("8 - y", "the ground is below the water table")
    under_water = WordedFormula("10*maximum(8 - y, 0)", "10 kN/m^3 times the depth")
    told = {
        "force (0, -5) kN/m and moment 2 kN m/m at the point (1, 3) m": Force(
            "top", (0.0, -5.0), 2.0, (1.0, 3.0)
        ),
        "evenly spread force (0, -5) kN/m": Traction("top", (0.0, -5.0), total=True),
        "traction (0, -5*x) kPa": Traction("top", (0.0, "-5*x")),
        "bearing force (0, -5) kN/m": Bearing("top", (0.0, -5.0)),
        "pressure 10*maximum(8 - y, 0) kPa": Pressure("top", str(under_water)),
        "pressure, 10 kN/m^3 times the depth": Pressure("top", under_water),
        "water pressure in the pores, 10 kN/m^3 times the depth": PorePressure("a", under_water),
        "pore pressure of steady seepage": FieldPores("a", "steady seepage"),
        "force per volume (0, -20) kN/m^3": BodyForce("a", (0.0, -20.0)),
        "force per volume below a line (0, -2) kN/m^3, where the ground is below the water table": (
            ForceBelow("a", (0.0, -2.0), depth=depth)
        ),
    }
    loads = [replace(load, name="p", constant=False) for load in told.values()]
    given = given_table(Given({}, [], loads, [], [], 2, [], [], []))
    assert given["loads"][5]["value"] == str(under_water)
    words = CaseWords(given, Units("m", "kPa").table(whole=False), "xy")
    assert [text for _, text in words.loads()] == [f"p: {text}, times ζ" for text in told]


def test_obstacles_and_rigid_surfaces_are_told_as_declared() -> None:
    """No place, size or motion is left out."""
    obstacles = {
        "rigid plane through (0, 0) mm with the normal (0, 1)": Plane("a", (0, 0), (0, 1)),
        "rigid hollow sphere of radius 5 mm around (1, 2, 3) mm": Sphere("a", (1, 2, 3), 5, True),
        "rigid cylinder of radius 5 mm around the axis through (0, 0, 1) mm along (1, 0, 0)": (
            Cylinder("a", (0, 0, 1), (1, 0, 0), 5)
        ),
    }
    surfaces = {
        "is free to move": RigidSurface("b"),
        "moves without turning, held in x": RigidSurface("b", held="x"),
        "moved by (0, 0, -1) mm, times ζ": RigidSurface(
            "b", displacement=(0, 0, -1), constant=False
        ),
        "moved by (0, 0, 0) mm and turned by (0, 0, 0.1) rad about (1, 2, 3) mm in x, y": (
            RigidSurface("b", (1, 2, 3), (0, 0, 0), (0, 0, 0.1), "xy")
        ),
    }
    given = given_table(
        Given({}, [], [], [], [*obstacles.values()], 2, [], [], [*surfaces.values()])
    )
    words = CaseWords(given, Units("mm", "MPa").table(), "xyz")
    assert [text for _, text in words.contacts()] == [
        f"{one}, without friction" for one in obstacles
    ]
    assert words.supports() == [("b", f"rigid, {one}") for one in surfaces]


def test_each_load_of_an_envelope_has_its_own_factor() -> None:
    summary = Summary("", "1", "bounds", "alpha", 1, {}, {"axes": "xy"}, given=GIVEN)
    summary.limit = {"envelope": {"names": ["top"]}}
    words = CaseWords.of(summary)
    assert words.loads()[0][1].endswith(", times its factor")
    assert words.meaning(driven=False).startswith("A factor of 1 is pressure 3*x")


def test_the_load_factor_in_words() -> None:
    words = CaseWords(GIVEN, Units("mm", "MPa").table(), "xyz")
    assert words.meaning(driven=False) == "ζ is the load factor: ζ = 1 is pressure 3*x MPa on top."
    assert "motions of supports" in words.meaning(driven=True)
    assert "ζ is the time" in CaseWords(GIVEN, {}, "xy", staged=True).meaning(driven=False)
    assert CaseWords({"loads": GIVEN["loads"][1:]}, {}, "xy").meaning(driven=False) == ""
    many = CaseWords({"loads": 7 * GIVEN["loads"][:1]}, {}, "xy").meaning(driven=False)
    assert many.endswith("pressure 3*x on top and 3 more loads.")


def test_the_mesh_is_that_of_the_results() -> None:
    size = {"cells": 80, "vertices": 55, "dofs": 378}
    summary = Summary("", "1", "bounds", "alpha", 1, size, {}, given={"degree": 2})
    one = "80 cells, 55 vertices, 378 unknowns"
    assert mesh_in_words(summary) == f"{one}, elements of degree 2"
    summary.limit = {"body": {"meshes": [{"cells": 80}, {"cells": 3982}]}}
    assert mesh_in_words(summary) == (
        f"3982 cells, the last of 2 meshes, elements of degree 2; the first mesh: {one}"
    )
    summary.limit = {"strength": {"cells": [80, 97]}, "body": {"meshes": []}}
    assert mesh_in_words(summary).startswith("97 cells, the last of 2 meshes")
    summary.limit = {"body": None}
    assert mesh_in_words(summary).startswith(one)


def test_fields_that_nobody_knows_keep_their_names() -> None:
    assert words_of("my_own_field", {}).label == "my own field"


@pytest.mark.parametrize(
    ("value", "sign"), [(1e-14, "✓"), (-1e-7, "✓"), (1e-4, "≈"), (-0.5, "✗"), (np.nan, "✗")]
)
def test_grades(value: float, sign: str) -> None:
    assert grade(value).sign == sign


def test_levels_that_failed_have_no_certificates() -> None:
    text = level_table([report(1.0), report(2.0, converged=False)], driven=False)
    first, second = text.split("<tr>")[2:]
    assert first.count("mark ") == 5
    assert second.count("mark bad") == second.count("mark ") == 1
    assert "no solution" in second
    told = level_table([report(1.0)], False, "kN m", "m")
    assert "work α (kN&nbsp;m)" in told
    assert "largest displacement (m)" in told


def test_forces_of_rounding_are_none() -> None:
    text = reaction_table({"loads": [-5.0, 1e-14], "support a": [5.0, -1e-8]}, "xy", "N")
    assert re.findall(r"<td>([^<]*)</td>", text) == ["-5", "0", "5", "-1e-08"]
    assert "y (N)" in text


def test_forces_of_bolts() -> None:
    """The table has a row for each solved level, and a column for each bolt."""
    told = [report(a, bolts={"<m12>": 10 * a, "pin": -a}) for a in (0.5, 1.0)]
    text = bolt_table([*told, report(2.0, converged=False, bolts={})], "kN")
    assert re.findall(r"<td>([^<]*)</td>", text) == ["0.5", "5", "-0.5", "1", "10", "-1"]
    assert "&lt;m12&gt; (kN)" in text
    assert bolt_table([report(1.0)], "kN") == ""


def test_a_curve() -> None:
    plain: dict[str, Any] = {"stage": "", "factors": {}, "works": {}}
    reports = [report(1.0, alpha=1.0, **plain), report(2.0, alpha=3.0, **plain)]
    reports += [report(5.0, converged=False, **plain)]
    curve = curve_of(reports, StoredLimit(2.0, 2.1, 2.2, {}), False, "J")
    assert curve is not None
    (line,) = curve.lines
    assert line.x == pytest.approx([0, 1, 3])
    assert line.y == pytest.approx([0, 1, 2])
    assert curve.x_label.endswith("(J)")
    svg = to_svg(curve)
    assert svg.count("<circle") == 3
    assert "estimate on this mesh: 2 to 2.2" in svg
    assert 'role="img"' in svg
    places = re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', svg)
    x, y = np.array(places, dtype=float).T
    assert (x[1] - x[0]) * 2 == pytest.approx(x[2] - x[1], abs=0.3)
    assert y[0] - y[1] == pytest.approx(y[1] - y[2], abs=0.3)
    assert curve_of(reports[2:], None, False, "") is None
    narrow = to_svg(curve, NARROW)
    assert narrow.count("<circle") == 3
    assert max(float(x) for x in re.findall(r'cx="([\d.]+)"', narrow)) <= NARROW.width
    endless = [*reports, report(3.0, alpha=np.inf, **plain)]
    assert curve_of(endless, StoredLimit(2.0, 2.1, 2.2, {}), False, "J") == curve
    staged = curve_of([report(1.0), report(2.0)], None, False, "")
    assert staged is not None
    assert [line.name for line in staged.lines] == ["water"]


def test_a_curve_that_goes_far_is_shown_near_its_start() -> None:
    plain: dict[str, Any] = {"stage": "", "factors": {}, "works": {}}
    reports = [report(1.0, alpha=a, **plain) for a in (1.0, 10.0, 1000.0)]
    curve = curve_of(reports, None, False, "")
    assert curve is not None
    x = [float(a) for a in re.findall(r'cx="([\d.]+)"', to_svg(curve))]
    assert x[1] - x[0] > 0.1 * (x[-1] - x[0])
    assert curve.x_label.endswith(", logarithmic axis")
    assert far_ticks(1.0, 1000.0) == pytest.approx([0, 1, 10, 100, 1000])
    assert far_ticks(0.03, 0.9) == pytest.approx([0, 0.05, 0.1, 0.2, 0.5])


@pytest.mark.parametrize(("low", "high"), [(0, 1), (-3, 7e6), (-1e-9, 0), (99, 101)])
def test_ticks(low: float, high: float) -> None:
    found = ticks(low, high)
    assert 3 <= len(found) <= 8
    slack = 1e-9 * (high - low)
    assert low - slack <= found[0] <= found[-1] <= high + slack


def test_how_to_run_it_again() -> None:
    options = "-perfplast_0_ksp_type cg -perfplast_ksp_rtol 1e-10 -perfplast_vi_12_x 3"
    options += " -perfplast_limit_0_pc_type lu -perfplast_mg_levels_1_pc_type jacobi"
    summary = Summary("", "1", "newton", "zeta", ranks=2, mesh={}, model={})
    assert command_of(summary) == ""
    summary.case["file"] = "my case.toml"
    summary.surroundings["petsc_options"] = options
    assert command_of(summary) == (
        "mpirun -n 2 perfplast run 'my case.toml' -o results -- -perfplast_ksp_rtol 1e-10"
        " -perfplast_mg_levels_1_pc_type jacobi"
    )
    summary.surroundings["command"] = "perfplast run 'my case.toml' -o here --report"
    assert command_of(summary) == (
        "mpirun -n 2 perfplast run 'my case.toml' -o here --report -- -perfplast_ksp_rtol 1e-10"
        " -perfplast_mg_levels_1_pc_type jacobi"
    )


def test_where_the_proof_is(tmp_path: Path) -> None:
    assert proof_section(tmp_path, {}) == ""
    proofs = {}
    for name in ("direction_0.h5", "direction_45.h5", "bounds.h5"):
        (tmp_path / name).write_bytes(name.encode())
        proofs[name] = {"lower": Checked("lower", 1.25, 1.25, {}, ())}
    page = proof_section(tmp_path, dict(sorted(proofs.items())))
    assert "<dd>a stress that proves the lower bound: lower bound 1.25 proven" in page
    assert f"python3 -m perfplast_fenicsx.proof {tmp_path / 'bounds.h5'}" in page
    assert hashlib.sha256(b"bounds.h5").hexdigest() in page
    assert "2 directions: all are proven" in page
    assert hashlib.sha256(b"direction_0.h5direction_45.h5").hexdigest() in page


def test_pages_start_no_mpi() -> None:
    """Pages are made in one process: their modules import neither PETSc nor MPI."""
    program = "import sys, perfplast_fenicsx.report.page; print(*sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert not {"petsc4py", "mpi4py.MPI", "dolfinx"} & set(found.stdout.split())


def test_rows_that_say_the_same_are_one() -> None:
    rows = [("a", "steel"), ("b", "brass"), ("c", "steel"), ("d", "steel"), ("e", "brass")]
    told = [("3 bodies", "steel: a, c, d"), ("b", "brass"), ("e", "brass")]
    assert folded(rows, "bodies") == told


def test_what_was_warned_of_is_on_the_page() -> None:
    summary = Summary("", "1", "newton", "zeta", ranks=1, mesh={}, model={})
    assert _warnings(summary) == ""
    summary.warnings, summary.remarks = ["loosely held: 'a<b'"], ["friction is steep"]
    text = _warnings(summary)
    assert "<li>Loosely held: &#x27;a&lt;b&#x27;.</li><li>Friction is steep.</li>" in text


def test_the_head_says_whose_computation_it_is() -> None:
    summary = Summary("", "1", "newton", "zeta", ranks=1, mesh={}, model={})
    summary.surroundings["began"] = "2026-03-01 10:00:00 UTC"
    assert head_of(summary) == ""
    summary.report = {"project": "Pipes & <b>vessels", "author": "A. Ünal"}
    found = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", head_of(summary))
    assert found == [
        ("Project", "Pipes &amp; &lt;b&gt;vessels"),
        ("Author", "A. Ünal"),
        ("Date", "2026-03-01 10:00:00 UTC"),
    ]
    del summary.surroundings["began"]
    assert "Date" not in head_of(summary)


def test_forces_of_a_limit_load() -> None:
    load = {"name": "push", "on": "push", "constant": False, "force": [3.0, 1e-15], "moment": [7.0]}
    rows = force_rows([load], 2.0000001, 3.0, None, zeta="ζ")
    assert rows == [
        ("load push, ζ = 1", [3.0, 0.0]),
        ("load push, ζ = 2, carried for certain", [6.0, 0.0]),
        ("load push, ζ = 3, collapse for certain", [9.0, 0.0]),
    ]
    text = force_table("force", "xy", "N/mm", rows)
    assert '<th scope="col">x (N/mm)</th>' in text
    assert "<td>6</td><td>0</td>" in text
