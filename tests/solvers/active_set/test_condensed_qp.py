"""Test the contact QP of a few pairs, condensed to a dense QP."""

import numpy as np
import pytest

from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram, condense
from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram, QuadraticModel
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from tests.models import two_blocks_problem


@pytest.mark.mpi3("None")
@pytest.mark.parametrize("work", [None, 0.02])
def test_it_finds_the_active_set_of_the_whole_program(work: float | None) -> None:
    """At first all pairs are undecided; then the pairs with known states are omitted."""
    problem = two_blocks_problem(2)
    iterate, linear = Iterate(problem), LinearSolver(problem)
    first = iterate.begin(None)
    program, contact = EqualityProgram(problem, linear), ContactProgram(problem, linear)
    operator = iterate.operator(1.0)
    contact.set_operator(operator)
    r, room = iterate.gradient(0.0 if work else 60.0), iterate.room()
    expected = contact.solve(r, room, first, 1e-10, work=work).active
    pairs, active = (problem.comm.allreduce(int(f.sum())) for f in (first, expected))
    assert 0 < active < pairs
    program.set_operator(operator)
    model = QuadraticModel(r.copy(), room, work, 1e-10)
    none = np.zeros_like(first)
    every = condense(program, model, held=none, undecided=~none)
    assert (every.closed == expected).all()
    assert every.solves == pairs + 1
    some = none.copy()
    some[::2] = True
    fewer = condense(program, model, held=expected & ~some, undecided=some)
    assert not fewer.closed[~some].any()
    assert fewer.solves == problem.comm.allreduce(int(some.sum())) + 1


def test_a_failure_on_the_way_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_blocks_problem(2)
    iterate, linear = Iterate(problem), LinearSolver(problem)
    first = iterate.begin(None)
    program = EqualityProgram(problem, linear)
    program.set_operator(iterate.operator(1.0))
    model = QuadraticModel(iterate.gradient(60.0), iterate.room(), None, 1e-10)

    def fail(*_: object, **__: object) -> None:
        raise LinearFailure("no solution")

    monkeypatch.setattr(linear, "solve", fail)
    with pytest.raises(LinearFailure, match="no solution"):
        condense(program, model, held=~first, undecided=first)
