"""Test rigid motions of bodies: how contact restricts them, and which motions are refused."""

from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import TaggedMesh
from perfplast_fenicsx.contact.rows.rigid_motions import RigidMotions, rigid_jumps
from tests.checks import assert_refused
from tests.models import stack_problem, touching_blocks, wedge_problem


@pytest.mark.mpi3
def test_jumps_of_one_body_that_moves(wedge: TaggedMesh) -> None:
    """Each column equals the product of B with the vector of this motion."""
    problem = wedge_problem(wedge)
    V, bodies = problem.V, problem.bodies
    jumps = rigid_jumps(V, bodies, problem.constraints.B)
    assert jumps.shape == (len(problem.constraints.host), 2 * 6)
    owned = V.dofmap.index_map.size_local
    modes = bodies.rigid_modes(V.tabulate_dof_coordinates()[:owned])
    u = problem.create_vector()
    for body in range(2):
        for motion in range(6):
            moved = (bodies.of_node[:owned] == body)[:, None] * modes[:, :, motion]
            u.array[:] = moved.ravel()
            expected = problem.constraints.jumps(u)
            assert jumps[:, 6 * body + motion] == pytest.approx(expected, abs=1e-13)
    # both bodies move together: nothing opens
    together = jumps[:, :6] + jumps[:, 6:]
    assert np.abs(together).max(initial=0) < 1e-13


@pytest.mark.mpi2
def test_a_body_that_a_load_can_move_is_refused() -> None:
    words = ["the body 'upper'", "translation in z", "a load does work", "add a support"]
    assert_refused(lambda: touching_blocks(contacts=[]), words)


def test_an_open_contact_is_closed_at_first_where_it_alone_holds_a_body(
    comm: MPI.Intracomm,
) -> None:
    problem = stack_problem(2, gap=0.1, comm=comm)
    assert problem.has_gaps
    assert problem.first_active.all()


def test_pairs_that_touch_are_closed_at_first(comm: MPI.Intracomm) -> None:
    problem = stack_problem(2, gap="0.1*x**2", comm=comm)
    touching = problem.constraints.gap < 1e-15
    assert 0 < comm.allreduce(int(touching.sum())) < problem.num_pairs
    assert (problem.first_active == touching).all()


def test_without_rows_the_upper_block_flies(comm: MPI.Intracomm) -> None:
    problem = stack_problem(1, comm=comm)
    V, rows = problem.V, problem.constraints
    none = replace(rows, B=rows.B.duplicate())
    none.B.assemble()
    for constraints, count in ((rows, 0), (none, 1)):
        motions = RigidMotions(V, problem.bodies, problem.fixed, constraints)
        assert motions.free().shape == (12, count)
    along = np.abs(motions.free()[:, 0])
    assert along.max() == pytest.approx(1.0)
    assert int(np.argmax(along)) % 6 == 2  # translation in z
