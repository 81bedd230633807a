"""Test random bodies with a constant fraction of their loads, which reduces the limit load.

``PERFPLAST_FUZZ=10`` tries ten times as many bodies.
"""

import os
from dataclasses import replace
from pathlib import Path
from random import Random

from mpi4py import MPI

import pytest

from perfplast_fenicsx import ResultFolder, read_gmsh
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.random_bodies import problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))
SHARES = (-1.0, 0.3, 0.95, 1.4)
"""Fractions of the proven load; the last fraction is too large without other loads."""


@pytest.mark.long(but=["300"])
@pytest.mark.parametrize("seed", range(300, 300 + int(8 * EFFORT)))
def test_a_share_that_stays(shared_tmp_path: Path, seed: int) -> None:
    it = stack(seed, 3 if seed % 8 == 5 else 2)
    it = replace(it, size=1.3 * it.size)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    mesh = read_gmsh(COMM, path)
    plain = limit_bounds(problem_of(it, mesh)[0], 1e-3)
    assert plain.lower.value is not None
    assert plain.upper.value is not None
    dead = Random(seed).choice(SHARES) * plain.lower.value
    bounds = limit_bounds(problem_of(it, mesh, dead=dead)[0], 1e-3)
    assert bounds.strict, bounds.why_not
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    # both brackets contain the same number, and have about the same width
    least, most = bounds.lower.value + dead, bounds.upper.value + dead
    rounding = 1e-8 * plain.upper.value
    assert least <= plain.upper.value + rounding
    assert plain.lower.value <= most + rounding
    wide = plain.upper.value - plain.lower.value + 5e-3 * plain.upper.value
    assert most - least <= 2 * wide
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    print("FUZZ", seed, dead, bounds.in_words(), *checked.values())
    assert set(checked) == {"lower", "upper"}
    assert not any(of.faults for of in checked.values())
