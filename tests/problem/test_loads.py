"""Test loads: known resultants, formulas, pore pressure, constant loads, refusals."""

from collections.abc import Callable
from functools import cache

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import (
    BodyForce,
    Elastic,
    InputError,
    PorePressure,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    l_plate,
    stacked_blocks,
)
from perfplast_fenicsx.problem import Load

SOFT = Elastic(1e3, 0.2)
HELD = (Support("bottom"), Support("x0", "x"))


@cache
def blocks() -> TaggedMesh:
    """Return cubes (0,1)²×(0,1) and (0,1)²×(1,2)."""
    return stacked_blocks(MPI.COMM_WORLD, 2)


def problem(*loads: Load, degree: int = 1) -> Problem:
    materials = {"lower": SOFT, "upper": SOFT}
    supports = [*HELD, Support("upper_bottom")]
    return Problem(blocks(), materials, supports, loads, degree=degree)


def work(problem: Problem, v: Callable[[np.ndarray], np.ndarray], zeta: float) -> float:
    """Return the work of all loads on a displacement, including supported unknowns."""
    velocity, force = fem.Function(problem.V), problem.create_vector()
    velocity.interpolate(v)
    problem.loads.add_all_to(force, zeta)
    return float(force.dot(velocity.x.petsc_vec))


def along(axis: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: np.array([np.full_like(x[0], axis == i) for i in range(3)])


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_weight_of_blocks(degree: int) -> None:
    """The lower cube weighs 25, the upper one 10 + 6(z − 1) per volume: together 13, times ζ."""
    weight = BodyForce("lower", (0.0, 0.0, -25.0), constant=True)
    light = BodyForce("upper", (0.0, 0.0, "-10 - 6*(z - 1)"))
    both = problem(weight, light, degree=degree)
    assert work(both, along(2), 3.0) == pytest.approx(-25 - 3 * 13, rel=1e-12)
    assert work(both, along(0), 3.0) == pytest.approx(0, abs=1e-12)
    tilted = work(both, lambda x: np.array([0 * x[0], 0 * x[1], x[2]]), 3.0)
    assert tilted == pytest.approx(-12.5 - 3 * (15 + 5), rel=1e-12)


@pytest.mark.parametrize("level", [10.0, 6.0])
def test_water_in_front_of_a_wall(level: float) -> None:
    """Water of depth level − y acts on the side x = 0 of a plate of thickness 1 below y = 1."""
    water = Pressure("x0", f"9.81*maximum({level} - y, 0)")
    wall = Problem(l_plate(MPI.COMM_WORLD, 1), {"plate": SOFT}, [Support("y0")], [water])
    x = wall.V.tabulate_dof_coordinates()
    side = x[np.abs(x[:, 0]) < 1e-9, 1]
    bottom, top = (
        wall.comm.allreduce(value, op)
        for value, op in (
            (float(side.min(initial=np.inf)), MPI.MIN),
            (float(side.max(initial=-np.inf)), MPI.MAX),
        )
    )
    assert (bottom, top) == pytest.approx((5.0, 10.0))
    force = 9.81 * (level - bottom) ** 2 / 2
    assert work(wall, along(0), 1.0) == pytest.approx(force, rel=1e-12)
    turned = work(wall, lambda x: np.array([x[1] - bottom, 0 * x[1], 0 * x[2]]), 1.0)
    assert turned == pytest.approx(force * (level - bottom) / 3, rel=1e-12)


def test_torsion_by_a_traction() -> None:
    """The traction (−y, x, 0) on the unit square has the moment ∫x² + y² = 2/3 about its corner."""
    twisted = problem(Traction("top", ("-y", "x", 0.0)), degree=2)
    turned = work(twisted, lambda x: np.array([-x[1], x[0], 0 * x[0]]), 1.0)
    assert turned == pytest.approx(2 / 3, rel=1e-12)
    assert work(twisted, along(0), 1.0) == pytest.approx(-0.5, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
def test_pore_pressure_pushes_on_all_sides(degree: int) -> None:
    pores = problem(PorePressure("lower", "2 + z"), degree=degree)
    stretch = work(pores, lambda x: np.array(x), 1.0)
    assert stretch == pytest.approx(3 * 2.5, rel=1e-12)
    for axis, buoyancy in ((0, 0.0), (1, 0.0), (2, 0.0)):
        assert work(pores, along(axis), 1.0) == pytest.approx(buoyancy, abs=1e-12)
    lifted = work(pores, lambda x: np.array([0 * x[0], 0 * x[1], x[2]]), 0.0)
    assert lifted == pytest.approx(2.5, rel=1e-12)  # the load is constant


def test_what_supports_take_up_is_no_load_of_the_bodies() -> None:
    held = problem(BodyForce("lower", (1.0, 0.0, 0.0)))
    force = held.create_vector()
    held.loads.add_all_to(force, 1.0)
    at_supports = force.array[held.fixed[: len(force.array) // 3].ravel()]
    assert held.comm.allreduce(abs(at_supports).max(initial=0), MPI.MAX) > 0.01
    live = held.loads.live.array[held.fixed[: len(force.array) // 3].ravel()]
    assert abs(live).max(initial=0) < 1e-300


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (Traction("top", ("y", "w", 0.0)), ["traction on 'top'", "'w'"]),
        (Traction("top", ("y", "x")), ["traction on 'top'", "3 finite"]),
        (Pressure("top", "1/(x - 0.5)", "wind"), ["pressure 'wind' on 'top'", "inf"]),
        (PorePressure("lower", np.nan), ["pore pressure on 'lower'", "1 finite"]),
        (PorePressure("top", 1.0), ["'top' is a surface of this mesh", "volume"]),
        (BodyForce("upper", (0.0, 0.0, "1/0")), ["body force on 'upper'", "inf"]),
    ],
)
def test_what_is_no_load_is_refused(load: Load, words: list[str]) -> None:
    with pytest.raises(InputError) as refusal:
        problem(load)
    assert all(word in str(refusal.value) for word in words)
    assert len(set(MPI.COMM_WORLD.allgather(str(refusal.value)))) == 1
