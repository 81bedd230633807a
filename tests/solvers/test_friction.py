"""Test Tresca friction in Newton's methods, against ALG2, which has no active set."""

import math
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    Contact,
    Elastic,
    Newton,
    Plane,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
    limit_load,
    punch,
)
from tests.checks import assert_refused, assert_solved
from tests.contact.blocks_apart import blocks_apart
from tests.models import PUNCH_SUPPORTS, STEEL

HARD = VonMises(young=2e5, poisson=0.3, yield_stress=500.0)
SOFT = VonMises(young=1e5, poisson=0.3, yield_stress=150.0)


def pushed(
    counts: tuple[int, int], gdim: int, degree: int, tresca: float, **contact: Any
) -> Problem:
    """Return a soft block on a hard block, pressed down and pushed; ζ is the pressure."""
    aside = [0.15, 0.05][: gdim - 1]
    return Problem(
        blocks_apart(MPI.COMM_WORLD, *([count] * gdim for count in counts)),
        {"lower": HARD, "upper": SOFT},
        [Support("bottom")],
        [Traction("top", (*aside, -1.0))],
        [Contact("lower_top", "upper_bottom", tresca=tresca, **contact)],
        degree=degree,
    )


GAPPED = {"gap": "0.0003*(x - 0.4)*(x - 0.4) - 0.00002", "interference": True}


@pytest.mark.mpi3("counts0-2-1-contact0")
@pytest.mark.parametrize(
    ("counts", "gdim", "degree", "contact"),
    [
        ((5, 4), 2, 1, {}),
        ((4, 5), 2, 2, GAPPED),
        ((2, 3), 3, 1, GAPPED),
        ((2, 2), 3, 2, {}),
    ],
)
def test_slip_is_certified(counts: Any, gdim: int, degree: int, contact: dict[str, Any]) -> None:
    """Some places stick, others slip, bodies yield, and the dual problem agrees."""
    problem = pushed(counts, gdim, degree, 40.0, **contact)
    level = Newton(problem).solve(120.0)
    assert_solved(level)
    report = level.report
    assert abs(report.duality_gap) < 1e-11
    assert report.balance < 1e-10
    assert report.friction_excess < 1e-10
    assert 0 < report.slipping < problem.friction.count
    assert report.friction_dissipation > 0
    assert report.plastic_fraction > 0


@pytest.mark.mpi2("2-1")
@pytest.mark.parametrize(("gdim", "degree"), [(2, 1), (3, 1)])
def test_alg2_finds_the_same(gdim: int, degree: int) -> None:
    problem = pushed((2, 3), gdim, degree, 15.0)
    newton, uzawa = (solver(problem).solve(80.0) for solver in (Newton, AugmentedLagrangian))
    assert_solved(newton)
    assert uzawa.report.converged, uzawa.report.reason
    assert 0 < newton.report.slipping
    assert uzawa.state.alpha == pytest.approx(newton.state.alpha, rel=1e-6)
    found, expected = (level.contact_forces for level in (uzawa, newton))
    assert np.abs(found - expected).max(initial=0) < 1e-4


def test_alg2_where_supports_hold_nodes_along_the_surface() -> None:
    """On the symmetry planes of a punch, and in both directions where these planes meet."""
    materials = {"base": HARD, "punch": HARD}
    contact = Contact("punch_bottom", "base_top", tresca=20.0)
    loads = [Pressure("top", 1.0)]
    problem = Problem(punch(MPI.COMM_WORLD, 2), materials, PUNCH_SUPPORTS, loads, [contact])
    assert 0 < problem.friction.count < problem.num_pairs
    newton, uzawa = (solver(problem).solve(200.0) for solver in (Newton, AugmentedLagrangian))
    assert_solved(newton)
    assert uzawa.report.converged, uzawa.report.reason
    assert uzawa.state.alpha == pytest.approx(newton.state.alpha, rel=1e-6)
    assert uzawa.report.slipping == newton.report.slipping == problem.friction.count


def test_a_sliding_block_is_resisted_alike_in_any_direction(comm: MPI.Intracomm) -> None:
    """The block slides at the lateral force τ̄A; only the direction of the load changes."""
    reached = []
    for degrees in (0.0, 37.0, 45.0):
        angle = math.radians(degrees)
        aside = (0.2 * math.cos(angle), 0.2 * math.sin(angle), -1.0)
        problem = Problem(
            blocks_apart(comm, (1, 1, 1), (2, 2, 2)),
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom")],
            [Traction("top", aside)],
            [Contact("lower_top", "upper_bottom", tresca=10.0)],
        )
        last = limit_load(problem, method="path").levels[-1]
        assert last.report.slipping == problem.friction.count
        reached.append(last.report.zeta)
    assert reached == pytest.approx([50.0] * 3, rel=1e-6)
    assert np.ptp(reached) < 1e-9 * 50


