"""Test tied surfaces: two bodies act as one for any nodes, and refusals."""

from collections.abc import Sequence
from itertools import product
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Newton,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
    limit_load,
)
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from tests.checks import assert_refused, assert_solved, largest
from tests.contact.blocks_apart import blocks_apart

STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=300.0)
COUNTS = {2: ((5, 3), (7, 3)), 3: ((3, 3, 2), (4, 4, 2))}


def sheared(gdim: int, degree: int, **tie: Any) -> Problem:
    """Return two glued blocks on a fixed floor; ζ pulls the top sideways."""
    return Problem(
        blocks_apart(MPI.COMM_WORLD, *COUNTS[gdim]),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [Traction("top", (1.0, *[0.0] * (gdim - 2), 1.0))],
        degree=degree,
        contacts=[Tie("lower_top", "upper_bottom", **tie)],
    )


@pytest.mark.parametrize(
    ("gdim", "degree", "hosts", "slope"),
    [
        *product((2, 3), (1, 2), ("primary", "secondary"), (0.0,)),
        *product((2, 3), (1, 2), ("secondary",), (0.4,)),
    ],
)
def test_uniform_tension_is_transmitted(
    gdim: int, degree: int, hosts: Any, slope: float, comm: MPI.Intracomm
) -> None:
    """Both bodies have one linear displacement; no pressure or friction holds them together."""
    vertical = "xyz"[gdim - 1]
    sides = [f"{body}{axis}0" for axis in "xyz"[: gdim - 1] for body in ("", "upper_")]
    problem = Problem(
        blocks_apart(comm, *COUNTS[gdim], slope=slope),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", vertical), *(Support(side, side[-2]) for side in sides)],
        [Pressure("top", -1.0)],
        degree=degree,
        contacts=[Tie("lower_top", "upper_bottom", hosts)],
    )
    level = Newton(problem).solve(100.0)
    assert_solved(level)
    x = problem.V.tabulate_dof_coordinates()[:, :gdim]
    nu = STEEL.poisson
    along, aside = (1 - nu**2, nu * (1 + nu)) if gdim == 2 else (1.0, nu)
    expected = x * np.array([*[-aside] * (gdim - 1), along]) * 100.0 / STEEL.young
    u = level.state.u.x.array.reshape(-1, gdim)
    assert largest(comm, u - expected) < 1e-12 * 100.0 / STEEL.young


@pytest.mark.parametrize("degree", [1, 2])
def test_matching_halves_are_one_mesh(degree: int, comm: MPI.Intracomm) -> None:
    """Tied and continuous meshes have the same displacements, elastic and plastic."""

    def blocks(split: bool) -> Problem:
        cut = [Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))]
        cut.append(Box("upper", (0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (2, 2, 2)))
        whole = [Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, 2.0), (2, 2, 4))]
        names = ("lower", "upper") if split else ("lower",)
        surfaces = [
            Surface("bottom", ("lower",), lambda x: x[2] == 0),
            Surface("top", names[-1:], lambda x: x[2] == 2),
            Surface("y0", names, lambda x: x[1] == 0),
        ]
        if split:
            surfaces.append(Surface("lower_top", ("lower",), lambda x: x[2] == 1))
            surfaces.append(Surface("upper_bottom", ("upper",), lambda x: x[2] == 1))
        return Problem(
            structured_mesh(comm, cut if split else whole, surfaces),
            dict.fromkeys(names, STEEL),
            [Support("bottom"), Support("y0", "y")],
            [Traction("top", (1.0, 0.0, 0.5))],
            degree=degree,
            contacts=[Tie("lower_top", "upper_bottom")] if split else [],
        )

    for load in (10.0, 35.0):
        glued, one = (Newton(blocks(split)).solve(load) for split in (True, False))
        assert_solved(glued)
        assert glued.report.alpha == pytest.approx(one.report.alpha, rel=1e-12)


@pytest.mark.mpi3("2")
@pytest.mark.parametrize("gdim", [2, 3])
def test_glue_certifies_and_is_the_same_on_one_rank(gdim: int, comm: MPI.Intracomm) -> None:
    level = Newton(sheared(gdim, 1)).solve(20.0)
    assert_solved(level)
    assert level.report.contact_pairs == 0
    assert abs(level.report.duality_gap) < 1e-11


