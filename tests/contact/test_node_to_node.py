"""Test contact of matching nodes: inclined surfaces, hosts on either side, and refusals."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    InputError,
    Newton,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    read_gmsh,
    two_blocks,
)
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from tests.checks import assert_refused
from tests.contact.test_jump_basis import assert_inverse, body_of
from tests.models import STEEL, touching_blocks, wedge_problem


@pytest.mark.mpi3
def test_inclined_contact_is_solved_and_certified(wedge: TaggedMesh) -> None:
    level = Newton(wedge_problem(wedge)).solve(200.0)
    report = level.report
    assert report.converged
    assert report.active_contacts > 0
    assert report.smallest_contact_force > -1e-8
    assert report.max_penetration < 1e-12
    assert abs(report.duality_gap) < 1e-9
    assert report.equilibrium < 1e-7


def test_inclined_contact_gives_the_same_on_one_rank_alone(
    wedge: TaggedMesh, shared_tmp_path: Path
) -> None:
    alone = read_gmsh(MPI.COMM_SELF, shared_tmp_path / "write_wedge.msh")
    together = Newton(wedge_problem(wedge)).solve(150.0)
    single = Newton(wedge_problem(alone)).solve(150.0)
    assert together.state.alpha == pytest.approx(single.state.alpha, rel=1e-8)
    assert together.report.newton_iterations == single.report.newton_iterations


def test_where_supports_hold_one_side_the_other_one_carries_the_jump() -> None:
    tagged_mesh = two_blocks(MPI.COMM_WORLD, 2)
    steel = {"lower": STEEL, "upper": STEEL}
    clamped_hosts = Problem(
        tagged_mesh,
        steel,
        [Support("left"), Support("top"), Support("upper_bottom", "z")],
        [BodyForce("lower", (0.0, 0.0, 1.0))],
        [Contact("upper_bottom", "lower_top", "0.001 + 0*x")],
    )
    bodies, rows = clamped_hosts.bodies, clamped_hosts.constraints
    assert (bodies.of_node[rows.host] == body_of(clamped_hosts, "lower")).all()
    assert np.allclose(rows.normal, [0.0, 0.0, -1.0])  # also out of the primary surface
    assert_inverse(clamped_hosts.basis)
    level = Newton(clamped_hosts).solve(10.0)
    assert level.report.converged
    assert level.report.max_penetration < 1e-12
    assert 0 < level.report.active_contacts < level.report.contact_pairs


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"contacts": [Contact("lower_top", "x0", formulation="nodes")]},
            ["contact 1", "no separate partner", "formulation = 'mortar'"],
        ),
        ({"contacts": [Contact("lower_top", "x0")]}, ["contact 1", "nowhere opposite"]),
        ({"contacts": [Contact("lower_top", "lower_top")]}, ["contact 1", "itself"]),
        ({"contacts": [Contact("lower_top", "uper_bottom")]}, ["'uper_bottom'"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", -0.1)]}, ["gap = -0.1", "negative"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", "x-1")]}, ["gap = x-1", "negative"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", "open('f')")]}, ["open"]),
    ],
)
def test_surfaces_that_do_not_fit_are_refused(changes: dict[str, object], words: list[str]) -> None:
    assert_refused(lambda: touching_blocks(**changes), words)


def test_surfaces_that_look_the_same_way_are_refused() -> None:
    """Two bodies occupy the same place: the nodes of their top faces match, the normals do not."""
    corners, cubes = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), (2, 2, 2)
    names = ("one", "other")
    tagged_mesh = structured_mesh(
        MPI.COMM_WORLD,
        [Box(name, *corners, cubes) for name in names],
        [Surface(f"{name}_top", (name,), lambda x: x[2] == 1) for name in names]
        + [Surface("bottom", names, lambda x: x[2] == 0)],
    )
    with pytest.raises(InputError, match="point to the same side"):
        Problem(
            tagged_mesh,
            dict.fromkeys(names, STEEL),
            [Support("bottom")],
            [BodyForce("one", (0.0, 0.0, 1.0))],
            [Contact("one_top", "other_top")],
        )


def test_a_wall_meets_two_blocks_on_each_other_along_one_edge() -> None:
    """Both blocks push along the same normal there, and the wall cannot be the host of both."""
    names = ("wall", "lower", "upper")
    ends = {"wall": ((-1.0, 0.0), (0.0, 2.0)), "lower": ((0.0, 0.0), (1.0, 1.0))}
    ends["upper"] = ((0.0, 1.0), (1.0, 2.0))
    boxes = [
        Box(name, (x[0], 0.0, x[1]), (y[0], 1.0, y[1]), (1, 1, 2 if name == "wall" else 1))
        for name, (x, y) in ends.items()
    ]
    tagged_mesh = structured_mesh(
        MPI.COMM_WORLD,
        boxes,
        [
            Surface("wall_low", ("wall",), lambda x: (x[0] == 0) & (x[2] <= 1)),
            Surface("wall_high", ("wall",), lambda x: (x[0] == 0) & (x[2] >= 1)),
            Surface("lower_side", ("lower",), lambda x: x[0] == 0),
            Surface("upper_side", ("upper",), lambda x: x[0] == 0),
            Surface("lower_top", ("lower",), lambda x: x[2] == 1),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == 1),
            Surface("left", ("wall",), lambda x: x[0] == -1),
            Surface("bottom", ("lower",), lambda x: x[2] == 0),
            Surface("right", ("lower", "upper"), lambda x: x[0] == 1),
            Surface("front", names, lambda x: x[1] == 0),
            Surface("top", ("upper",), lambda x: x[2] == 2),
        ],
    )
    sides = [("wall_low", "lower_side"), ("wall_high", "upper_side")]
    alphas = []
    for wall_first in (True, False):
        problem = Problem(
            tagged_mesh,
            dict.fromkeys(names, STEEL),
            [Support("left"), Support("bottom", "z"), Support("front", "y")],
            [Traction("right", (-1.0, 0.0, 0.0)), Traction("top", (0.0, 0.0, -1.0))],
            [
                *(Contact(*(pair if wall_first else pair[::-1])) for pair in sides),
                Contact("lower_top", "upper_bottom"),
            ],
        )
        assert problem.num_pairs == 12
        assert_inverse(problem.basis)
        level = Newton(problem).solve(100.0)
        assert level.report.converged
        assert level.report.max_penetration < 1e-12
        alphas.append(level.state.alpha)
    assert alphas[0] == pytest.approx(alphas[1], rel=1e-9)


def test_two_contacts_of_the_same_surfaces_are_refused() -> None:
    contacts = [Contact("lower_top", "upper_bottom"), Contact("upper_bottom", "lower_top")]
    assert_refused(
        lambda: touching_blocks(contacts=contacts),
        ["contact 2", "has the same surfaces as contact 1"],
    )
