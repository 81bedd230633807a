"""Test that honest proofs of random bodies pass, for any ratio of their strengths.

``PERFPLAST_FUZZ=10`` tries twenty-five times as many bodies.
"""

import os
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import ResultFolder, read_gmsh
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.random_bodies import problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "0.4"))
CONTRASTS = (1e0, 1e3, 1e6, 1e9, 1e12, 1e15)
COARSE = {163, 205}
"""Meshes of about twenty cells, on which no linear stress in the cells is in equilibrium and
compressive wherever bodies touch. The bound belongs to a stress nearby, minus the cost of its
residuals."""
SEEDS = [
    pytest.param(seed, marks=[] if seed < 104 else [pytest.mark.serial])  # few on several ranks
    for seed in sorted({*range(100, 100 + int(12 * EFFORT)), *COARSE, 240, 276})
]
"""Seeds. In numbers 240 and 276 edges almost cross, and equilibrium rows are almost dependent."""
COARSER = 1.5
"""Ratio of the edge lengths to those in other tests with such bodies."""


@pytest.mark.mpi2("100")
@pytest.mark.parametrize("seed", SEEDS)
def test_an_honest_proof_passes(shared_tmp_path: Path, seed: int) -> None:
    contrast = CONTRASTS[seed % len(CONTRASTS)]
    it = stack(seed, 3 if seed % 7 == 4 else 2)
    it = replace(it, size=COARSER * it.size)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    problem, exact = problem_of(it, read_gmsh(COMM, path), contrast)
    bounds = limit_bounds(problem)
    folder = ResultFolder(COMM, shared_tmp_path)
    lower, upper = proofs(bounds, bounds)
    for bound, half in ((bounds.lower, lower), (bounds.upper, upper)):
        assert (half is not None) == bound.strict
        assert bound.strict or bound.why_not
    if contrast <= 1e6:
        assert bounds.strict
    if seed in COARSE:
        assert bounds.static is not None
        assert any("refine the mesh" in words for words in bounds.static.bound.doubts)
    if lower is None and upper is None:
        return
    write_proof(folder, folder.file("bounds.h5"), lower, upper)
    checked = check(folder.file("bounds.h5"))
    print("FUZZ", seed, contrast, len(it.heights), exact, bounds.in_words(), *checked.values())
    assert set(checked) == {half for half, of in (("lower", lower), ("upper", upper)) if of}
    for of in checked.values():
        assert not of.faults
    if exact is not None:
        for kind, of in checked.items():
            assert of.proven is not None
            assert (of.proven - exact if kind == "lower" else exact - of.proven) <= 1e-9 * exact