@pytest.mark.parametrize("degree", [2])
def test_limit_load_of_glued_blocks_in_tension(degree: int) -> None:
    """The limit load is 2k in plane strain, as for one block, across an inclined seam."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, *COUNTS[2], slope=0.4),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", "y"), Support("x0", "x"), Support("upper_x0", "x")],
        [Pressure("top", -1.0)],
        degree=degree,
        contacts=[Tie("lower_top", "upper_bottom")],
    )
    found = limit_load(problem)
    assert found.estimate == pytest.approx(2 / np.sqrt(3) * 300.0, rel=1e-4)


def test_bad_ties_are_refused() -> None:
    mesh = blocks_apart(MPI.COMM_WORLD, *COUNTS[2])

    def make(*pairs: Contact | Tie, supports: Sequence[Support] = (Support("bottom"),)) -> Problem:
        materials, loads = {"lower": STEEL, "upper": STEEL}, [Pressure("top", 1.0)]
        return Problem(mesh, materials, supports, loads, pairs)

    tie = Tie("lower_top", "upper_bottom")
    assert_refused(lambda: make(Tie("top", "top")), ["tie 1", "itself"])
    assert_refused(lambda: make(Tie("x0", "top")), ["tie 1", "nowhere opposite"])
    assert_refused(lambda: make(tie, tie), ["tie 2", "has the same surfaces as tie 1"])
    moved = [Support("bottom"), Support("upper_x0", "x", 1e-3)]
    assert_refused(lambda: make(tie, supports=moved), ["support moves nodes of a tied surface"])
    contact = Contact("lower_top", "upper_bottom")
    assert_refused(lambda: make(tie, contact), ["tie 1", "has the same surfaces as contact 1"])


def test_a_ring_of_ties_is_refused(comm: MPI.Intracomm) -> None:
    """Four blocks meet at an edge: each node there would be the guest of the next node."""
    at = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (1.0, 1.0), "d": (0.0, 1.0)}
    boxes = [Box(name, (x, 0.0, z), (x + 1, 1.0, z + 1), (1, 1, 1)) for name, (x, z) in at.items()]
    surfaces = [Surface("floor", ("a", "b"), lambda x: x[2] == 0)]
    for one, other, axis in (("a", "b", 0), ("b", "c", 2), ("c", "d", 0), ("d", "a", 2)):
        for name, by in ((one, other), (other, one)):
            surfaces.append(Surface(name + by, (name,), lambda x, axis=axis: x[axis] == 1))

    def glued(*pairs: str) -> Problem:
        return Problem(
            structured_mesh(comm, boxes, surfaces),
            dict.fromkeys(at, STEEL),
            [Support("floor")],
            [BodyForce("c", (0.0, 0.0, -1.0))],
            contacts=[Tie(pair, pair[::-1]) for pair in pairs],
        )

    assert_solved(Newton(glued("ab", "bc", "cd")).solve(1.0))
    assert_refused(lambda: glued("ab", "bc", "cd", "da"), ["ring of bodies", "remove one"])


@pytest.mark.parametrize(("gdim", "hosts"), list(product((2, 3), ("primary", "secondary"))))
def test_supports_at_a_seam_are_told_their_own_forces(
    gdim: int, hosts: Any, comm: MPI.Intracomm
) -> None:
    """Forces of a tie on supported nodes do not count as reactions of the support."""
    vertical = "xyz"[gdim - 1]
    problem = Problem(
        blocks_apart(comm, *COUNTS[gdim]),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom", vertical), *(Support(f"{axis}0", axis) for axis in "xyz"[: gdim - 1])],
        [Pressure("top", 1.0)],
        contacts=[Tie("lower_top", "upper_bottom", hosts)],
    )
    report = Newton(problem).solve(10.0).report
    assert report.balance < 1e-12
    np.testing.assert_allclose(report.reactions["support bottom"][-1], 10.0, rtol=1e-10)
    np.testing.assert_allclose(report.reactions["support x0"], np.zeros(gdim), atol=1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_glued_blocks_between_plates(degree: int, comm: MPI.Intracomm) -> None:
    """A moving support that holds no node of the seam causes the stress E'd/H, and its reaction."""
    problem = Problem(
        blocks_apart(comm, *COUNTS[2]),
        {"lower": STEEL, "upper": STEEL},
        [
            Support("bottom", "y"),
            Support("top", "y", -1e-3),
            Support("x0", "x"),
            Support("upper_x0", "x"),
        ],
        [Pressure("upper_bottom", 1.0)],
        degree=degree,
        contacts=[Tie("lower_top", "upper_bottom")],
    )
    level = Newton(problem).solve(0.0)
    assert level.report.converged
    assert abs(level.report.duality_gap) < 1e-11
    stress = 2e5 / (1 - 0.3**2) * 1e-3 / 2
    np.testing.assert_allclose(level.report.reactions["support top"], [0, -stress], atol=1e-8)


@pytest.mark.parametrize("height", [1.0, 1.2])
def test_surfaces_that_are_apart_are_not_glued(height: float, comm: MPI.Intracomm) -> None:
    def problem() -> Problem:
        return Problem(
            blocks_apart(comm, *COUNTS[2], height=height),
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom")],
            [Pressure("top", 1.0)],
            contacts=[Tie("lower_top", "upper_bottom")],
        )

    if height > 1.0:
        assert_refused(problem, ("apart", "touch"))
    else:
        assert problem().num_tied
