"""Test forces, moments and bearing forces on faces: resultants, and bounds."""

from contextlib import nullcontext
from functools import cache
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Bearing,
    Elastic,
    Force,
    InputError,
    Problem,
    ResultFolder,
    RigidSurface,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.problem.assembled.declared_loads import linear_tractions
from perfplast_fenicsx.problem.declared.loads import CosinePressure, Load
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.problem.problem import variant
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_static_bound import rectangle

SOFT = Elastic(1e3, 0.2)
STEEL = VonMises(1e3, 0.2, 1.0)


@cache
def blocks() -> TaggedMesh:
    """Return cubes (0,1)²×(0,1) and (0,1)²×(1,2)."""
    return stacked_blocks(MPI.COMM_WORLD, 2)


WIDE = {
    "left": lambda x: x[0] < 1e-9,
    "bore": lambda x: x[1] < 1e-9,
    "right": lambda x: x[0] > 3 - 1e-9,
    "outside": lambda x: x[1] > 1 - 1e-9,
}


def bar(material: Elastic | VonMises, *loads: Load) -> Problem:
    """Return a bar (0,3)×(0,1) in plane strain, held at its left end."""
    mesh = rectangle((6, 2), (3.0, 1.0), {"bar": lambda x: x[0] < 4}, WIDE, 0.1)
    return Problem(mesh, {"bar": material}, [Support("left")], loads, degree=2)


def half_ring(*loads: Load, degree: int = 1) -> Problem:
    """Return a polygonal half ring of radii 1 to 2, y ≤ 0: half of a bore, held at the outside."""
    mesh = rectangle((8, 3), (3.0, 1.0), {"lug": lambda x: x[0] < 4}, WIDE, 0.1)
    angle, radius = np.pi * (1 + mesh.mesh.geometry.x[:, 0] / 3), 1 + mesh.mesh.geometry.x[:, 1]
    mesh.mesh.geometry.x[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return Problem(mesh, {"lug": STEEL}, [Support("outside")], loads, degree=degree)


def in_space(load: Load, degree: int = 1) -> Problem:
    materials = {"lower": SOFT, "upper": SOFT}
    return Problem(
        blocks(), materials, [Support("bottom"), Support("upper_bottom")], [load], degree=degree
    )


@pytest.mark.mpi2("point0-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("point", [(), (3.0, -1.0, 4.0)])
def test_a_force_and_a_moment_on_a_face(degree: int, point: tuple[float, ...]) -> None:
    """Without a point, the force acts at the middle of the face, (½, ½, 2)."""
    force, moment = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.5])
    (found,) = load_resultants(in_space(Force("top", force, moment, point), degree))
    assert found.force == pytest.approx(force, rel=1e-12)
    at = np.array(point or (0.5, 0.5, 2.0))
    assert found.moment == pytest.approx(moment + np.cross(at, force), rel=1e-12)


def test_a_force_and_a_moment_in_the_plane() -> None:
    (found,) = load_resultants(bar(SOFT, Force("right", (3.0, -1.0), 2.0, (4.0, 7.0))))
    assert found.force == pytest.approx([3.0, -1.0], rel=1e-12)
    assert found.moment == pytest.approx([2.0 + 4.0 * -1.0 - 7.0 * 3.0], rel=1e-12)


def test_results_tell_the_loads_as_declared() -> None:
    """Reports show total forces, although the problem applies tractions."""
    loads = (
        Force("right", (3.0, -1.0), point=(3.0, 0.0)),
        Traction("left", (1.0, 2.0), total=True),
    )
    problem = bar(SOFT, *loads)
    assert problem.stated_loads == loads
    assert not any(one in problem.given.loads for one in loads)
    assert problem.on(problem.tagged_mesh).stated_loads == loads
    assert "Force(" in problem._repr_html_()
    other = (Bearing("bore", (0.0, 1.0)),)
    changed = variant(problem, loads=other)
    assert changed.stated_loads == other
    assert changed.on(problem.tagged_mesh).stated_loads == other


def test_a_pulled_bar_is_bounded() -> None:
    """The limit is 2/√3 σ_y in plane strain, with a uniform traction."""
    bounds = limit_bounds(bar(STEEL, Force("right", (1.0, 0.0))))
    assert bounds.lower is not None and bounds.upper is not None
    assert bounds.lower.value == pytest.approx(2 / 3**0.5, rel=1e-3)
    assert bounds.lower.value <= 2 / 3**0.5 * (1 + 1e-9) <= bounds.upper.value * (1 + 1e-9)


