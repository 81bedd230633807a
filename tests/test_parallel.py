"""Test array rows that travel between ranks, and the release of communicators."""

import gc

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Pressure, Problem, Support, VonMises, stacked_blocks
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.parallel import drop_garbage, fetch_rows, lasting, send_rows


@pytest.mark.mpi3
def test_rows_arrive_where_they_are_sent(comm: MPI.Intracomm) -> None:
    rows = np.column_stack([np.full(comm.size, comm.rank), np.arange(comm.size)])
    arrived = send_rows(comm, rows, np.arange(comm.size))
    assert (arrived == [[rank, comm.rank] for rank in range(comm.size)]).all()


@pytest.mark.mpi3
def test_rows_with_names_arrive_whole_and_in_order(comm: MPI.Intracomm) -> None:
    """All rows go to the last rank; the other ranks get empty arrays of the same type."""
    rows = np.zeros(5, dtype=[("number", np.int32), ("x", np.float64, 2), ("flag", np.bool_)])
    rows["number"] = 10 * comm.rank + np.arange(5)
    rows["x"] = rows["number"][:, None] / 4 + (0, 1)
    rows["flag"] = rows["number"] % 2
    arrived = send_rows(comm, rows, np.full(5, comm.size - 1))
    last = comm.rank == comm.size - 1
    numbers = [10 * rank + i for rank in range(comm.size) for i in range(5)] if last else []
    assert arrived.dtype == rows.dtype
    assert arrived["number"].tolist() == numbers
    assert (arrived["x"] * 4 == arrived["number"][:, None] + np.array([0, 4])).all()
    assert (arrived["flag"] == arrived["number"] % 2).all()


@pytest.mark.mpi3
def test_rows_are_fetched_by_number(comm: MPI.Intracomm) -> None:
    """Rank r has r + 1 rows, and the first rank none."""
    count = comm.rank + 1 if comm.rank else 0
    first = sum(rank + 1 for rank in range(1, comm.rank))
    rows = np.column_stack([first + np.arange(count), np.full(count, comm.rank)])
    total = comm.allreduce(count)
    numbers = np.random.default_rng(comm.rank).permutation(total)[: total // 2 + 1]
    fetched = fetch_rows(comm, rows, numbers)
    owners = np.repeat(np.arange(comm.size), [rank + 1 if rank else 0 for rank in range(comm.size)])
    assert (fetched == np.column_stack([numbers, owners[numbers]])).all()


@pytest.mark.mpi2
def test_problems_that_are_dropped_leave_no_communicator(comm: MPI.Intracomm) -> None:
    """MPICH has 2048 communicators: a sweep over meshes failed when PETSc kept some of each.

    MPI copies an attribute when a communicator is duplicated, and deletes it when the communicator
    is freed.
    """
    living = 0

    def copied(*_: object) -> bool:
        nonlocal living
        living += 1
        return True

    def deleted(*_: object) -> None:
        nonlocal living
        living -= 1

    def solve() -> None:
        supports = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
        materials = dict.fromkeys(("lower", "upper"), VonMises(2e5, 0.3, 300.0))
        loads, contacts = [Pressure("top", 1.0)], [Contact("lower_top", "upper_bottom")]
        given = (materials, supports, loads, contacts)
        problem = Problem(stacked_blocks(comm, 1), *given, degree=2)
        interior_point(problem, 1e-2)
        OutputFields(problem)

    key = MPI.Comm.Create_keyval(copied, deleted)
    MPI.COMM_WORLD.Set_attr(key, True)
    try:
        left = []
        for _ in range(3):
            solve()
            gc.collect()
            comm.barrier()
            drop_garbage(comm)
            left.append(living)
    finally:
        MPI.COMM_WORLD.Delete_attr(key)
    assert left[1:] == left[:1] * 2


@pytest.mark.mpi2
def test_a_communicator_lasts_for_each_group_of_ranks(comm: MPI.Intracomm) -> None:
    twin, reversed_ = comm.Dup(), comm.Split(0, -comm.rank)
    try:
        assert lasting(twin) == MPI.COMM_WORLD
        assert lasting(MPI.COMM_SELF).size == 1
        assert lasting(reversed_).rank == reversed_.rank
        assert lasting(reversed_) == lasting(reversed_)
    finally:
        twin.Free()
        reversed_.Free()
