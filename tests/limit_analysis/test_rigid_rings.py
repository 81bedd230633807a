"""Test strict bounds for bodies of revolution with glued rigid plates."""

import math

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Elastic,
    Force,
    Problem,
    RigidSurface,
    Support,
    Traction,
    limit_bounds,
)
from tests.limit_analysis.test_rings import STEEL
from tests.limit_analysis.test_rubbing_bounds import both
from tests.limit_analysis.test_static_bound import rectangle

PLATE = Elastic(young=1e3, poisson=0.3)


def pressed_disc(n: int, rigid: bool = True, hole: float = 0.0) -> Problem:
    """Return a disc of height 1/2 between floor and a plate; the plate is a surface or a body.

    The mean pressure at λ = 1 is 1.
    """
    height = 0.5 if rigid else 0.75
    bodies = {"disc": lambda x: x[1] < 0.5}
    mesh = rectangle(
        (2 * n, n if rigid else n + n // 2),
        (1.0, height),
        bodies if rigid else bodies | {"plate": lambda x: x[1] > 0.5},
        {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > height - 1e-9},
    )
    mesh.mesh.geometry.x[:, 0] += hole
    area = math.pi * ((1 + hole) ** 2 - hole**2)
    given = {"disc": STEEL} if rigid else {"disc": STEEL, "plate": PLATE}
    return Problem(
        mesh.turned(),
        given,
        [Support("bottom"), *([RigidSurface("top", held="x")] if rigid else [])],
        [Force("top", [0.0, -area])] if rigid else [Traction("top", [0.0, -1.0])],
        degree=2,
    )


@pytest.mark.parametrize("hole", [0.0, 0.5])
def test_a_rigid_surface_is_a_rigid_body(hole: float) -> None:
    """Compare with a plate of arbitrary stress on the same cells below."""
    surface = both(limit_bounds(pressed_disc(2, hole=hole), 1e-6), 2e-2)
    body = both(limit_bounds(pressed_disc(2, rigid=False, hole=hole), 1e-6), 2e-2)
    assert surface == pytest.approx(body, rel=1e-5)


def test_the_plate_moves_along_the_axis() -> None:
    """The plate has the same velocity in both problems of a mesh."""
    bounds = limit_bounds(pressed_disc(2))
    problem = bounds.problem
    on = problem.V.tabulate_dof_coordinates()[:, 1] > 0.5 - 1e-9
    v = bounds.mechanism.x.array.reshape(-1, 2)[on]
    lowest, highest = v[:, 1].min(initial=np.inf), v[:, 1].max(initial=-np.inf)
    assert problem.comm.allreduce(lowest, MPI.MIN) == pytest.approx(-1 / math.pi, rel=1e-9)
    assert problem.comm.allreduce(highest, MPI.MAX) == pytest.approx(-1 / math.pi, rel=1e-9)
    assert np.abs(v[:, 0]).max(initial=0.0) < 1e-12


@pytest.mark.long
def test_nearer_bounds_on_finer_meshes() -> None:
    (low, high), (lower, upper) = (both(limit_bounds(pressed_disc(n)), 2e-2) for n in (2, 4))
    assert low < lower < upper < high
    assert upper < 1.07 * lower
