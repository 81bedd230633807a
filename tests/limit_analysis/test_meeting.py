"""Test ranks that work independently: they exchange their steps, and end together."""

from dataclasses import replace

from mpi4py import MPI

import pytest

from perfplast_fenicsx import InputError
from perfplast_fenicsx.limit_analysis.body.halves import Meeting
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, StopSearch
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge

COMM = MPI.COMM_WORLD
STEP = InteriorStep(0, 1.0, 0.1, 0.0, 0.0, 1.0, 0.0)

pytestmark = pytest.mark.mpi3


class Enough(StopSearch):
    """The monitor stops the search."""


def work(meeting: Meeting) -> None:
    """Each rank takes two steps more than the previous rank."""
    for number in range(3 + 2 * COMM.rank):
        if meeting.monitor is not None:
            meeting.monitor(replace(STEP, number=number + 1, load=float(COMM.rank)))


def test_every_rank_is_told_every_step() -> None:
    told = list[InteriorStep]()
    meeting = Meeting(COMM, told.append)
    assert meeting.after(lambda: work(meeting))
    assert len(told) == sum(3 + 2 * rank for rank in range(COMM.size))
    assert [it.number for it in told] == sorted(it.number for it in told)
    assert COMM.allgather(told) == [told] * COMM.size


def test_nobody_meets_where_nobody_is_told() -> None:
    meeting = Meeting(COMM, None)
    assert meeting.monitor is None
    assert meeting.after(lambda: work(meeting))


def test_who_waits_is_stopped_too() -> None:
    """Only the last rank is still working when it is stopped."""

    def stop(step: InteriorStep) -> None:
        if step.number == 3 + 2 * (COMM.size - 1):
            raise Enough

    meeting = Meeting(COMM, stop)
    with pytest.raises(Enough):
        meeting.after(lambda: work(meeting))


def test_what_one_rank_refuses_all_do() -> None:
    meeting = Meeting(COMM, lambda _: None)

    def refuse() -> None:
        work(meeting)
        if COMM.rank == COMM.size - 1:
            raise InputError("a rank refuses")

    with pytest.raises(InputError, match="a rank refuses"):
        meeting.after(refuse)


def test_what_does_not_fit_on_one_rank_is_done_by_none() -> None:
    meeting = Meeting(COMM, lambda _: None)

    def refuse() -> None:
        if COMM.rank == 0:
            raise TooLarge("too large")
        work(meeting)

    assert not meeting.after(refuse)
