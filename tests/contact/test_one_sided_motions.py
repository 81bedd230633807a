"""Test bodies that contact stops in one direction only: pushed away, unloaded, or pressed."""

import logging

import pytest

from meshes.corner_seat import write_corner_seat
from perfplast_fenicsx import Newton, Plane, Problem, Support, Traction
from tests.checks import assert_solved
from tests.models import STEEL, Read, stack_problem, two_blocks_problem

PLANES = [
    Plane("block_corner", point=(0.0, 0.0), normal=(1.0, 0.0)),
    Plane("block_corner", point=(0.0, 0.0), normal=(0.0, 1.0)),
]


def in_corner(read: Read, *push: float) -> Problem:
    """Return a block in a rigid corner, pushed on top and at its side."""
    return Problem(
        read(write_corner_seat, dim=2, size=0.5),
        {"block": STEEL, "seat": STEEL},
        [Support("seat_bottom"), Support("seat_left")],
        [Traction("top", (0.0, -push[1])), Traction("right", (-push[0], 0.0))],
        obstacles=PLANES,
    )


def test_a_block_that_is_pushed_away(read: Read) -> None:
    problem = in_corner(read, -1.0, 1.0)
    report = Newton(problem).solve(10.0).report
    assert not report.converged
    assert report.reason.startswith("no equilibrium exists: the loads push the body 'block' away")
    assert report.reason.endswith("; add a support, or glue the surfaces")


@pytest.mark.mpi2
def test_a_block_that_may_go_away(read: Read, caplog: pytest.LogCaptureFixture) -> None:
    """The program solves the problem and warns."""
    with caplog.at_level(logging.WARNING):
        problem = in_corner(read, 0.0, 1.0)
    assert caplog.text.count("the body 'block' may move away") == (problem.comm.rank == 0)
    assert caplog.text.count("a load that presses them") == (problem.comm.rank == 0)
    level = Newton(problem).solve(10.0)
    assert_solved(level)


def test_bodies_that_are_pressed_are_not_told_of(
    read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        problems = [in_corner(read, 1.0, 1.0), stack_problem(2), two_blocks_problem(2)]
    assert not caplog.text
    for problem in problems:
        assert problem.free.leaving.pushed_away(problem.loads.live) is None


def test_which_way_a_stack_is_pushed() -> None:
    problem = stack_problem(2)
    pull = problem.create_vector()
    pull.axpy(-1.0, problem.loads.live)
    told = problem.free.leaving.pushed_away(pull)
    assert told is not None
    assert "the body 'upper'" in told
