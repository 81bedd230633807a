"""Test rigid obstacles: distances, directions, and refusals."""

import math
from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import pytest

from meshes.contact_patch import write_contact_patch
from perfplast_fenicsx import (
    Cylinder,
    InputError,
    Plane,
    Pressure,
    Problem,
    Sphere,
    Support,
    stacked_blocks,
)
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from tests.models import STEEL, Read

ON = "upper_bottom"


@pytest.mark.mpi2
def test_distances_and_directions_of_obstacles() -> None:
    x = np.array([[3.0, 0.0, 4.0], [0.0, 6.0, 8.0]])
    gap, into = Sphere("s", (0.0, 0.0, 0.0), 2.0).towards(x)
    assert gap == pytest.approx([3.0, 8.0])
    assert into == pytest.approx(-x / np.array([[5.0], [10.0]]))
    gap, into = Sphere("s", (0.0, 0.0, 0.0), 12.0, hollow=True).towards(x)
    assert gap == pytest.approx([7.0, 2.0])
    assert into == pytest.approx(x / np.array([[5.0], [10.0]]))
    gap, into = Cylinder("s", (0.0, 5.0, 0.0), (0.0, 7.0, 0.0), 1.0).towards(x)
    assert gap == pytest.approx([4.0, 7.0])
    assert into == pytest.approx(np.array([[-0.6, 0.0, -0.8], [0.0, 0.0, -1.0]]))
    gap, into = Plane("s", (0.0, 0.0, 1.0), (0.0, 0.0, 5.0)).towards(x)
    assert gap == pytest.approx([3.0, 7.0])
    assert into == pytest.approx(np.array([[0.0, 0.0, -1.0]] * 2))
    gap, _ = Plane("s", (0.0, 1.0), (3.0, 4.0)).towards(x[:, :2])
    assert gap == pytest.approx([1.0, 4.0])


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (Plane(ON, (0, 0, 1.01), (0, 0, 1)), ["obstacle 1", "overlap", "0.01", "move"]),
        (Plane(ON, (0, 0, 0.5), (0, 0, -1)), ["obstacle 1", "overlap", "0.5"]),
        (Sphere(ON, (0, 0, 0.5), 0.6), ["obstacle 1", "overlap", "0.1"]),
        (Sphere(ON, (0, 0, 1.5), 0.6, hollow=True), ["obstacle 1", "overlap"]),
        (Plane(ON, (0, 0), (0, 0, 1)), ["plane", "point = [", "3D"]),
        (Plane(ON, (0, 0, 0), (0, 1)), ["plane", "normal = [", "3D"]),
        (Plane(ON, (0, 0, 0), (0, 0, 0)), ["plane", "normal", "zero"]),
        (Plane(ON, (0, 0, math.nan), (0, 0, 1)), ["plane", "point", "finite"]),
        (Sphere(ON, (0, 0, 0, 0), 0.5), ["sphere", "centre", "3D"]),
        (Sphere(ON, (0, 0, 0), 0.0), ["sphere", "radius = 0", "positive"]),
        (Sphere(ON, (0, 0, 0), -1.0), ["sphere", "radius = -1", "positive"]),
        (Sphere(ON, (0, 0, 0), math.inf), ["sphere", "radius = inf", "positive"]),
        (Sphere(ON, (0, 0, 1), 5.0, hollow=True), ["sphere", "centre of the"]),
        (Cylinder(ON, (0, 0, 0), (0, 0, 0), 0.5), ["cylinder", "axis", "zero"]),
        (Cylinder(ON, (0, 0, 0), (0, 1, 0), math.nan), ["cylinder", "radius = nan"]),
        (Cylinder(ON, (0, 0, 1), (0, 1, 0), 3.0, hollow=True), ["cylinder", "on the axis"]),
        (Plane("upper_side", (0, 0, 0), (0, 0, 1)), ["'upper_side'", "lower_top"]),
    ],
)
def test_an_obstacle_that_does_not_fit_is_refused_in_a_sentence(
    comm: MPI.Intracomm, obstacle: Obstacle, words: Sequence[str]
) -> None:
    with pytest.raises(InputError) as refusal:
        Problem(
            stacked_blocks(comm, 2),
            {"lower": STEEL, "upper": STEEL},
            [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
            [Pressure("top", 1.0)],
            obstacles=[obstacle],
        )
    sentence = str(refusal.value)
    for word in words:
        assert word in sentence
    assert "\n" not in sentence
    assert len(set(comm.allgather(sentence))) == 1


def test_a_plane_mesh_has_no_cylinders(read: Read, comm: MPI.Intracomm) -> None:
    with pytest.raises(InputError, match="3D; give a sphere") as refusal:
        Problem(
            read(write_contact_patch, dim=2, size=0.5),
            {"lower": STEEL, "upper": STEEL},
            [Support("x0", "x"), Support("bottom", "y")],
            [Pressure("top", 1.0)],
            obstacles=[Cylinder("lower_seam", (0, 0, 0), (0, 0, 1), 1.0)],
        )
    assert len(set(comm.allgather(str(refusal.value)))) == 1
