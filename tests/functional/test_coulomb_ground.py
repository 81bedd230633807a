"""Test Mohr–Coulomb and Tresca materials in all four algorithms with contact, along a path."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BorderedNewton,
    Contact,
    DruckerPrager,
    MohrCoulomb,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    Tresca,
    VonMises,
    WorkNewton,
    limit_bounds,
    limit_load,
)
from tests.functional.test_ground import solved
from tests.models import Read

COHESION = 10.0
TRESCA = Tresca(1e5, 0.3, COHESION)


def tube(read: Read, angle: float, outside: float = 0.0, size: float = 0.3) -> Problem:
    """Return two tubes in contact, one in the other; b/a = 2."""
    tagged_mesh = read(write_thick_tube, outer=2.0, interface=1.4, size=size, order=2)
    ground = MohrCoulomb(1e5, 0.3, COHESION, angle) if angle else Tresca(1e5, 0.3, COHESION)
    loads = [Pressure("inner", 1.0), Pressure("outer", outside, constant=True)]
    return Problem(
        tagged_mesh,
        {"inner_tube": ground, "outer_tube": ground},
        [Support("x0", "x"), Support("y0", "y")],
        loads[: 2 if outside else 1],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=2,
    )


def exact(angle: float, outside: float) -> float:
    """Return (p + c cot φ)(b/a)^(2s/(1 + s)) − c cot φ, or p + 2c ln(b/a)."""
    if not angle:
        return outside + 2 * COHESION * math.log(2)
    s, tip = math.sin(math.radians(angle)), COHESION / math.tan(math.radians(angle))
    return float((outside + tip) * 2 ** (2 * s / (1 + s)) - tip)


@pytest.mark.long(but=["30.0-0.0", "20.0-20.0"])
@pytest.mark.parametrize(
    ("angle", "outside"), [(0.0, 0.0), (10.0, 0.0), (30.0, 0.0), (40.0, 0.0), (20.0, 20.0)]
)
def test_tubes_burst_at_the_exact_pressure(read: Read, angle: float, outside: float) -> None:
    found = limit_load(tube(read, angle, outside), 1e-4, method="path")
    assert found.estimate == pytest.approx(exact(angle, outside), rel=2e-3)


def test_the_four_algorithms_agree(read: Read) -> None:
    zeta, sharp = 9.5, NewtonOptions(tolerance=1e-11)
    newton = solved(Newton(tube(read, 30.0), sharp).solve(zeta))
    assert newton.report.plastic_fraction > 0.3
    alpha, displacement = newton.report.alpha, newton.state.u.x.array.copy()
    work = solved(WorkNewton(tube(read, 30.0), sharp).solve(alpha))
    assert work.report.zeta == pytest.approx(zeta, rel=1e-7)
    tight = AugmentedLagrangianOptions(tolerance=1e-10)
    uzawa = solved(AugmentedLagrangian(tube(read, 30.0), tight).solve(zeta))
    scale = np.abs(displacement).max(initial=0)
    assert np.abs(uzawa.state.u.x.array - displacement).max(initial=0) <= 1e-5 * scale
    bordered = solved(BorderedNewton(tube(read, 30.0), sharp).solve(alpha))
    assert bordered.report.zeta == pytest.approx(zeta, rel=1e-7)


def test_interior_point_and_bounds_know_them_in_plane_strain(read: Read) -> None:
    problem = tube(read, 30.0)
    found = limit_load(problem, 1e-4, method="interior-point")
    assert found.estimate == pytest.approx(exact(30.0, 0.0), rel=2e-4)
    given = replace(problem.given, contacts=[])
    straight = read(write_thick_tube, outer=2.0, size=0.3)
    matched = DruckerPrager(1e5, 0.3, COHESION, 30.0, "plane-strain")
    steel = VonMises(1e5, 0.3, COHESION * math.sqrt(3))
    ground = MohrCoulomb(1e5, 0.3, COHESION, 30.0)
    for one, same in ((ground, matched), (TRESCA, steel)):
        bounds, known = (
            limit_bounds(Problem.from_given(straight, replace(given, materials={"tube": it})), 1e-6)
            for it in (one, same)
        )
        assert bounds.strict
        assert bounds.lower.value == pytest.approx(known.lower.value, rel=2e-6)
        assert bounds.upper.value == pytest.approx(known.upper.value, rel=2e-6)


def test_a_reduced_strength_is_that_of_cohesion_and_slope() -> None:
    ground = MohrCoulomb(1e5, 0.3, COHESION, 30.0).divided_by(2.0)
    assert ground.cohesion == COHESION / 2
    assert math.tan(math.radians(ground.friction_angle)) == pytest.approx(math.sqrt(1 / 12))
    assert TRESCA.divided_by(4.0).cohesion == COHESION / 4
