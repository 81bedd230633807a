"""Shakedown of Bree's wall against its closed form."""

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    Elastic,
    LoadDomain,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
)
from perfplast_fenicsx.limit_analysis import shakedown_diagram
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_result import Failure
from perfplast_fenicsx.mesh.box_mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.problem import Temperature


def test_bree(comm: MPI.Intracomm) -> None:
    """A wall under a steady pull x whose gradient of temperature comes and goes, y, in Y.

    x + y/4 ≤ 1, above which the wall gets longer with each cycle, and y ≤ 2, above which its faces
    flow to and fro (Bree, Journal of Strain Analysis 2 (1967), 226). Half of a narrow sheet, whose
    middle stays straight, with an elastic end, where stresses are not those of the wall.
    """
    narrow = 0.01
    bodies = ("bar", "end")
    mesh = structured_mesh(
        comm,
        [
            Box("bar", (0.0, 0.0, 0.0), (2.0, 1.0, narrow), (8, 8, 1)),
            Box("end", (2.0, 0.0, 0.0), (4.5, 1.0, narrow), (10, 8, 1)),
        ],
        [
            Surface("x0", ("bar",), lambda x: x[0] == 0),
            Surface("x1", ("end",), lambda x: x[0] == 4.5),
            Surface("y0", bodies, lambda x: x[1] == 0),
            Surface("z0", bodies, lambda x: x[2] == 0),
            Surface("bar_end", ("bar",), lambda x: x[0] == 2),
            Surface("end_bar", ("end",), lambda x: x[0] == 2),
        ],
    )
    wall = VonMises(2e5, 0.3, 1.0, expansion=5e-6)
    problem = Problem(
        mesh,
        {"bar": wall, "end": Elastic(2e5, 0.3, expansion=5e-6)},
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")],
        [Traction("x1", (1.0, 0.0, 0.0), name="pull")],
        degree=2,
        ties=[Tie("bar_end", "end_bar")],
        initial=[Temperature(body, "2*y - 1", name="heat") for body in bodies],
    )
    domain = LoadDomain.of_corners([{"pull": 1.0}, {"pull": 1.0, "heat": 1.0}])
    for row in shakedown_diagram(problem, domain, directions=3):
        assert row.first is not None
        assert row.second is not None
        x, y = row.first, row.second
        assert max(x + y / 4, y / 2) == pytest.approx(1.0, rel=5e-3)
        assert row.failure == (Failure.ALTERNATING if y / 2 > x + y / 4 else Failure.COLLAPSE)
