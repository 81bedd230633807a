"""Test forces and moments of loads and supports against statics, at ζ = 1 and the limit load."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Force,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Traction,
    limit_bounds,
    limit_load,
    two_blocks,
)
from perfplast_fenicsx.limit_analysis.body.limit_forces import LimitForces, limit_forces
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.statements.load_factor import Scope
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL, Read, touching_blocks

COMM = MPI.COMM_WORLD

TOP = (1.5, (2.25, 0.5, 2.0))
"""Area and centre of the loaded surface of two blocks."""

UPPER = (3.0, (1.5, 0.5, 1.5))
"""Volume and centre of the upper block."""

DIGITS = 1e-9


def cantilevers(loads: Sequence[Load], degree: int = 2) -> Problem:
    mesh, contacts = two_blocks(COMM, 2), [Contact("upper_bottom", "lower_top")]
    materials = {"lower": STEEL, "upper": STEEL}
    return Problem(mesh, materials, [Support("left")], loads, contacts, degree=degree)


def plane(turned: bool = False) -> Problem:
    """Return two stacked blocks in plane strain, or discs."""
    mesh = blocks_apart(COMM, (4, 2), (4, 2))
    return Problem(
        mesh.turned() if turned else mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", "y" if turned else "xy")],
        [Pressure("top", 3.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )


def at(place: Sequence[float], force: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return a force and its moment about the origin."""
    if len(force) == 3:
        return list(force), np.cross(place, force).tolist()
    return list(force), [place[0] * force[1] - place[1] * force[0]]


def of(on: tuple[float, Sequence[float]], density: Sequence[float]) -> tuple[list, list]:
    size, centre = on
    return at(centre, [size * each for each in density])


def turned(moment: Sequence[float], both: tuple[list, list]) -> tuple[list, list]:
    """Return the same with an additional moment."""
    return both[0], np.add(both[1], moment).tolist()


SLOPE = [0.0, 0.0, -(3.0**2 - 1.5**2) / 2]
"""Resultant of the traction −x along z, which acts at x = ∫x² / ∫x."""

CASES: dict[str, tuple[Callable[[], Problem], list[tuple[list, list]]]] = {
    "down": (lambda: cantilevers([Traction("top", (0, 0, -1.0))]), [of(TOP, (0, 0, -1.0))]),
    "oblique": (lambda: cantilevers([Traction("top", (1, -2, -3.0))]), [of(TOP, (1, -2, -3.0))]),
    "linear elements": (
        lambda: cantilevers([Traction("top", (1, -2, -3.0))], degree=1),
        [of(TOP, (1, -2, -3.0))],
    ),
    "pressure": (lambda: cantilevers([Pressure("top", 2.0)]), [of(TOP, (0, 0, -2.0))]),
    "suction": (lambda: cantilevers([Pressure("top", -2.0)]), [of(TOP, (0, 0, 2.0))]),
    "weight": (
        lambda: cantilevers([BodyForce("upper", (0, 1, -5.0))]),
        [of(UPPER, (0, 1, -5.0))],
    ),
    "two loads": (
        lambda: cantilevers([BodyForce("upper", (0, 0, -5.0)), Pressure("top", 2.0)]),
        [of(UPPER, (0, 0, -5.0)), of(TOP, (0, 0, -2.0))],
    ),
    "a formula": (
        lambda: cantilevers([Traction("top", (0, 0, "-x"))]),
        [at(((27 - 1.5**3) / 3 / -SLOPE[2], 0.5, 2.0), SLOPE)],
    ),
    "a force and a moment": (
        lambda: cantilevers([Force("top", (1.0, -2.0, -3.0), (0.5, 4.0, -1.0))]),
        [turned((0.5, 4.0, -1.0), at(TOP[1], (1.0, -2.0, -3.0)))],
    ),
    "a remote force": (
        lambda: cantilevers([Force("top", (0.0, -2.0, -3.0), point=(5.0, 1.0, 4.0))]),
        [at((5.0, 1.0, 4.0), (0.0, -2.0, -3.0))],
    ),
    "rollers": (lambda: touching_blocks(degree=2), [at((0.5, 0.5, 2.0), (0, 0, -1.0))]),
    "plane strain": (plane, [at((0.5, 2.0), (0, -3.0))]),
}


def assert_close(found: Sequence[float], wanted: Sequence[float], scale: float) -> None:
    assert found == pytest.approx(wanted, rel=0, abs=DIGITS * scale)


def assert_static(problem: Problem, found: LimitForces | None) -> None:
    """Check the equilibrium of loads and supports in force and moment."""
    assert found is not None
    total = found.reactions["loads"]
    supports = [name for name in found.reactions if name.startswith("support")]
    force = np.sum([total, *(found.reactions[name] for name in supports)], axis=0)
    scale = float(np.abs(total).max())
    assert_close(force.tolist(), [0.0] * len(total), scale)
    live = np.sum([load.force for load in load_resultants(problem)], axis=0)
    assert_close(total, (found.zeta * live).tolist(), scale)
    if found.moments["loads"]:
        turning = np.sum(list(found.moments.values()), axis=0)
        assert_close(turning.tolist(), [0.0] * len(turning), 4 * scale)
    assert found.balance < DIGITS


