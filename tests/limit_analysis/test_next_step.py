"""Test the advice for a limit load with too wide bounds."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Problem, Traction, two_blocks
from perfplast_fenicsx.limit_analysis.body.body_bounds import NOT_SOUGHT, Effort, clock, next_steps
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import _largest, interior_point
from perfplast_fenicsx.limit_analysis.facets.bound_body import UNMATCHED
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED
from perfplast_fenicsx.limit_analysis.statements.load_factor import NO_MECHANISM, Bound, Scope
from tests.models import two_blocks_problem

COMM = MPI.COMM_WORLD


def steps(
    lower: Bound, upper: Bound, effort: Effort | None = None, locked: tuple[str, ...] = ()
) -> list[str]:
    body: Any = SimpleNamespace(
        lower=lower, upper=upper, mesh=SimpleNamespace(estimate=1.0, locked=locked)
    )
    return next_steps(body, effort or Effort(3, 1300, 10.0))


def lower(value: float) -> Bound:
    return Bound(value, "lower", Scope.BODY)


def upper(value: float) -> Bound:
    return Bound(value, "upper", Scope.BODY)


@pytest.mark.serial
def test_wide_bounds() -> None:
    (step,) = steps(lower(20.0), upper(27.4))
    assert step.startswith("the bounds are 37 % apart")
    assert "adapt = { until = 0.1, cells = 2600 } under [mesh]" in step
    assert "2 to 5 times as long as this (20 s to 50 s)" in step
    assert (
        "some 11000 cells) take about 15 to 50 times as long as this (2.5 min to 8.3 min)" in step
    )
    assert not steps(lower(20.0), upper(21.0))
    assert not steps(lower(0.0), upper(1.0))


@pytest.mark.serial
def test_wide_bounds_of_several_meshes_say_why_there_are_no_more() -> None:
    (step,) = steps(lower(20.0), upper(27.4), Effort(3, 9, 1.0, "the next one is too large"))
    assert "37 % apart, and the next one is too large; a first mesh with smaller" in step


@pytest.mark.serial
def test_surfaces_that_do_not_match() -> None:
    none, above = (
        Bound(value, kind, Scope.MESH, (UNMATCHED,))
        for value, kind in ((None, "lower"), (2.0, "upper"))
    )
    (flat,) = steps(none, above, Effort(2, 9, 1.0))
    (spatial,) = steps(none, above)
    assert flat.startswith("matching surfaces have bounds: mesh their bodies as one and split")
    assert "end at the same places without a gap" in flat
    assert "end at the same places" not in spatial


@pytest.mark.serial
def test_bounds_that_were_not_sought() -> None:
    (step,) = steps(NOT_SOUGHT, upper(2.0), Effort(2, 100, 60.0))
    assert 'control = "bounds"' in step
    assert "2 to 5 times as long as this (2 min to 5 min)" in step
    assert not steps(NOT_SOUGHT, Bound(None, "upper", Scope.MESH, ("cells are curved",)))


@pytest.mark.serial
def test_bodies_that_lock_and_curved_contact() -> None:
    none = Bound(None, "upper", Scope.MESH, (NO_MECHANISM,))
    (step,) = steps(lower(2.0), none, locked=("lid", "pin"))
    reason = "no mechanism of this mesh preserves the volume of every cell"
    assert step.startswith(f"{reason}: 'lid' and 'pin' lock.")
    (step,) = steps(lower(2.0), Bound(2.5, "upper", Scope.MESH, (CURVED,)))
    assert step.startswith("rely on the lower bound")


@pytest.mark.serial
@pytest.mark.parametrize(
    ("seconds", "words"), [(0.1, "1 s"), (42.4, "42 s"), (125.0, "2.1 min"), (7200.0, "2 h")]
)
def test_times(seconds: float, words: str) -> None:
    assert clock(seconds) == words


@pytest.mark.serial
def test_the_fewest_bodies_that_have_most() -> None:
    assert _largest(["a", "b", "c"], [0.2, 0.75, 0.05]) == ("b", "a")
    assert _largest(["a", "b"], [0.0, 0.0]) == ()


@pytest.mark.mpi2
def test_the_body_that_flows_is_the_one_that_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The upper block is pulled off the lower block; the projection hardly changes its velocity."""
    module = "perfplast_fenicsx.limit_analysis.discrete.discrete_bounds"
    monkeypatch.setattr(f"{module}.MOST_ITERATIONS", 1)
    up = [Traction("top", (0.0, 0.0, 1.0))]
    given = replace(two_blocks_problem(2).given, loads=up, degree=2)
    found = interior_point(Problem.from_given(two_blocks(COMM, 2), given), 1e-2)
    assert found.upper is None
    assert found.locked == ("upper",)
