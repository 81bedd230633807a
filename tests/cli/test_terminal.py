"""What is told of bounds on the terminal: what narrows them, where they are wide."""

import io
from types import SimpleNamespace

from mpi4py import MPI

import pytest

from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.limit_analysis.bound import Bound, Scope

pytestmark = pytest.mark.serial


def told(lower: float | None, upper: float | None, adapted: bool = False) -> str:
    """What is said of bounds that hold for the body."""
    ends = Bound(lower, "lower", Scope.BODY), Bound(upper, "upper", Scope.BODY)
    bounds = SimpleNamespace(
        lower=ends[0],
        upper=ends[1],
        strict=ends[0].strict and ends[1].strict,
        in_words=lambda: "Bounds.",
    )
    stream = io.StringIO()
    Terminal(MPI.COMM_SELF, stream, live=False).body(bounds, adapted)  # type: ignore[arg-type]
    return stream.getvalue()


def test_wide_bounds_have_a_next_step() -> None:
    first, second = told(20.0, 27.4).splitlines()
    assert first == "Bounds."
    assert second.startswith("They are 37 % apart: a finer mesh brings them nearer, or adapt = {")


@pytest.mark.parametrize(
    ("lower", "upper", "adapted"),
    [(20.0, 21.0, False), (20.0, 27.4, True), (None, 27.4, False), (0.0, 1.0, False)],
)
def test_others_have_none(lower: float | None, upper: float | None, adapted: bool) -> None:
    assert told(lower, upper, adapted) == "Bounds.\n"
