"""Test Drucker–Prager materials in all four algorithms, with contact, and from case files."""

import json
import math
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from demos.verification.ground import FOOTINGS, footing_limit
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    AugmentedLagrangian,
    BorderedNewton,
    Contact,
    DruckerPrager,
    Level,
    LimitLoad,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    VonMises,
    WorkNewton,
    limit_load,
    stacked_blocks,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.materials.drucker_prager import Match
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression
from perfplast_fenicsx.proof import check
from tests.functional.test_command_line import one_line, write
from tests.models import Read

pytestmark = pytest.mark.usefixtures("undrawn")

COHESION, ANGLE = 10.0, 30.0
TIP = COHESION / math.tan(math.radians(ANGLE))
EXACT = TIP * (2.0 ** (2 / 3) - 1)
"""Exact limit pressure of the tube with b/a = 2 and φ = 30°."""

CASE = """
[mesh]
file = "tube.msh"
[material.tube]
law = "drucker-prager"
young = 1e5
poisson = 0.3
cohesion = 10.0
friction_angle = 30.0
match = "plane-strain"
[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[load]]
on = "inner"
pressure = 1.0
[element]
degree = 2
[loading]
LOADING
"""


def divided_tube(read: Read, sign: float = 1.0, outside: float = 0.0) -> Problem:
    """Return two tubes in contact, one in the other."""
    tagged_mesh = read(write_thick_tube, outer=2.0, interface=1.4, size=0.3, order=2)
    ground = DruckerPrager(1e5, 0.3, COHESION, ANGLE, "plane-strain")
    loads = [Pressure("inner", sign), Pressure("outer", outside, constant=True)]
    return Problem(
        tagged_mesh,
        {"inner_tube": ground, "outer_tube": ground},
        [Support("x0", "x"), Support("y0", "y")],
        loads[: 2 if outside else 1],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=2,
    )


def solved(level: Level) -> Level:
    assert level.report.converged, level.report.reason
    assert abs(level.report.duality_gap) < 1e-9
    assert level.report.equilibrium < 1e-7
    return level


@pytest.mark.long(but=["-1.0-10.0"])
@pytest.mark.parametrize(("sign", "outside"), [(1.0, 0.0), (-1.0, 10.0)])
def test_the_four_algorithms_agree(read: Read, sign: float, outside: float) -> None:
    """The tube bursts, or outer pressure crushes it while the inner pressure becomes a tension."""
    problem = divided_tube(read, sign, outside)
    zeta = 9.5 if sign > 0 else 0.9 * limit_load(problem, 1e-3).lower
    sharp = NewtonOptions(tolerance=1e-11)
    newton = solved(Newton(problem, sharp).solve(zeta))
    assert newton.report.plastic_fraction > 0.3
    alpha, displacement = newton.report.alpha, newton.state.u.x.array.copy()
    work = solved(WorkNewton(divided_tube(read, sign, outside), sharp).solve(alpha))
    assert work.report.zeta == pytest.approx(zeta, rel=1e-7)
    uzawa = solved(AugmentedLagrangian(divided_tube(read, sign, outside)).solve(zeta))
    scale = np.abs(displacement).max(initial=0)
    assert np.abs(uzawa.state.u.x.array - displacement).max(initial=0) <= 1e-5 * scale
    bordered = solved(BorderedNewton(divided_tube(read, sign, outside), sharp).solve(alpha))
    assert bordered.report.zeta == pytest.approx(zeta, rel=1e-7)


def test_limit_load_is_the_exact_one(read: Read) -> None:
    """The interior point method also gives a mechanism; the path knows no upper bound."""
    found = limit_load(divided_tube(read), 1e-5)
    assert found.method is LimitMethod.INTERIOR_POINT
    assert found.levelled_off, found.reason
    assert found.estimate == pytest.approx(EXACT, rel=5e-4)
    assert found.upper is not None
    assert 0 <= found.upper - found.lower <= 1e-5 * found.lower
    assert found.iterations < 12
    path = limit_load(divided_tube(read), 1e-4, method="path")
    assert path.levelled_off, path.reason
    assert path.estimate == pytest.approx(found.estimate, rel=1e-4)
    assert path.upper is None


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("match", ["compression", "extension", "plane-strain"])
def test_blocks_in_space(match: Match, degree: int) -> None:
    """Stress and strain are uniform: the pressure at which uniaxial stress reaches the cone."""
    ground = DruckerPrager(1e5, 0.3, COHESION, ANGLE, match)
    mesh = stacked_blocks(MPI.COMM_WORLD, 2)
    supports = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
    contacts = [Contact("upper_bottom", "lower_top")]
    loads = [Pressure("top", 1.0)]
    problem = Problem(
        mesh, dict.fromkeys(mesh.volumes, ground), supports, loads, contacts, degree=degree
    )
    found = limit_load(problem, 1e-5)
    slope, strength = ground.cone
    exact = strength / (1 / math.sqrt(3) - slope / 3)
    assert found.lower == pytest.approx(exact, rel=1e-5)
    assert found.upper == pytest.approx(exact, rel=1e-5)
    assert_admissible(problem, found)


def assert_admissible(problem: Problem, found: LimitLoad) -> None:
    """No stress violates the yield condition, and the mechanism dilates wherever it shears."""
    assert found.stress is not None
    gauge = fem.Function(problem.Q)
    law = LawExpression(problem.laws, problem.Q, lambda on: on.law.yields.gauge(found.stress))
    law.interpolate(gauge)
    count = problem.Q.dofmap.index_map.size_local
    assert gauge.x.array[:count].max(initial=0.0) <= 1 + 1e-9
    strains = PointStrains(problem)
    trace, deviator = strains.of_function(found.mechanism)
    rates = np.linalg.norm(deviator, axis=1)
    assert (trace - strains.slopes * rates).min(initial=0.0) >= -1e-9 * rates.max(initial=0.0)
    strains.destroy()


