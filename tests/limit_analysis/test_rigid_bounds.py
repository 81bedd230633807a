"""Test strict bounds for bodies with glued rigid plates, which forces and moments load."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    Force,
    InputError,
    Pressure,
    Problem,
    ResultFolder,
    RigidSurface,
    Support,
    Traction,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_linear_tractions import ENDS, cube
from tests.limit_analysis.test_static_bound import rectangle

K = 1.0
SOIL = VonMises(1e3, 0.3, math.sqrt(3) * K)
PRANDTL = (2 + math.pi) * K
"""Limit load on a rigid rough strip of unit width under a central load."""


def proven(problem: Problem, path: Path, rtol: float = 1e-4) -> BodyBounds:
    """Return strict ordered bounds, which the checker also finds. Collective."""
    bounds = limit_bounds(problem, rtol)
    assert bounds.strict, (bounds.lower.why_not, bounds.upper.why_not)
    folder = ResultFolder(MPI.COMM_WORLD, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    for half in checked.values():
        assert not half.faults
    assert bounds.lower.value < bounds.upper.value
    return bounds


def footing(*loads: Force | Traction, held: str = "", half: bool = False) -> Problem:
    """Return a strip of unit width on ground, in the middle or, if halved, at the end."""
    width, middle = (2.0, 0.0) if half else (4.0, 2.0)
    surfaces = {
        "bottom": lambda x: x[1] < 1e-9,
        "strip": lambda x: (x[1] > 1 - 1e-9) & (np.abs(x[0] - middle) < 0.5 + 1e-9),
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > width - 1e-9,
    }
    mesh = rectangle((round(4 * width), 4), (width, 1.0), {"ground": lambda x: x[1] < 2}, surfaces)
    sides, rigid = [Support("left", "x"), Support("right", "x")], RigidSurface("strip", held=held)
    return Problem(mesh, {"ground": SOIL}, [Support("bottom"), *sides, rigid], loads, degree=2)


def at(value: tuple[float, float], moment: float = 0.0, constant: bool = False) -> Force:
    return Force("strip", value, moment, point=(2.0, 1.0), constant=constant)


@pytest.mark.mpi3
def test_a_rigid_footing(shared_tmp_path: Path) -> None:
    """Prandtl's load lies between the bounds, and the plate does not rotate."""
    bounds = proven(footing(at((0.0, -1.0))), shared_tmp_path)
    assert bounds.lower.value <= PRANDTL <= bounds.upper.value
    assert bounds.upper.value < 1.4 * bounds.lower.value


def test_half_of_it(shared_tmp_path: Path) -> None:
    """Held at the symmetry plane it carries half the load; the other component has no effect."""
    load = Force("strip", (0.0, -1.0))
    bounds = proven(footing(load, held="x", half=True), shared_tmp_path)
    assert bounds.lower.value <= PRANDTL / 2 <= bounds.upper.value


@pytest.mark.long
def test_loads_that_turn_and_push(shared_tmp_path: Path) -> None:
    """A moment or a horizontal load, in either direction, reduces the load on a footing."""
    plain = limit_bounds(footing(at((0.0, -1.0))), 1e-3)
    turned = proven(footing(at((0.0, -1.0), 0.2)), shared_tmp_path)
    assert turned.upper.value < plain.upper.value
    # an eccentric load equals a central load with its moment
    beside = Force("strip", (0.0, -1.0), point=(1.8, 1.0))
    again = limit_bounds(footing(beside), 1e-4)
    assert again.lower.value == pytest.approx(turned.lower.value, rel=1e-3)
    assert again.upper.value == pytest.approx(turned.upper.value, rel=1e-3)
    with_dead = footing(at((0.0, -1.0)), at((0.5, 0.0), 0.1, constant=True))
    loaded = limit_bounds(with_dead, 1e-3)
    assert loaded.strict
    assert loaded.upper.value < plain.upper.value


def test_a_traction_on_the_plate_is_its_resultant() -> None:
    """Only the resultants of tractions on a rigid surface matter."""
    spread = limit_bounds(footing(Traction("strip", ("0*x", "-1 - 2*(x - 2)"))), 1e-4)
    force = limit_bounds(footing(at((0.0, -1.0), -2 / 12)), 1e-4)
    assert spread.strict
    assert spread.lower.value == pytest.approx(force.lower.value, rel=1e-3)
    assert spread.upper.value == pytest.approx(force.upper.value, rel=1e-3)


def test_a_bar_that_a_plate_bends(shared_tmp_path: Path) -> None:
    """The bar carries at least ±2k over its height."""
    mesh = rectangle((6, 4), (2.0, 1.0), {"block": lambda x: x[0] < 3}, ENDS)
    problem = Problem(
        mesh,
        {"block": SOIL},
        [Support("left"), RigidSurface("right")],
        [Force("right", (), 1.0)],
        degree=2,
    )
    bounds = proven(problem, shared_tmp_path)
    assert 2 * K / 4 * (1 - 2e-4) <= bounds.lower.value
    assert bounds.upper.value < 0.9


@pytest.mark.parametrize("moment", [(0.0, 0.0, 0.0), (0.1, -0.3, 0.2)])
def test_a_plate_in_space(shared_tmp_path: Path, moment: tuple[float, ...]) -> None:
    """The plate lies on a held cube, and may rotate about any axis."""
    load = Force("z1", (0.2, 0.0, -1.0), moment, point=(0.5, 0.5, 1.0))
    problem = Problem(
        cube(1), {"block": SOIL}, [Support("z0"), RigidSurface("z1")], [load], degree=2
    )
    bounds = proven(problem, shared_tmp_path)
    assert bounds.upper.value < 4 * bounds.lower.value


@pytest.mark.parametrize("friction", [{}, {"tresca": 0.2}, {"coulomb": 0.2, "tresca": 0.1}])
def test_a_plate_beside_contact(shared_tmp_path: Path, friction: dict[str, float]) -> None:
    """The plate presses a block on another block; they must not overlap between nodes either."""
    pair = ("lower_top", "upper_bottom")
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, [2, 2], [2, 2], moved_by=0.0),
        {"lower": SOIL, "upper": SOIL},
        [Support("bottom"), RigidSurface("top")],
        [Force("top", (0.0, -1.0), 0.1, point=(0.5, 2.0)), Pressure("x1", 0.3)],
        [Contact(*pair, **friction)],  # type: ignore[arg-type]
        degree=2,
    )
    proven(problem, shared_tmp_path)


def test_a_plate_that_touches_is_told() -> None:
    problem = Problem(
        stacked_blocks(MPI.COMM_WORLD, 1),
        {"lower": SOIL, "upper": SOIL},
        [Support("bottom"), RigidSurface("upper_bottom")],
        [Force("upper_bottom", (0.0, 0.0, -1.0))],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    bounds = limit_bounds(problem)
    assert not bounds.strict
    assert "rigid and in contact" in str(bounds.lower.why_not)


def test_a_formula_of_forces_is_refused() -> None:
    with pytest.raises(InputError):
        limit_bounds(footing(Traction("strip", ("0*x", "-x**2"))))
