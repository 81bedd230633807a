"""Test friction in axisymmetry: areas are those of rings."""

import math
from dataclasses import replace

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    Contact,
    Newton,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Tie,
    Traction,
    limit_load,
)
from perfplast_fenicsx.mesh.kinematics import KINDS
from tests.checks import assert_solved
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL

INNER, OUTER, SHEAR = 2.0, 3.0, 5.0
FACE = math.pi * (OUTER**2 - INNER**2)


def rings(comm: MPI.Intracomm) -> TaggedMesh:
    """Return two stacked rings, each as wide as high."""
    section = blocks_apart(comm, (3, 3), (2, 2))
    section.mesh.geometry.x[:, 0] += INNER
    return replace(section, section=KINDS["axisymmetric"])


def test_a_ring_slides_down_a_shaft(comm: MPI.Intracomm) -> None:
    """The ring slides if ζ times its face equals τ̄ times the area of its bore, 2π INNER long."""
    problem = Problem(
        rings(comm),
        {"lower": STEEL, "upper": STEEL},
        [],
        [Traction("top", (0.0, -1.0))],
        contacts=[Tie("lower_top", "upper_bottom", hosts="secondary")],
        obstacles=[Plane("x0", (INNER, 0.0), (1.0, 0.0), tresca=SHEAR, name="shaft")],
        degree=2,
    )
    exact = SHEAR * 2 * math.pi * INNER / FACE
    level = Newton(problem).solve(0.99 * exact)
    assert_solved(level)
    assert level.report.reactions["obstacle shaft"][1] == pytest.approx(0.99 * exact * FACE)
    bounds = limit_load(problem, 1e-5)
    assert bounds.upper is not None
    assert bounds.lower <= exact * (1 + 1e-8)
    assert bounds.upper == pytest.approx(exact, rel=1e-5)


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_ring_grows_on_another(comm: MPI.Intracomm, degree: int) -> None:
    """The upper ring, pressed from inside and above, slips outwards; contact covers the face."""
    problem = Problem(
        rings(comm),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", "y")],
        [Pressure("upper_x0", 1.0), Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", tresca=SHEAR)],
        degree=degree,
    )
    assert comm.allreduce(problem.friction.bound.sum()) == pytest.approx(SHEAR * FACE)
    level = Newton(problem).solve(60.0)
    assert_solved(level)
    report = level.report
    assert report.slipping > 0
    assert report.friction_dissipation > 0
    assert abs(report.duality_gap) < 1e-11
    assert report.friction_excess < 1e-10
    assert report.balance < 1e-10
