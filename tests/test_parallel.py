"""Rows of arrays that travel between ranks."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.parallel import fetch_rows, send_rows


@pytest.mark.mpi3
def test_rows_arrive_where_they_are_sent(comm: MPI.Intracomm) -> None:
    rows = np.column_stack([np.full(comm.size, comm.rank), np.arange(comm.size)])
    arrived = send_rows(comm, rows, np.arange(comm.size))
    assert (arrived == [[rank, comm.rank] for rank in range(comm.size)]).all()


@pytest.mark.mpi3
def test_rows_with_names_arrive_whole_and_in_order(comm: MPI.Intracomm) -> None:
    """All go to the last rank; the others get rows of the same type, none."""
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