@pytest.mark.parametrize(("angle", "off"), [(10.0, 0.006), (30.0, 0.011)])
def test_a_strip_footing(read: Read, angle: float, off: float) -> None:
    """Prandtl's wedge and spirals give N_c = 8.34 and 30.1 on less than 400 cells."""
    width, depth = FOOTINGS[angle]
    mesh = read(write_strip_footing, width=width, depth=depth, grading=20.0, size=0.5)
    ground = DruckerPrager(1e4, 0.3, COHESION, angle, "plane-strain")
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    problem = Problem(mesh, {"ground": ground}, supports, [Pressure("footing", 1.0)], degree=2)
    found = limit_load(problem)
    exact = footing_limit(angle)
    assert found.levelled_off
    assert found.iterations < 20
    assert found.lower <= found.upper
    assert exact * (1 - 1e-3) < found.lower < (1 + off) * exact
    assert_admissible(problem, found)


@pytest.mark.long(but=["False"])
@pytest.mark.parametrize("outer", [True, False])
def test_beside_von_mises(read: Read, outer: bool) -> None:
    """Bodies that preserve volume touch bodies that dilate; the path agrees."""
    problem = divided_tube(read)
    ground = problem.given.materials["inner_tube"]
    laws = {"inner_tube": ground, "outer_tube": ground}
    laws["outer_tube" if outer else "inner_tube"] = VonMises(1e5, 0.3, 30.0)
    problem = Problem.from_given(problem.tagged_mesh, replace(problem.given, materials=laws))
    found = limit_load(problem, 1e-4)
    assert found.upper is not None
    assert found.upper - found.lower <= 1e-4 * found.lower
    path = limit_load(problem, 1e-4, method="path")
    assert path.estimate == pytest.approx(found.estimate, rel=2e-4)
    assert_admissible(problem, found)


@pytest.mark.long
def test_confined_ground_is_said_to_be_confined(read: Read) -> None:
    """A tube with held outer face dilates against it: it carries any load, and nothing locks."""
    tagged_mesh = read(write_thick_tube, outer=2.0, size=0.3)
    ground = DruckerPrager(1e5, 0.3, COHESION, ANGLE, "plane-strain")
    supports = [Support("x0", "x"), Support("y0", "y"), Support("outer")]
    loads = [Pressure("inner", 1.0)]
    problem = Problem(tagged_mesh, {"tube": ground}, supports, loads)
    steps = limit_load(problem, 1e-2)
    assert not steps.levelled_off
    assert steps.upper is None
    assert "dilate" in steps.reason
    found = limit_load(problem, 1e-2, method="path")
    assert not found.levelled_off
    assert found.lower > 100 * EXACT
    assert "dilate" in found.reason
    assert "lock" not in found.reason


def case(comm: MPI.Intracomm, folder: Path, loading: str, **changes: str) -> Path:
    """Write a case and its mesh."""
    if comm.rank == 0:
        write_thick_tube(folder / "tube.msh", outer=2.0, size=0.3, order=2)
    text = CASE.replace("LOADING", loading)
    for key, value in changes.items():
        text = "\n".join(
            f"{key} = {value}" if line.startswith(f"{key} =") else line
            for line in text.splitlines()
        )
    return write(comm, folder, text)


def test_a_case_file_runs_to_the_limit_load(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = case(comm, shared_tmp_path, 'control = "work"\nuntil = "limit"\nlimit_tolerance = 1e-3')
    results = shared_tmp_path / "results"
    assert main(["run", str(path), "-o", str(results), "--report"]) == SOLVED
    if comm.rank == 0:
        limit = json.loads((results / "summary.json").read_text())["limit"]
        assert limit["estimate"] == pytest.approx(EXACT, rel=5e-3)
        page = (results / "report.html").read_text()
        assert "Drucker–Prager" in page
        assert "matches Mohr–Coulomb in plane-strain" in page


def test_a_case_file_asks_for_bounds(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = case(comm, shared_tmp_path, 'control = "bounds"')
    if comm.rank == 0:  # the mesh has straight cells
        write_thick_tube(shared_tmp_path / "tube.msh", outer=2.0, size=0.3)
    comm.barrier()
    results = shared_tmp_path / "results"
    assert main(["run", str(path), "-o", str(results), "--report"]) == SOLVED
    if comm.rank == 0:
        body = json.loads((results / "summary.json").read_text())["limit"]["body"]
        assert body["strict"]
        assert 0.6 * EXACT < body["lower"] < body["upper"] < 1.1 * EXACT
        assert not any(half.faults for half in check(results / "bounds.h5").values())


@pytest.mark.parametrize(
    ("loading", "changes", "named"),
    [
        ('control = "load"\nvalues = [1.0]', {"friction_angle": "95.0"}, "friction_angle = 95.0"),
        ('control = "load"\nvalues = [1.0]', {"match": '"inner"'}, "match"),
        ('control = "load"\nvalues = [1.0]', {"cohesion": "-1.0"}, "cohesion = -1.0"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    loading: str,
    changes: dict[str, str],
    named: str,
) -> None:
    path = case(comm, shared_tmp_path, loading, **changes)
    assert main(["run", str(path), "-o", str(shared_tmp_path / "results")]) == BAD_INPUT
    assert named in one_line(comm, capsys)
