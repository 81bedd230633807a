"""Bounds of random bodies are bounds, and what proves them on file is enough.

``PERFPLAST_FUZZ=20`` tries twenty times as many.
"""

import os
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import ResultFolder, read_gmsh
from perfplast_fenicsx.io.results.proof_file import VelocityProof, write_proof
from perfplast_fenicsx.limit_analysis import (
    Verdict,
    interior_point,
    strict_upper_bound,
    without_entering,
)
from perfplast_fenicsx.mesh import alfeld_split
from perfplast_fenicsx.proof import check
from tests.random_bodies import problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))
SEEDS = [(seed, 3 if seed % 5 == 4 else 2) for seed in range(int(10 * EFFORT))]


@pytest.mark.parametrize(("seed", "dim"), SEEDS)
def test_random_bodies(shared_tmp_path: Path, seed: int, dim: int) -> None:
    it = stack(seed, dim)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    mesh = read_gmsh(COMM, path)
    problem, exact = problem_of(it, mesh if dim == 2 else alfeld_split(mesh))
    mended = without_entering(problem)
    assert mended is not None
    limit = interior_point(mended)
    print(seed, dim, problem, limit, exact)
    upper = strict_upper_bound(problem, limit.mechanism)
    print(upper)
    assert limit.verdict is not Verdict.STALLED
    if limit.verdict is not Verdict.FOUND:
        return
    assert upper.strict
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(
        folder, folder.file("bounds.h5"), None, VelocityProof(problem, upper.value, limit.mechanism)
    )
    checked = check(folder.file("bounds.h5"))
    print(checked["upper"])
    assert not checked["upper"].faults
    if exact is not None:
        assert checked["upper"].proven >= exact * (1 - 1e-9)
