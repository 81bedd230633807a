"""Test that both bounds on a mesh are optimal, with another program, if it is installed."""

from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import ResultFolder, read_gmsh
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.mesh.alfeld_split import alfeld_split
from perfplast_fenicsx.proof.body import Body
from tests.proof.conic_oracle import best_load, least_power
from tests.random_bodies import problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
INSIDE = {2: 1 / 6, 3: (5 - 5**0.5) / 20}
"""Smallest barycentric coordinate of the quadrature points of degree 2."""


@pytest.mark.parametrize(("seed", "dim"), [(1, 2), (2, 2), (5, 2), (13, 2), (17, 2), (9, 3)])
def test_both_bounds_are_the_best_of_the_mesh(shared_tmp_path: Path, seed: int, dim: int) -> None:
    pytest.importorskip("clarabel", reason="the conic solver Clarabel is not installed")
    it = stack(seed, dim)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    mesh = read_gmsh(COMM, path)
    problem, _ = problem_of(it, alfeld_split(mesh) if dim == 2 else mesh)
    bounds = limit_bounds(problem, 1e-5)
    assert bounds.lower.value is not None
    assert bounds.mesh.estimate is not None

    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    with h5py.File(folder.file("bounds.h5")) as file:
        bodies = {kind: Body.of({n: a[()] for n, a in file[kind].items()}) for kind in file}
        nodes = file["upper"]["nodes"][()]
    points = np.full((dim + 1, dim + 1), INSIDE[dim]) + np.eye(dim + 1) * (
        1 - (dim + 1) * INSIDE[dim]
    )
    answers = {
        bounds.lower.value: best_load(bodies["lower"]),
        bounds.mesh.estimate: least_power(bodies["upper"], nodes, points),
    }
    known = {ours: theirs for ours, theirs in answers.items() if theirs is not None}
    print(seed, answers)
    for ours, theirs in known.items():
        assert ours == pytest.approx(theirs, rel=1e-5)
    assert known