def test_bounds_under_a_moment_are_proven(shared_tmp_path: Path) -> None:
    """The edge of the end carries at most 2/√3 σ_y, and the end certainly 2/√3 σ_y h²/6."""
    bounds = limit_bounds(bar(STEEL, Force("right", (), 1.0)))
    assert bounds.lower is not None and bounds.upper is not None
    assert bounds.lower.value == pytest.approx(2 / 3**0.5 / 6, rel=1e-3)
    assert bounds.lower.value <= bounds.upper.value
    proven(bounds, shared_tmp_path)


@pytest.mark.parametrize("force", [(0.0, -2.0), (1.0, -2.0), (0.3, -0.1)])
def test_a_pin_in_its_bore(force: tuple[float, float]) -> None:
    """The polygon has the exact force; the pin presses where the bore faces it, and never pulls."""
    problem = half_ring(Bearing("bore", force))
    (found,) = load_resultants(problem)
    assert found.force == pytest.approx(force, rel=1e-9, abs=1e-12)
    (pressure,) = problem.given.loads
    assert isinstance(pressure, CosinePressure)
    normals = np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    corners = np.zeros((3, 2, 2))
    tractions, off = linear_tractions(pressure, corners, normals)
    assert np.all(off == 0.0)
    assert np.all(np.einsum("nki,ni->nk", tractions, normals) <= 0.0)


@pytest.mark.parametrize(("across", "carried"), [(0.0, True), (0.3, False)])
def test_facets_of_a_coarse_mesh_carry_no_force_along_the_axis(
    across: float, carried: bool
) -> None:
    """Two opposite sides are straight in the drawing, and oblique by 0.06 in a coarse mesh."""
    ends = {"left": WIDE["left"], "bore": lambda x: abs(x[1] - 0.5) > 0.5 - 1e-9}
    mesh = rectangle((6, 2), (3.0, 1.0), {"bar": lambda x: x[0] < 4}, ends, 0.0)
    x = mesh.mesh.geometry.x
    x[:, 1] *= 1 + 0.015 * np.cos(2 * np.pi * x[:, 0])
    x[:, 1] += 0.015 * np.cos(2 * np.pi * x[:, 0]) * (x[:, 1] < 0.1)
    told = "" if carried else r"\[0.3, 1.0\]"
    with nullcontext() if carried else pytest.raises(InputError, match=told):
        problem = Problem(mesh, {"bar": STEEL}, [Support("left")], [Bearing("bore", (across, 1.0))])
        (found,) = load_resultants(problem)
        assert found.force == pytest.approx((across, 1.0), rel=1e-9, abs=1e-12)


def test_bounds_under_a_pin_are_proven(shared_tmp_path: Path) -> None:
    bounds = limit_bounds(half_ring(Bearing("bore", (0.0, -1.0)), degree=2))
    assert bounds.lower is not None and bounds.upper is not None
    assert 0.5 < bounds.lower.value <= bounds.upper.value
    proven(bounds, shared_tmp_path)


def proven(bounds: BodyBounds, path: Path) -> None:
    """An independent checker finds the same numbers."""
    assert bounds.strict, bounds.why_not
    folder = ResultFolder(MPI.COMM_WORLD, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    halves = check(folder.file("bounds.h5"))
    for name, bound in (("lower", bounds.lower), ("upper", bounds.upper)):
        assert bound is not None
        assert not halves[name].faults
        assert halves[name].proven == pytest.approx(bound.value, rel=1e-4)


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (Bearing("bore", (0.0, 1.0)), "no pressure on 'bore' has the resultant"),
        (Bearing("bore", (0.0, 0.0)), "the bearing force on 'bore' is zero"),
        (Bearing("bores", (0.0, 1.0)), "'bores'"),
        (Force("bores", (0.0, 1.0)), "'bores'"),
        (Force("bore", (0.0, 1.0, 2.0)), "value of the force on 'bore' is"),
    ],
)
def test_refusals(load: Load, message: str) -> None:
    with pytest.raises(InputError, match=message):
        half_ring(load)


def test_a_force_on_a_rigid_surface_that_is_moved_is_refused() -> None:
    rigid = RigidSurface("top", displacement=(0.0, 0.0, 1.0))
    materials = {"lower": SOFT, "upper": SOFT}
    with pytest.raises(InputError, match="whose motion is prescribed"):
        Problem(blocks(), materials, [Support("bottom"), rigid], [Force("top", (1, 0, 0))])
