"""Test that loads above the limit are recognised if the last steps change only a few pairs."""

import pytest

from demos.verification.corner_seat import CONTACTS
from meshes.corner_seat import write_corner_seat
from perfplast_fenicsx import Newton, Plane, Problem, Support, Traction
from tests.models import STEEL, Read


@pytest.mark.parametrize("rigid", [True, False])
def test_a_block_sheared_in_its_seat(read: Read, rigid: bool) -> None:
    """The shear is 300 on two sides, where σ_y/√3 = 260."""
    planes = [
        Plane("block_corner", point=(0.0, 0.0), normal=(1.0, 0.0)),
        Plane("block_corner", point=(0.0, 0.0), normal=(0.0, 1.0)),
    ]
    problem = Problem(
        read(write_corner_seat, dim=2, size=0.2),
        {"block": STEEL, "seat": STEEL},
        [Support("seat_bottom"), Support("seat_left")],
        [Traction("top", (-1.0, 0.0)), Traction("right", (0.0, -1.0))],
        [] if rigid else CONTACTS,
        obstacles=planes if rigid else [],
        degree=2,
    )
    report = Newton(problem).solve(300.0).report
    assert not report.converged
    assert "which is above the limit load" in report.reason
    assert report.newton_iterations <= 20
