"""Test the table of forces and moments on the terminal."""

import pytest

from perfplast_fenicsx.cli.recorder import force_lines

pytestmark = pytest.mark.serial

PUSH = {
    "name": "push",
    "on": "push",
    "constant": False,
    "force": [0.0, 0.0, -10.0],
    "moment": [5.0, 1e-12, 0.0],
}
WEIGHT = {
    "name": "weight",
    "on": "lid",
    "constant": True,
    "force": [0.0, 0.0, -1.0],
    "moment": [0.0, 0.0, 0.0],
}
AT_LIMIT = {
    "zeta": 2.5,
    "reactions": {"loads": [0, 0, -25.0], "support floor": [1e-13, 0, 25.0]},
    "moments": {"loads": [0, 0, 0.0], "support floor": [1, 2, 3.0]},
}


def test_what_is_applied_carried_and_held() -> None:
    units = {"force": "N", "moment": "N m"}
    lines = force_lines([PUSH, WEIGHT], 2.0, 3.0, AT_LIMIT, "xyz", units)
    cells = [line.split() for line in lines]
    assert cells[0] == ["Forces", "(N)", "x", "y", "z"]
    assert lines[1].strip().startswith("load push, zeta = 1 ")
    assert [row[-3:] for row in cells[1:7]] == [
        ["0", "0", "-10"],
        ["0", "0", "-20"],
        ["0", "0", "-30"],
        ["0", "0", "-25"],
        ["0", "0", "-1"],
        ["0", "0", "25"],
    ]
    assert "zeta = 2, carried for certain" in lines[2]
    assert "zeta = 3, collapse for certain" in lines[3]
    assert "push, zeta = 2.5, limit load of the mesh" in lines[4]
    assert "weight on lid, constant" in lines[5]
    assert "support floor, zeta = 2.5, limit load of the mesh" in lines[6]
    assert cells[7][:6] == ["Moments", "about", "the", "origin", "(N", "m)"]
    assert cells[9][-3:] == ["10", "0", "0"]


def test_supports_of_the_stress_that_proves_a_bound() -> None:
    lines = force_lines([PUSH], 2.5, 3.0, AT_LIMIT | {"strict": True}, "xyz", {})
    assert len(lines) == 10
    assert lines[4].startswith("  support floor, zeta = 2.5, carried for certain")
    assert not any("limit load of the mesh" in line for line in lines)


def test_what_is_not_known_has_no_row() -> None:
    lines = force_lines([PUSH], None, None, None, "xyz", {})
    assert len(lines) == 4
    assert lines[0].split() == ["Forces", "x", "y", "z"]
    assert not force_lines([], 1.0, 2.0, AT_LIMIT, "xyz", {})
    ring = {"name": "p", "on": "p", "constant": False, "force": [1.0, 2.0], "moment": []}
    assert len(force_lines([ring], None, None, None, "rz", {})) == 2
