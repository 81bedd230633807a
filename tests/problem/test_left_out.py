"""Test the message on nodes without contact or friction."""

from mpi4py import MPI

import pytest

from meshes.corner_seat import write_corner_seat
from perfplast_fenicsx import Contact, Plane, Pressure, Problem, Support, Tie, Traction
from perfplast_fenicsx.problem.contact_check import left_out
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL, Read


def glued(comm: MPI.Intracomm, hosts: str, on: str, normal: tuple[float, float]) -> Problem:
    """Return two glued blocks, held at the left, with a rough obstacle."""
    return Problem(
        blocks_apart(comm, (3, 3), (2, 2)),
        {"lower": STEEL, "upper": STEEL},
        [Support("x0", "x")],
        [Traction("top", (0.0, -1.0))],
        contacts=[Tie("lower_top", "upper_bottom", hosts=hosts)],
        obstacles=[Plane(on, (0.0, 0.0), normal, tresca=1.0, name="rough")],
    )


def test_a_node_that_follows_a_tie_is_told_of(comm: MPI.Intracomm) -> None:
    (told,) = left_out(glued(comm, "secondary", "upper_x0", (1.0, 0.0)))
    assert "'upper_x0' does not act on 1 of its nodes" in told
    assert left_out(glued(comm, "primary", "upper_x0", (1.0, 0.0))) == []


@pytest.mark.mpi2
def test_nodes_that_cannot_rub_are_told_of(comm: MPI.Intracomm) -> None:
    (told,) = left_out(glued(comm, "secondary", "bottom", (0.0, 1.0)))
    assert told.startswith("1 of the 4 nodes with declared friction at 'bottom' have no friction")


def test_a_node_at_an_edge_is_told_of(read: Read) -> None:
    """The node has a normal on each face, and no tangential direction common to both."""
    problem = Problem(
        read(write_corner_seat, dim=2, size=0.5),
        {"block": STEEL, "seat": STEEL},
        [Support("seat_bottom", "y"), Support("seat_left", "x")],
        [Pressure("top", 2.0), Pressure("right", 1.0)],
        [Contact("block_corner", "seat_corner", tresca=1.0)],
    )
    (told,) = left_out(problem)
    assert (
        "nodes with declared friction at 'seat_corner' have no friction: they are at an edge"
        in told
    )
    assert problem.num_pairs - problem.friction.count == int(told.split()[0]) == 2
