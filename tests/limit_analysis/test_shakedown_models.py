"""Test shakedown of strips and of bodies of revolution against closed forms.

For Bree's wall, a moving load and plates with a hole see demos/verification/shakedown.py.
"""

import math

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Force,
    LoadDomain,
    MohrCoulomb,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Traction,
    Tresca,
    VonMises,
    shakedown_load,
)
from perfplast_fenicsx.limit_analysis.conic.conic_solver import conic_solver
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import Failure
from perfplast_fenicsx.materials import Material
from tests.limit_analysis.test_shakedown import first_yield
from tests.limit_analysis.test_static_bound import rectangle

STEEL = VonMises(2e5, 0.3, 1.0)


@pytest.mark.parametrize(("thin", "exact"), [(True, 1.0), (False, 2 / 3**0.5)])
def test_a_strip_that_is_pulled(thin: bool, exact: float, comm: MPI.Intracomm) -> None:
    """A sheet contracts freely through its thickness. In plane strain the strip resists this."""
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


def test_a_strip_that_a_plate_bends(comm: MPI.Intracomm) -> None:
    """Cyclic moment on a rigid end: 2k h²/4 in plane strain, like the limit load."""
    surfaces = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 4 - 1e-9}
    mesh = rectangle((16, 4), (4.0, 1.0), {"strip": lambda x: x[0] < 9}, surfaces, comm=comm)
    problem = Problem(
        mesh,
        {"strip": STEEL},
        [Support("left"), RigidSurface("right")],
        [Force("right", (), 1.0, point=(4.0, 0.5), name="M")],
        degree=2,
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"M": (0.0, 1.0)}))
    assert found.load == pytest.approx(0.5 / 3**0.5, rel=2e-4)
    assert found.failure == Failure.COLLAPSE


def tube_section(comm: MPI.Intracomm, law: Material, ratio: float, cells: int = 12) -> Problem:
    """Return a tube as a body of revolution, with a pressure inside."""
    thick, height = ratio - 1, 0.25
    surfaces = {
        "inner": lambda x: x[0] < 1e-9,
        "low": lambda x: x[1] < 1e-9,
        "high": lambda x: x[1] > height - 1e-9,
    }
    mesh = rectangle((cells, 2), (thick, height), {"tube": lambda x: x[0] < 9}, surfaces, comm=comm)
    x = mesh.mesh.geometry.x
    x[:, 0] = 1 + thick * (x[:, 0] / thick) ** 2  # smaller cells at the bore
    return Problem(
        mesh.turned(),
        {"tube": law},
        [Support("low", "y"), Support("high", "y")],
        [Pressure("inner", 1.0, name="p")],
        degree=2,
    )


@pytest.mark.parametrize("ratio", [1.5, 2.0, 3.0])
def test_a_tube_by_its_section(ratio: float, comm: MPI.Intracomm) -> None:
    """Body of revolution: twice the load at first yield, or the limit load if smaller."""
    problem = tube_section(comm, STEEL, ratio)
    found = shakedown_load(problem, LoadDomain.of_ranges({"p": (0.0, 1.0)}))
    twice, limit = 2 * first_yield(ratio), 2 * np.log(ratio)  # in k = 1/√3
    assert found.load == pytest.approx(min(twice, limit) / 3**0.5, rel=2e-3)
    assert found.failure == (Failure.ALTERNATING if twice < limit else Failure.COLLAPSE)


@pytest.mark.serial
@pytest.mark.parametrize("law", [STEEL, Tresca(2e4, 0.3, 1.5), MohrCoulomb(2e4, 0.3, 1.5, 20.0)])
def test_clarabel_finds_the_same(law: Material, comm: MPI.Intracomm) -> None:
    """The program is the same, in the form of matrices and cones."""
    pytest.importorskip("clarabel", reason="the conic solver Clarabel is not installed")
    problem, domain = tube_section(comm, law, 3.0, 6), LoadDomain.of_ranges({"p": (0.0, 1.0)})
    ours = shakedown_load(problem, domain, 1e-6)
    with conic_solver("clarabel"):
        theirs = shakedown_load(problem, domain, 1e-6)
    assert theirs.load == pytest.approx(ours.load, rel=2e-6)
    assert theirs.upper == pytest.approx(ours.upper, rel=2e-6)


@pytest.mark.long(but=["0.0-5.0", "20.0-2.0"])
@pytest.mark.parametrize("ratio", [2.0, 5.0])
@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_a_tube_with_principal_stresses(angle: float, ratio: float, comm: MPI.Intracomm) -> None:
    """Tresca and Mohr–Coulomb: the flow of the bore alternates, or the tube collapses.

    With b = 2c cos φ, the bore carries at least −b/(1 − s) when the pressure is zero, and (1 +
    s)σ_θ + (1 − s)p ≤ b under the pressure. The limit load follows from σ_r' = (σ_θ − σ_r)/r at
    yield.
    """
    s, c = math.sin(math.radians(angle)), 1.5
    law = MohrCoulomb(2e4, 0.3, c, angle) if angle else Tresca(2e4, 0.3, c)
    b, k = 2 * c * math.cos(math.radians(angle)), (1 + ratio**2) / (ratio**2 - 1)
    alternates = 2 * b / ((1 - s) * ((1 + s) * k + 1 - s))
    collapses = b * (ratio ** (2 * s / (1 + s)) - 1) / (2 * s) if s else b * math.log(ratio)
    problem = tube_section(comm, law, ratio, 20)
    found = shakedown_load(problem, LoadDomain.of_ranges({"p": (0.0, 1.0)}))
    assert found.converged
    assert found.load == pytest.approx(min(alternates, collapses), rel=4e-3)
    grows = Failure.BOTH if angle else Failure.ALTERNATING  # ground dilates at either corner
    assert found.failure == (grows if ratio > 3 else Failure.COLLAPSE)
