"""Test bounds for tied bodies: with matching facets they equal those for one body."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Pressure, Problem, ResultFolder, Support, Tie, VonMises
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body.bound_problems import with_glued_ties
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.contact.blocks_apart import blocks_apart
from tests.models import touching_blocks

STRONG, WEAK = VonMises(2e5, 0.3, 450.0), VonMises(2e5, 0.3, 200.0)
TIE = [Tie("lower_top", "upper_bottom")]


def tied(sign: float) -> Problem:
    return touching_blocks(
        materials={"lower": WEAK, "upper": WEAK},
        loads=[Pressure("top", sign)],
        contacts=TIE,
        degree=2,
    )


@pytest.mark.long(but=["1.0"])
@pytest.mark.mpi2("1.0")
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tie_carries_pressure_and_pull_alike(shared_tmp_path: Path, sign: float) -> None:
    """Cubes on rollers yield at once, at their yield stress."""
    problem = tied(sign)
    bounds = limit_bounds(problem, 1e-4)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(WEAK.yield_stress, rel=2e-4)
    assert bounds.upper.value == pytest.approx(WEAK.yield_stress, rel=1e-9)
    assert bounds.lower.value <= WEAK.yield_stress
    there = ResultFolder(MPI.COMM_WORLD, shared_tmp_path)
    write_proof(there, there.file("bounds.h5"), *proofs(bounds, bounds))
    for of in check(there.file("bounds.h5")).values():
        assert not of.faults


def test_the_glued_mesh_is_of_the_same_cells() -> None:
    problem = tied(1.0)
    glued = with_glued_ties(problem)
    for dim in (0, 3):
        before, after = (it.tagged_mesh.mesh.topology for it in (problem, glued))
        less = 9 if dim == 0 else 0  # vertices of a tie of 2 by 2 squares
        assert after.index_map(dim).size_global == before.index_map(dim).size_global - less
    assert not glued.given.ties
    assert with_glued_ties(glued) is glued
    comm = MPI.COMM_WORLD
    for name in problem.tagged_mesh.surfaces:
        counts = [
            comm.allreduce(int((it.tagged_mesh.facets(name) < _owned(it)).sum()))
            for it in (problem, glued)
        ]
        assert counts[1] == (0 if name in ("lower_top", "upper_bottom") else counts[0])
    for name in problem.tagged_mesh.volumes:
        counts = [comm.allreduce(len(it.tagged_mesh.cells(name))) for it in (problem, glued)]
        assert counts[0] == counts[1]


def _owned(problem: Problem) -> int:
    topology = problem.tagged_mesh.mesh.topology
    owned: int = topology.index_map(topology.dim - 1).size_local
    return owned


@pytest.mark.parametrize("gdim", [2, 3])
def test_facets_that_do_not_match_are_left(gdim: int) -> None:
    mesh = blocks_apart(MPI.COMM_WORLD, [2] * gdim, [3] * gdim)
    ties = [Tie("lower_top", "upper_bottom")]
    materials = {"lower": WEAK, "upper": STRONG}
    problem = Problem(
        mesh, materials, [Support("bottom")], [Pressure("top", 1.0)], contacts=ties, degree=2
    )
    assert with_glued_ties(problem) is problem
