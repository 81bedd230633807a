"""Record phases of a run as events in PETSc's log, for ``-log_view`` and the benchmarks."""

from collections.abc import Callable
from typing import Any, TypeVar

from petsc4py import PETSc

Function = TypeVar("Function", bound=Callable[..., Any])

PHASES = (
    *("contact set-up", "return map", "assembly", "basis change"),
    *("linear set-up", "linear solve", "line search"),
)
"""Names of the phases, which do not overlap."""


def phase(name: str) -> Callable[[Function], Function]:
    """Return a decorator that counts the time of a function as one of :data:`PHASES`."""
    assert name in PHASES
    return PETSc.Log.EventDecorator(f"perfplast {name}")


def seconds() -> dict[str, float]:
    """Return the time in each phase on this rank (s) since PETSc's logging was started."""
    return {name: PETSc.Log.Event(f"perfplast {name}").getPerfInfo()["time"] for name in PHASES}
