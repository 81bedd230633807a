"""Test sheets in plane stress: exact rings, four algorithms, bounds, case files, refusals."""

import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.ring import write_ring
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    BorderedNewton,
    Contact,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    WorkNewton,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.proof import check
from tests.functional.test_command_line import one_line, write
from tests.functional.test_ground import solved
from tests.models import Read

YIELD = 100.0
STEEL = VonMises(2e5, 0.3, YIELD)
HELD = [Support("x0", "x"), Support("y0", "y")]
SPIN = BodyForce("tube", ("x", "y"))


def ring(mesh: TaggedMesh, *loads: Any, contacts: Any = ()) -> Problem:
    """Return a quarter of a sheet, held by symmetry."""
    materials = dict.fromkeys(mesh.volumes, STEEL)
    return Problem(mesh.thin(), materials, HELD, loads, contacts, degree=2)


@pytest.mark.parametrize(
    ("outer", "load", "exact"),
    [
        (1.5, Pressure("inner", 1.0), 0.43931297),
        (2.0, Pressure("inner", 1.0), 0.76975779),
        (2.0, SPIN, 0.443602),
    ],
)
def test_rings_fail_at_the_exact_load(read: Read, outer: float, load: Any, exact: float) -> None:
    """Exact loads for von Mises' law follow from a differential equation along the radius."""
    mesh = read(write_thick_tube, outer=outer, size=0.1, order=2)
    found = limit_load(ring(mesh, load), 1e-5)
    assert found.estimate == pytest.approx(exact * YIELD, rel=1e-3)


def test_path_and_interior_point_agree(read: Read) -> None:
    mesh = read(write_thick_tube, outer=2.0, size=0.3, order=2)
    problem = ring(mesh, Pressure("inner", 1.0))
    by_path, at_once = (limit_load(problem, 1e-4, method=it) for it in ("path", "interior-point"))
    assert by_path.estimate == pytest.approx(at_once.estimate, rel=3e-4)


def test_the_four_algorithms_agree(read: Read) -> None:
    """The bodies are two rings in contact, one in the other."""

    def problem() -> Problem:
        mesh = read(write_thick_tube, outer=2.0, interface=1.4, size=0.3, order=2)
        seam = [Contact("inner_tube_seam", "outer_tube_seam")]
        return ring(mesh, Pressure("inner", 1.0), contacts=seam)

    zeta, sharp = 70.0, NewtonOptions(tolerance=1e-11)
    newton = solved(Newton(problem(), sharp).solve(zeta))
    assert newton.report.plastic_fraction > 0.2
    across = newton.stress.x.array.reshape(-1, 4)[:, 2]
    assert not across.any()
    alpha, displacement = newton.report.alpha, newton.state.u.x.array.copy()
    work = solved(WorkNewton(problem(), sharp).solve(alpha))
    assert work.report.zeta == pytest.approx(zeta, rel=1e-7)
    tight = AugmentedLagrangianOptions(tolerance=1e-10)
    uzawa = solved(AugmentedLagrangian(problem(), tight).solve(zeta))
    scale = np.abs(displacement).max(initial=0)
    assert np.abs(uzawa.state.u.x.array - displacement).max(initial=0) <= 1e-5 * scale
    bordered = solved(BorderedNewton(problem(), sharp).solve(alpha))
    assert bordered.report.zeta == pytest.approx(zeta, rel=1e-7)


def test_strict_bounds_of_a_ring(read: Read) -> None:
    """Bounds for a polygon bracket the limit load of its mesh; the upper bound is close to it."""
    problem = ring(read(write_thick_tube, outer=2.0, size=0.1), Pressure("inner", 1.0))
    bounds, found = limit_bounds(problem), limit_load(problem, 1e-5)
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None
    assert low < found.estimate < high * (1 + 1e-5)
    assert high == pytest.approx(0.76975779 * YIELD, rel=1e-3)
    assert high - low <= 0.06 * high