@pytest.mark.mpi2("down")
@pytest.mark.parametrize("name", CASES)
def test_statics(name: str) -> None:
    make, wanted = CASES[name]
    problem = make()
    loads = load_resultants(problem)
    for load, (force, moment) in zip(loads, wanted, strict=True):
        scale = max(map(abs, (*force, *moment)))
        assert_close(load.force, force, scale)
        assert_close(load.moment, moment, scale)
    assert_static(problem, limit_forces(problem, interior_point(problem)))


@pytest.mark.long
def test_statics_on_the_mesh_that_bounds_divide() -> None:
    problem = cantilevers([Traction("top", (0.0, 0.0, -1.0))])
    found = limit_bounds(problem, 1e-2)
    assert found.problem is not problem
    of_mesh = limit_forces(found.problem, found.mesh)
    assert_static(problem, of_mesh)
    of_body = limit_forces(found.problem, found.mesh, found)
    assert_static(problem, of_body)
    assert of_mesh is not None
    assert of_body is not None
    assert (of_mesh.strict, of_body.strict) == (False, True)
    assert of_body.zeta == pytest.approx(found.lower.value, rel=DIGITS)


@pytest.mark.long(but=["weight", "rollers", "plane strain"])
@pytest.mark.mpi2("weight")
@pytest.mark.parametrize("name", ["a force and a moment", "weight", "rollers", "plane strain"])
def test_statics_of_a_lower_bound(name: str) -> None:
    """The stress that proves the bound is in equilibrium with the loads and each support."""
    make, _ = CASES[name]
    problem = make()
    body = limit_bounds(problem, 1e-2)
    found = limit_forces(body.problem, body.mesh, body)
    assert_static(problem, found)
    assert found is not None
    assert found.strict


def test_statics_of_a_path() -> None:
    """The forces belong to the last level, near the limit load, and have its accuracy."""
    problem = touching_blocks(degree=2)
    limit = limit_load(problem, 1e-2, method="path")
    found = limit_forces(problem, limit)
    assert_static(problem, found)
    assert found is not None
    assert found.zeta == pytest.approx(limit.lower, rel=1e-12)


def test_statics_of_the_full_turn() -> None:
    """On a disc of radius 1, the axial force is π times the pressure."""
    problem = plane(turned=True)
    (load,) = load_resultants(problem)
    assert load.force[1] == pytest.approx(-3 * np.pi, rel=DIGITS)
    assert load.moment == []
    found = limit_forces(problem, interior_point(problem))
    assert found is not None
    assert found.reactions["support bottom"][1] == pytest.approx(3 * np.pi * found.zeta, rel=DIGITS)


SOIL = MohrCoulomb(young=1e3, poisson=0.3, cohesion=1.0, friction_angle=20.0)


def punched_ground(read: Read, law: Material, tresca: float | None, weight: float) -> Problem:
    """Return ground under a strong punch of radius 1, in axisymmetry."""
    mesh = read(write_strip_footing, size=1.0, punch=True, width=3.0, depth=2.0).turned()
    loads: list[Load] = [Pressure("top", 3.0)]
    if weight:
        loads.append(BodyForce("ground", (0.0, -weight), constant=True))
    return Problem(
        mesh,
        {"ground": law, "punch": Elastic(1e6, 0.3)},
        [Support("side", "x"), Support("bottom")],
        loads,
        [Contact("ground_footing", "punch_footing", tresca=tresca)],
        degree=2,
    )


@pytest.mark.mpi2("dilates")
@pytest.mark.parametrize(
    ("law", "tresca", "weight"),
    [(SOIL, None, 0.0), (SOIL, 0.5, 0.7), (STEEL, None, 0.0)],
    ids=["dilates", "weight and friction", "metal"],
)
def test_statics_of_a_lower_bound_around_an_axis(
    read: Read, law: Material, tresca: float | None, weight: float
) -> None:
    """The support carries exactly π times the pressure plus the weight of the ground."""
    body = limit_bounds(punched_ground(read, law, tresca, weight), 0.1)
    assert body.strict, body.why_not
    found = limit_forces(body.problem, body.mesh, body)
    assert found is not None
    assert found.strict
    assert found.balance < DIGITS
    assert found.zeta == body.lower.value
    pressed = found.zeta * 3 * np.pi
    carried = pressed + weight * 18 * np.pi
    assert found.reactions["loads"][1] == pytest.approx(-carried, rel=DIGITS)
    assert found.reactions["support bottom"][1] == pytest.approx(carried, rel=DIGITS)
    on_ground = found.reactions["contact ground_footing punch_footing"][1]
    assert on_ground == pytest.approx(-pressed, rel=DIGITS)
    # the stress at the limit load of the mesh does not balance nodal forces of displacements
    unproven = replace(body.lower, of=Scope.MESH, why_not=("not proven",))
    assert limit_forces(body.problem, body.mesh, replace(body, lower=unproven)) is None
