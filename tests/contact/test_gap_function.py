"""Test gaps that are measured along the normal or given by a formula."""

from mpi4py import MPI

import numpy as np
import pytest

from meshes.hertz_line import write_hertz_line
from perfplast_fenicsx import (
    Contact,
    Elastic,
    InputError,
    Newton,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
)
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from tests.checks import assert_solved
from tests.models import STEEL, Read, touching_blocks


def cylinders(tagged_mesh: TaggedMesh, gap: float | str | None = None, degree: int = 1) -> Problem:
    """Return two elastic cylinders, each the mirror image of the other."""
    return Problem(
        tagged_mesh,
        {"upper": STEEL, "lower": Elastic(7e4, 0.3)},
        [Support("x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("upper_arc", "lower_arc", gap)],
        degree=degree,
    )


@pytest.mark.parametrize(("size", "degree"), [(0.03, 1), (0.03, 2), (0.006, 2)])
def test_the_gap_of_mirror_images_is_twice_the_height(read: Read, size: float, degree: int) -> None:
    """This also holds if the mesh is much finer than the gap.

    Then the nearest node is not the partner.
    """
    problem = cylinders(
        read(write_hertz_line, bodies=2, contact_size=size, order=degree), None, degree
    )
    y = np.abs(problem.V.tabulate_dof_coordinates()[problem.constraints.host, 1])
    assert problem.num_pairs >= 10
    assert problem.constraints.gap == pytest.approx(2 * y, abs=1e-12)
    assert np.abs(problem.constraints.normal[:, 0]).max(initial=0) < 1e-12
    assert problem.has_gaps


def test_a_formula_gives_the_gap_that_would_be_measured(read: Read) -> None:
    tagged_mesh = read(write_hertz_line, bodies=2, contact_size=0.03)
    levels = [
        Newton(cylinders(tagged_mesh, gap)).solve(30.0) for gap in (None, "2*(1 - sqrt(1 - x**2))")
    ]
    assert_solved(levels[0])
    assert levels[1].report.alpha == pytest.approx(levels[0].report.alpha, rel=1e-9)
    closed = Newton(cylinders(tagged_mesh, 0.0)).solve(30.0)
    assert closed.report.alpha < 0.9 * levels[0].report.alpha


@pytest.mark.mpi2
def test_a_gap_between_parallel_faces_is_measured_and_closed(comm: MPI.Intracomm) -> None:
    def apart(distance: float) -> Problem:
        boxes = [
            Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2)),
            Box("upper", (0.0, 0.0, 1.0 + distance), (1.0, 1.0, 2.0 + distance), (2, 2, 2)),
        ]
        both, top = ("lower", "upper"), 2.0 + distance
        surfaces = [
            Surface("bottom", ("lower",), lambda x: np.isclose(x[2], 0)),
            Surface("top", ("upper",), lambda x: np.isclose(x[2], top)),
            Surface("lower_top", ("lower",), lambda x: np.isclose(x[2], 1)),
            Surface("upper_bottom", ("upper",), lambda x: np.isclose(x[2], 1 + distance)),
            Surface("x0", both, lambda x: np.isclose(x[0], 0)),
            Surface("y0", both, lambda x: np.isclose(x[1], 0)),
        ]
        return Problem(
            structured_mesh(comm, boxes, surfaces),
            dict.fromkeys(both, STEEL),
            [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
            [Pressure("top", 1.0)],
            [Contact("upper_bottom", "lower_top")],
            degree=2,
        )

    problem = apart(0.02)
    assert problem.constraints.gap == pytest.approx(0.02)
    level = Newton(problem).solve(100.0)
    assert_solved(level)
    assert level.report.alpha == pytest.approx(0.02 + 2 * 100 / STEEL.young, rel=1e-9)
    with pytest.raises(InputError, match=r"by up to 0\.1") as refusal:
        apart(-0.1)
    assert len(set(comm.allgather(str(refusal.value)))) == 1


def test_a_formula_may_round_to_less_than_no_gap() -> None:
    rounded = Contact("lower_top", "upper_bottom", "0*x - 1e-17")
    gap = touching_blocks(contacts=[rounded]).constraints.gap
    assert not gap.any()
