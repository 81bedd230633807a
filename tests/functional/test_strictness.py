"""Bounds of random bodies are bounds, and what proves them on file is enough.

``PERFPLAST_FUZZ=20`` tries twenty times as many.
"""

import os
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import ResultFolder, read_gmsh
from perfplast_fenicsx.io.results.proof_file import proofs, write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.adaptation import refined
from perfplast_fenicsx.proof import check
from tests.random_bodies import problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))
SEEDS = [
    pytest.param(
        seed,
        3 if seed % 5 == 4 else 2,
        marks=[] if seed in (1, 4, 20) else [pytest.mark.serial],  # few on several ranks
    )
    for seed in sorted({*range(int(10 * EFFORT)), 20})
]
"""In number 20 equilibrium leaves one contact force nothing but zero."""


@pytest.mark.parametrize(("seed", "dim"), SEEDS)
def test_random_bodies(shared_tmp_path: Path, seed: int, dim: int) -> None:
    it = stack(seed, dim)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    problem, exact = problem_of(it, read_gmsh(COMM, path))
    bounds = limit_bounds(problem)
    if bounds.lower.value == 0.0:  # exactly, of a mesh that is said to be too coarse
        assert "refine the mesh" in bounds.in_words()
        every = np.ones(len(problem.tagged_mesh.cell_tags.indices), dtype=np.bool_)
        bounds = limit_bounds(problem.on(refined(problem, every)))
    assert bounds.strict

    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    print(seed, dim, bounds.problem, *checked.values(), exact)
    assert not checked["lower"].faults
    assert not checked["upper"].faults
    lowest, highest = checked["lower"].proven, checked["upper"].proven
    assert lowest is not None
    assert highest is not None
    assert lowest == pytest.approx(bounds.lower.value, rel=1e-9)
    assert highest == pytest.approx(bounds.upper.value, rel=1e-9)
    assert lowest <= highest * (1 + 1e-9)
    if exact is not None:
        assert lowest <= exact * (1 + 1e-9)
        assert exact <= highest * (1 + 1e-9)
        assert highest - lowest <= 3e-4 * exact
