"""Shakedown of strips and of bodies of revolution: against closed forms.

Bree's wall, a load that moves, plates with a hole: demos/verification/shakedown.py.
"""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Force,
    LoadDomain,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Traction,
    VonMises,
    shakedown_load,
)
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_result import Failure
from tests.limit_analysis.test_shakedown import first_yield
from tests.limit_analysis.test_static_bound import rectangle

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
