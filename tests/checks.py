"""Check results; several test modules share these functions."""

from collections.abc import Callable, Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import InputError, Level


def assert_solved(level: Level) -> None:
    """Check that the certificate of a level is good."""
    report = level.report
    assert report.converged, report.reason
    assert abs(report.duality_gap) < 1e-9
    assert report.equilibrium < 1e-8
    assert report.max_penetration < 1e-12
    assert report.smallest_contact_force > -1e-8


def largest(comm: MPI.Intracomm, values: npt.NDArray[np.float64]) -> float:
    """Return the largest magnitude over all ranks."""
    return float(comm.allreduce(float(np.abs(values).max(initial=0)), MPI.MAX))


def assert_refused(call: Callable[[], object], words: Sequence[str]) -> None:
    """Expect an error with the same sentence on all ranks; the sentence contains these words."""
    with pytest.raises(InputError) as refusal:
        call()
    sentence = str(refusal.value)
    for word in words:
        assert word in sentence
    assert "\n" not in sentence
    assert len(set(MPI.COMM_WORLD.allgather(sentence))) == 1
