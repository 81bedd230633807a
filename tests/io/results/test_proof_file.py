"""Test that files prove bounds, and that one sentence refuses bounds that they cannot contain."""

from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.contact_patch import write_contact_patch
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Pressure,
    Problem,
    ResultFolder,
    Sphere,
    Support,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import judge, save_proof, write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds, limit_load
from perfplast_fenicsx.limit_analysis.body.limit_bounds import bounds_of_mesh
from perfplast_fenicsx.limit_analysis.body.proof_arrays import VelocityProof
from perfplast_fenicsx.limit_analysis.statements.load_factor import Scope
from perfplast_fenicsx.proof import check
from tests.checks import assert_refused
from tests.models import STEEL, Read

COMM = MPI.COMM_WORLD


def refused(problem: Problem, folder: Path, words: list[str]) -> None:
    """Check that nothing is written."""
    proof = VelocityProof(problem, 1.0, fem.Function(problem.V))
    results = ResultFolder(COMM, folder)
    assert_refused(lambda: write_proof(results, results.file("bounds.h5"), None, proof), words)
    assert not results.file("bounds.h5").exists()


def test_what_no_proof_can_say(shared_tmp_path: Path) -> None:
    problem = Problem(
        stacked_blocks(COMM, 1),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("upper_bottom")],
        [Pressure("lower_top", 1.0)],
        obstacles=[Sphere("top", (0.5, 0.5, 5.0), 2.0)],
        degree=2,
    )
    refused(problem, shared_tmp_path, ["'top'", "curved", "planes"])


@pytest.mark.mpi2
def test_the_upper_bound_of_linear_elements(shared_tmp_path: Path) -> None:
    problem = Problem(
        stacked_blocks(COMM, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=1,
    )
    bounds = bounds_of_mesh(problem, limit_load(problem))
    assert bounds.upper.strict
    results = ResultFolder(COMM, shared_tmp_path)
    path = results.file("bounds.h5")
    _, high = judge(results, path, bounds, bounds)
    assert high.upper.strict
    found = check(path)
    assert list(found) == ["upper"]
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-9)
    assert found["upper"].proven is not None
    over = found["upper"].proven / STEEL.yield_stress - 1.0
    assert -1e-12 < over < 1e-4, "the search ends when both sides of the mesh are 1e-4 apart"
    other = shared_tmp_path / "new" / "proof.h5"
    again = save_proof(bounds, other)["upper"].proven
    assert again == pytest.approx(found["upper"].proven, rel=1e-12)
    assert sorted(path.name for path in other.parent.iterdir()) == ["proof.h5"]
    none = replace(bounds, upper=replace(bounds.upper, of=Scope.MESH, why_not=("it is curved",)))
    assert_refused(lambda: save_proof(none, other), ["no proof", "it is curved"])


def test_curved_cells(shared_tmp_path: Path, read: Read) -> None:
    tube = read(write_thick_tube, size=0.3, order=2)
    supports = [Support("x0", "x"), Support("y0", "y")]
    problem = Problem(tube, {"tube": STEEL}, supports, [Pressure("inner", 1.0)], degree=2)
    refused(problem, shared_tmp_path, ["curved", "first-order"])


@pytest.mark.mpi2("2")
@pytest.mark.long(but=["2"])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_bounds_of_a_body(shared_tmp_path: Path, read: Read, dim: int) -> None:
    blocks = read(write_contact_patch, dim=dim, size=0.7)
    sides = [Support("x0", "x"), *([Support("y0", "y")] if dim == 3 else [])]
    problem = Problem(
        blocks,
        {"lower": STEEL, "upper": STEEL},
        [*sides, Support("bottom")],
        [Pressure("top", 1.0)],
        [Contact("lower_seam", "upper_seam")],
        degree=2,
    )
    bounds = limit_bounds(problem)
    results = ResultFolder(COMM, shared_tmp_path)
    path = results.file("bounds.h5")
    low, high = judge(results, path, bounds, bounds)
    assert low is high is bounds
    found = check(path)
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-9)
    # A stress that nearly balances the loads proves a smaller bound, which the program then
    # reports.
    honest = found["lower"].proven
    more = replace(bounds, lower=replace(bounds.lower, value=1.001 * found["lower"].claimed))
    low, high = judge(results, path, more, bounds)
    assert low.lower.strict and high.upper.strict
    assert low.lower.value is not None and honest is not None
    assert 0 < low.lower.value <= honest
    assert check(path)["lower"].proven == low.lower.value
    # Bounds not proven by the stress or the mechanism are bounds for the mesh, and not on file.
    assert bounds.stress is not None
    more = replace(bounds, stress=np.full_like(bounds.stress, np.nan))
    low, high = judge(results, path, more, bounds)
    assert (low.lower.strict, high.upper.strict) == (False, True)
    assert "proof checker" in low.lower.why_not[0]
    assert list(check(path)) == ["upper"]
    less = replace(bounds, upper=replace(bounds.upper, value=0.5 * found["upper"].claimed))
    low, high = judge(results, path, more, less)
    assert not low.lower.strict
    assert high.upper.value == pytest.approx(found["upper"].proven, rel=1e-9)
    still = bounds.mechanism.copy()
    still.x.array[:] = 0.0
    less = replace(bounds, mechanism=still)
    low, high = judge(results, path, more, less)
    assert not (low.lower.strict or high.upper.strict)
    COMM.Barrier()
    assert not path.exists()
