"""Test Total FETI for unusual distributions of the mesh over the ranks."""

from collections.abc import Callable
from functools import partial

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Newton, NewtonOptions, Pressure, Problem, Support
from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh
from tests.models import STEEL

COMM = MPI.COMM_WORLD


def two_cubes(comm: MPI.Intracomm, n: int, rank_of: Callable[[Floats], Ints]) -> Problem:
    """Return two stacked cubes; only contact holds the upper cube, and ζ is the pressure on top."""
    middles = {"lower": 0.5, "upper": 1.5}
    mesh = structured_mesh(
        comm,
        [
            Box(name, (0.0, 0.0, z - 0.5), (1.0, 1.0, z + 0.5), (n, n, n))
            for name, z in middles.items()
        ],
        [
            Surface("x0", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("y0", ("lower", "upper"), lambda x: x[1] == 0),
            Surface("bottom", ("lower",), lambda x: x[2] == 0),
            Surface("top", ("upper",), lambda x: x[2] == 2),
            Surface("lower_top", ("lower",), lambda x: x[2] == 1),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == 1),
        ],
        rank_of,
    )
    return Problem(
        mesh,
        dict.fromkeys(middles, STEEL),
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", 0.01)],
    )


@pytest.mark.mpi3
def test_ranks_without_cells() -> None:
    """The last rank has both bodies; there are more ranks than subdomains."""
    problem = two_cubes(COMM, 1, lambda x: np.full(len(x), COMM.size - 1, dtype=np.int32))
    topology = problem.V.mesh.topology
    owned = COMM.allgather(topology.index_map(topology.dim).size_local)
    assert owned == [0] * (COMM.size - 1) + [12]
    one, other = (
        Newton(problem, NewtonOptions(contact_solver=name, tolerance=1e-10)).solve(100.0)
        for name in ("snes-vi", "tfeti")
    )
    assert other.report.converged, other.report.reason
    assert other.state.alpha == pytest.approx(one.state.alpha, rel=1e-8)


def upper_apart(ranks: int, middles: Floats) -> Ints:
    """The lower cube is on the first rank, the upper cube on another rank."""
    return (middles[:, 2] > 1).astype(np.int32) % ranks


@pytest.mark.mpi3
def test_products_do_not_depend_on_ranks() -> None:
    """There are eight cubes, and each body is on one rank; rounding may change the count by one."""
    options = NewtonOptions(contact_solver="tfeti", subdomains=8)
    counts = []
    for comm in (MPI.COMM_SELF, COMM):
        problem = two_cubes(comm, 2, partial(upper_apart, comm.size))
        level = Newton(problem, options).solve(1.0)
        assert level.report.converged, level.report.reason
        counts.append(level.report.linear_iterations)
    assert abs(counts[1] - counts[0]) <= 1
