"""Shakedown of Bree's wall, sheets, a beam, a plate with a hole: against closed forms."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Elastic,
    Force,
    LoadDomain,
    Pressure,
    Problem,
    RigidSurface,
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
from tests.limit_analysis.test_shakedown import first_yield, tube
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


def test_a_strip_that_a_plate_bends(comm: MPI.Intracomm) -> None:
    """A moment on a rigid end that comes and goes: 2k h²/4 in plane strain, as once."""
    surfaces = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 4 - 1e-9}
    mesh = rectangle((16, 4), (4.0, 1.0), {"strip": lambda x: x[0] < 9}, surfaces, comm=comm)
    problem = Problem(
        mesh,
        {"strip": STEEL},
        [Support("left")],
        [Force("right", (), 1.0, point=(4.0, 0.5), name="M")],
        degree=2,
        rigid=[RigidSurface("right")],
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"M": (0.0, 1.0)}))
    assert found.load == pytest.approx(0.5 / 3**0.5, rel=2e-4)
    assert found.failure == Failure.COLLAPSE


def hoop(radius: float) -> tuple[float, float]:
    """Largest and smallest hoop stress at a hole of radius 1 in a round plate that is pulled by 1.

    By Airy's functions (A r² + B r⁴ + C/r² + D) cos 2θ and that of Lamé; 3 and −1 (G. Kirsch 1898)
    of an infinite one.
    """
    b = radius**2
    rows = [
        [2, 0, 6, 4],
        [2, 6, -6, -2],
        [2, 0, 6 / b**2, 4 / b],
        [2, 6 * b, -6 / b**2, -2 / b],
    ]
    far, quartic, near, _ = np.linalg.solve(rows, [0.0, 0.0, -0.5, -0.5])
    mean, part = b / (b - 1), 2 * far + 12 * quartic + 6 * near
    return float(mean - part), float(mean + part)


def test_a_plate_with_a_hole(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """Two tensions that come and go by themselves: the edge of the hole flows to and fro.

    Its hoop stress may vary by 2σ_y: K p₁ − K' p₂ ≤ 2σ_y, and with p₁ and p₂ changed round.
    """
    radius = 5.0
    problem = Problem(
        tube(comm, shared_tmp_path, radius, 0.15, 1).thin(),
        {"tube": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [
            Traction("outer", (f"x/{radius}", "0*x"), name="one"),
            Traction("outer", ("0*x", f"y/{radius}"), name="other"),
        ],
        degree=2,
    )
    most, least = hoop(radius)
    domain = LoadDomain.of_ranges({"one": (0.0, 1.0), "other": (0.0, 1.0)})
    for row in shakedown_diagram(problem, domain, directions=3):
        assert row.first is not None
        assert row.second is not None
        large, small = max(row.first, row.second), min(row.first, row.second)
        assert most * large - least * small == pytest.approx(2.0, rel=0.01)
        assert row.failure == Failure.ALTERNATING


@pytest.mark.parametrize("ratio", [1.5, 2.0, 3.0])
def test_a_tube_by_its_section(ratio: float, comm: MPI.Intracomm) -> None:
    """As a body of revolution: twice the load of first yield, or the limit load if that is less."""
    thick, height = ratio - 1, 0.25
    surfaces = {
        "inner": lambda x: x[0] < 1e-9,
        "low": lambda x: x[1] < 1e-9,
        "high": lambda x: x[1] > height - 1e-9,
    }
    mesh = rectangle((12, 2), (thick, height), {"tube": lambda x: x[0] < 9}, surfaces, comm=comm)
    x = mesh.mesh.geometry.x
    x[:, 0] = 1 + thick * (x[:, 0] / thick) ** 2  # finer towards the bore, where it yields first
    problem = Problem(
        mesh.turned(),
        {"tube": STEEL},
        [Support("low", "y"), Support("high", "y")],
        [Pressure("inner", 1.0, name="p")],
        degree=2,
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"p": (0.0, 1.0)}))
    twice, limit = 2 * first_yield(ratio), 2 * np.log(ratio)  # in k = 1/√3
    assert found.load == pytest.approx(min(twice, limit) / 3**0.5, rel=2e-3)
    assert found.failure == (Failure.ALTERNATING if twice < limit else Failure.COLLAPSE)