def test_strict_bounds_of_sheets_in_contact(read: Read) -> None:
    """Sheets pressed on each other from the side carry the yield stress, without confinement."""
    mesh = read(write_ring, interface=1.5, size=0.3)
    weak, strong = VonMises(2e5, 0.3, YIELD), VonMises(2e5, 0.3, 2 * YIELD)
    problem = Problem(
        mesh.thin(2.0),
        {"inner_ring": weak, "outer_ring": strong},
        [Support("inner", "x"), Support("bottom", "y")],
        [Pressure("outer", 1.0)],
        [Contact("inner_ring_seam", "outer_ring_seam")],
        degree=2,
    )
    bounds = limit_bounds(problem, 1e-5)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(YIELD, rel=1e-5)
    assert bounds.upper.value == pytest.approx(YIELD, rel=1e-5)


CASE = """
[mesh]
file = "ring.msh"
[model]
kind = "plane-stress"
thickness = 4.0
[material.ring]
law = "hill"
young = 2e5
poisson = 0.3
yield_stress = 300.0
r11 = 0.8
r22 = 0.9
[[support]]
on = "bottom"
components = "y"
[[support]]
on = "inner"
components = "x"
[[load]]
on = "top"
force = [0.0, 100.0]
[output]
pictures = false
[element]
degree = 2
[loading]
"""
LIMIT = 0.9 * 300.0 * 4.0 * 1.0 / 100.0
"""Limit load from r22, for the width 1 and the thickness."""


def ran(comm: MPI.Intracomm, folder: Path, loading: str, *more: str) -> dict[str, Any]:
    """Run a ring with a loading, and return the summary. Collective."""
    if comm.rank == 0:
        write_ring(folder / "ring.msh", size=0.5)
    case = write(comm, folder, CASE + loading)
    assert main(["run", str(case), "-o", str(folder / "r"), *more]) == SOLVED
    text = (folder / "r" / "summary.json").read_text() if comm.rank == 0 else ""
    found: dict[str, Any] = json.loads(comm.bcast(text))
    return found


def test_a_strip_of_rolled_metal_to_its_page(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bounds and proof are exact: a uniform stress, multiplied by the thickness."""
    found = ran(comm, shared_tmp_path, 'control = "bounds"\n', "--report")["limit"]
    out, err = capsys.readouterr()
    assert err == ""
    assert found["lower"] == pytest.approx(LIMIT, rel=1e-5)
    assert found["upper"] == pytest.approx(LIMIT, rel=1e-5)
    checked = check(shared_tmp_path / "r" / "bounds.h5")
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())
    if comm.rank == 0:
        assert ", P2, plane stress, " in out
        page = (shared_tmp_path / "r" / "report.html").read_text(encoding="utf-8")
        assert "plane stress: sheets" in page


def test_levels_and_forces_for_each_unit_of_thickness(
    comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    found = ran(comm, shared_tmp_path, "values = [5.0]\n")
    assert found["model"]["kind"] == "plane-stress"
    assert found["model"]["forces"] == "per unit of thickness"
    last = found["steps"][-1]
    assert last["reactions"]["support bottom"] == pytest.approx([0.0, -125.0], abs=1e-8)
    # a force of 125 stretches a height of 0.5 and a width of 1, whose sides are free
    assert last["alpha"] == pytest.approx(25.0 * 125.0 / 2e5 * 0.5, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('file = "ring.msh"', 'builder = "punch"\nn = 2', ["[model]", "tetrahedra", "remove kind"]),
        ("4.0", "-1.0", ["thickness = -1.0", "positive"]),
        ('kind = "plane-stress"\n', "", ["thickness = 4.0", "kind is 'plane-strain'"]),
        ('"hill"', '"tresca"\ncohesion = 1.0', ["'ring'", "Tresca", "plane stress"]),
        ("force = [0.0, 100.0]", "pressure = 1.0\n[[load]]\non = 'ring'\npore_pressure = 1.0",
         ["pore pressure", "plane stress"]),
    ],
)  # fmt: skip
def test_one_sentence_and_status_2(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    old: str,
    new: str,
    words: list[str],
) -> None:
    if comm.rank == 0:
        write_ring(shared_tmp_path / "ring.msh", size=0.5)
    text = CASE.replace(old, new) + "values = [1.0]\n"
    if "tresca" in new:
        text = text.replace("yield_stress = 300.0\nr11 = 0.8\nr22 = 0.9\n", "")
    case = write(comm, shared_tmp_path, text)
    assert main(["check", str(case)]) == BAD_INPUT
    sentence = one_line(comm, capsys)
    for word in words:
        assert word in sentence, sentence