@pytest.mark.serial
def test_points_of_friction_that_alternate_between_stick_and_slip() -> None:
    """In 3D, steps of the splitting end this; without them 60 Newton steps did not converge."""
    steel = Elastic(2e5, 0.3)
    blocks = blocks_apart(MPI.COMM_WORLD, (2, 1, 2), (1, 2, 1), (0.3, 1.1), 0.8, moved_by=0.0)
    problem = Problem(
        blocks,
        {"lower": steel, "upper": steel},
        [Support("bottom")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("lower_top", "upper_bottom", tresca=5.0)],
    )
    report = Newton(problem).solve(100.0).report
    assert report.converged
    assert report.slipping == problem.friction.count > 0
    assert report.duality_gap < 1e-10


def test_far_below_the_bound_nothing_slips() -> None:
    problem = pushed((2, 2), 3, 1, 1e6)
    level = Newton(problem).solve(40.0)
    assert_solved(level)
    assert level.report.slipping == 0
    assert level.report.friction_dissipation == 0


def test_a_rough_obstacle_carries_its_share(comm: MPI.Intracomm) -> None:
    """The force of a rough plane balances the loads on a block, and slip begins at τ̄A."""
    problem = Problem(
        blocks_apart(comm, (3, 3), (3, 3)),
        {"lower": STEEL, "upper": STEEL},
        [],
        [Traction("top", (0.1, -1.0))],
        contacts=[Tie("lower_top", "upper_bottom")],
        obstacles=[Plane("bottom", (0.0, 0.0), (0.0, 1.0), tresca=5.0, name="floor")],
    )
    level = Newton(problem).solve(49.0)
    assert_solved(level)
    assert level.report.reactions["obstacle floor"] == pytest.approx([-4.9, 49.0])
    assert limit_load(problem, method="path").lower == pytest.approx(50.0, rel=1e-6)
    bounds = limit_load(problem, 1e-5)
    assert bounds.lower <= 50 * (1 + 1e-9)
    assert bounds.upper == pytest.approx(50.0, rel=1e-5)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Contact("a", "b", tresca=-1.0), ["tresca = -1.0", ">= 0"]),
        (lambda: Contact("a", "b", coulomb=math.nan), ["coulomb = nan", ">= 0"]),
        (
            lambda: Plane("bottom", (0.0, 0.0), (0.0, 1.0), tresca=1.0),
            ["'bottom'", "needs a name", "name = "],
        ),
    ],
)
def test_what_is_no_friction_is_refused(make: Any, words: list[str]) -> None:
    assert_refused(make, words)


def test_friction_and_tie_on_one_surface_are_refused(comm: MPI.Intracomm) -> None:
    def declare(*contacts: Contact, **more: Any) -> Problem:
        return Problem(
            blocks_apart(comm, (2, 2), (2, 2)),
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom")],
            [Traction("top", (0.1, -1.0))],
            [Tie("lower_top", "upper_bottom"), *contacts],
            **more,
        )

    contact = Contact("lower_top", "upper_bottom", tresca=1.0)
    words = ["tie 1", "has the same surfaces as contact 1"]
    assert_refused(lambda: declare(contact), words)
    roof = Plane("lower_top", (0.0, 1.0), (0.0, -1.0), tresca=1.0, name="roof")
    assert_refused(lambda: declare(obstacles=[roof]), ["friction", "tied", "remove"])


@pytest.mark.mpi2
def test_a_load_that_grows_beyond_the_last_friction_bounds() -> None:
    """The bounds from the contact forces at ζ = 4 cannot hold the block at ζ = 30."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, [5, 5], [5, 5]),
        {"lower": HARD, "upper": SOFT},
        [Support("bottom")],
        [Traction("top", (0.15, -1.0))],
        [Contact("lower_top", "upper_bottom", coulomb=0.85)],
    )
    newton = Newton(problem)
    first = newton.solve(4.0)
    assert_solved(first)
    then = newton.solve(30.0, first.state)
    assert_solved(then)
    assert then.report.friction_excess < 1e-9
