"""Shakedown of Bree's wall, a sheet and a beam against closed forms."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Elastic,
    LoadDomain,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
    shakedown_load,
)
from perfplast_fenicsx.limit_analysis import shakedown_diagram
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_result import Failure
from perfplast_fenicsx.mesh.box_mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.problem import Temperature
from tests.limit_analysis.test_static_bound import rectangle


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


STEEL = VonMises(2e5, 0.3, 1.0)


@pytest.mark.parametrize(("thin", "exact"), [(True, 1.0), (False, 2 / 3**0.5)])
def test_a_strip_that_is_pulled(thin: bool, exact: float, comm: MPI.Intracomm) -> None:
    """A sheet grows thinner as it likes; in plane strain the strip resists that."""
    surfaces = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 4 - 1e-9,
        "bottom": lambda x: x[1] < 1e-9,
    }
    mesh = rectangle((4, 1), (4.0, 1.0), {"strip": lambda x: x[0] < 9}, surfaces, comm=comm)
    problem = Problem(
        mesh.thin() if thin else mesh,
        {"strip": STEEL},
        [Support("left", "x"), Support("bottom", "y")],
        [Traction("right", (1.0, 0.0), name="pull")],
        degree=2,
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"pull": (0.0, 1.0)}))
    assert found.load == pytest.approx(exact, rel=2e-4)


def test_a_load_that_moves_along_a_beam(comm: MPI.Intracomm) -> None:
    """A beam on two supports yields more and more where the load has its largest moment.

    Along it nothing is left to shake down to: P(L/4 − c/8) = σ_y h²/4 under a load over c, as if it
    stood in the middle. A slender one, since the load spreads over its height.
    """
    length, width, places = 24.0, 0.5, (6.0, 12.0, 18.0)
    ends = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > length - 1e-9}
    under = {
        f"at{number}": lambda x, place=place: (
            (x[1] > 1 - 1e-9) & (np.abs(x[0] - place) < width / 2 + 1e-9)
        )
        for number, place in enumerate(places)
    }
    size = (length, 1.0)
    mesh = rectangle((96, 4), size, {"beam": lambda x: x[1] < 2}, ends | under, comm=comm)
    problem = Problem(
        mesh.thin(),
        {"beam": STEEL},
        [Support("left", "y"), Support("right", "y")],
        [Traction(on, (0.0, -1 / width), name=on) for on in under],
        degree=2,
    )
    domain = LoadDomain.of_corners([{}, *({on: 1.0} for on in under)])
    found = shakedown_load(problem, domain)
    assert found.load == pytest.approx(0.25 / (length / 4 - width / 8), rel=0.02)
    assert found.failure == Failure.COLLAPSE
