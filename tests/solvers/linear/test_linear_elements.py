"""Test linear elements in quadratic ones: linear motions are preserved, iterations are few."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Problem, Support, Traction, two_blocks
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import LinearElements
from tests.models import STEEL
from tests.solvers.linear.systems import elastic_operator, loads, quadratic_problem


@pytest.mark.mpi3
def test_linear_motions_pass_both_ways_but_for_supports() -> None:
    problem = quadratic_problem()
    linear = LinearElements(problem)
    slopes = np.arange(9.0).reshape(3, 3) + 1
    coarse, fine = linear.interpolation.createVecs()
    coarse.array[:] = (linear.nodes @ slopes).ravel()
    linear.interpolation.mult(coarse, fine)
    owned = problem.V.dofmap.index_map.size_local
    x, fixed = problem.V.tabulate_dof_coordinates()[:owned], problem.fixed[:owned]
    away = x[:, 0] > 0.6  # cells of edge 1/2 without a support
    assert problem.comm.allreduce(int(away.sum())) > 0
    np.testing.assert_allclose(fine.array.reshape(-1, 3)[away], (x @ slopes)[away], rtol=1e-12)
    assert not fine.array[fixed.ravel()].any()
    fine.array[:] = (x @ slopes).ravel()
    np.testing.assert_allclose(linear.at_vertices(fine), linear.nodes @ slopes, rtol=1e-12)
    linear.destroy()


def test_iterations_do_not_grow_as_quadratic_meshes_are_refined(multigrid: None) -> None:
    """All contact is closed, bodies are elastic, and the relative residual is 1e-8."""
    counts = []
    for n in (2, 4, 6):
        problem = _two_blocks(n)
        operator = elastic_operator(problem)
        solver = LinearSolver(problem)
        solver.set_operator(operator)
        assert solver.name == "CG + smoothed aggregation"
        solver.hold(problem.basis.index)
        solver.solve(loads(problem), problem.create_vector(), 1e-8)
        counts.append(solver.iterations)
    assert max(counts) <= 16


def _two_blocks(n: int) -> Problem:
    return Problem(
        two_blocks(MPI.COMM_WORLD, n),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
        degree=2,
    )
