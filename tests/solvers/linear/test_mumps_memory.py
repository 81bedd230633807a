"""Test that a factorisation that exceeds the memory is refused before it starts."""

import pytest

from perfplast_fenicsx import machine_memory
from perfplast_fenicsx.limit_analysis import interior_point, strict_lower_bound
from tests.checks import assert_refused
from tests.models import punch_problem


@pytest.mark.mpi2
def test_a_factorisation_that_does_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = punch_problem(4)
    monkeypatch.setattr(machine_memory, "physical_memory", lambda: 2**10)
    words = [f"{problem.num_dofs} unknowns", "coarser mesh"]
    assert_refused(lambda: interior_point(problem), words)
    assert_refused(lambda: strict_lower_bound(problem), ["GiB", "coarser mesh"])
    monkeypatch.setattr(machine_memory, "physical_memory", lambda: 2**40)
    assert interior_point(problem).levelled_off
