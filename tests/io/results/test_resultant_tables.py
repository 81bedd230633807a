"""Test forces and moments in ``summary.json``."""

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Force, Problem, Support, two_blocks
from perfplast_fenicsx.io.results.result_folder import ResultantTables
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.units import Units
from tests.models import STEEL


def loaded(point: tuple[float, float, float]) -> Problem:
    """Return two blocks under a force whose line passes through a point."""
    mesh, load = two_blocks(MPI.COMM_WORLD, 1), Force("top", (0.0, -2.0, -3.0), point=point)
    materials = {"lower": STEEL, "upper": STEEL}
    return Problem(mesh, materials, [Support("left")], [load])


def test_moments_are_told_with_arms_in_metres() -> None:
    problem = loaded((5.0, 1.0, 4.0))
    (plain,) = ResultantTables(Units(), whole=True).loads(problem)
    (told,) = ResultantTables(Units(system="mm-N-MPa"), whole=True).loads(problem)
    assert plain["moment"] == pytest.approx(load_resultants(problem)[0].moment)
    assert plain["moment"] == pytest.approx([5.0, 15.0, -10.0])
    assert told["moment"] == pytest.approx([5e-3, 15e-3, -10e-3])
    assert told["force"] == pytest.approx([0.0, -2.0, -3.0])


def test_moments_of_rounding_are_none() -> None:
    """A force through the origin has no moment, apart from rounding of its nodal forces."""
    problem = loaded((0.0, 0.0, 0.0))
    assert any(load_resultants(problem)[0].moment)
    (told,) = ResultantTables(Units(system="mm-N-MPa"), whole=True).loads(problem)
    assert told["moment"] == [0.0, 0.0, 0.0]
