"""The solvers of conic programs, which share one protocol, and the one that a run has chosen."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.conic.clarabel_solver import by_clarabel, check_clarabel
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    Monitor,
    Verdict,
    iterate,
)


class ConicSolver(Protocol):
    """A method that solves a conic program, in the place of :func:`interior_steps.iterate`."""

    def __call__(
        self,
        iteration: InteriorIteration,
        rtol: float,
        steps: list[InteriorStep],
        monitor: Monitor | None,
        share: float = 1.0,
        least: float = 0.0,
    ) -> tuple[Verdict, str]:
        """Bring the iterate and its velocity to the solution. Collective.

        Args:
            iteration: At its start, with the program.
            rtol: Largest difference of static and kinematic load, relative.
            steps: To which the steps are added.
            monitor: Called on every rank after each step.
            share: Share of the tolerance that the solution may leave.
            least: Load factor up to which a load is not taken for one without a bound.

        Returns:
            The outcome, and its reason.
        """
        ...


USUAL = "interior-point"
"""The name of the solver that is used unless another is chosen."""

SOLVERS: dict[str, ConicSolver] = {USUAL: iterate, "clarabel": by_clarabel}
"""Solvers by the name of ``conic`` in case files."""

CONIC = (
    "The solver of limit loads and bounds: the program's own interior point method, or Clarabel, a"
    " package that is installed by pip install clarabel and works on one rank. It goes with no"
    " other key, since these are about a path."
)
"""The key ``conic`` of ``[solve]``, for references."""

_CHOSEN: ContextVar[str] = ContextVar("conic solver", default=USUAL)


@contextmanager
def conic_solver(name: str) -> Iterator[None]:
    """Have all limit loads and bounds in a block found by a solver.

    Args:
        name: A key of :data:`SOLVERS`.

    Raises:
        InputError: If there is no such solver.
    """
    if name not in SOLVERS:
        raise InputError(f"conic = '{name}' of a limit load: {nearest(name, SOLVERS)}")
    before = _CHOSEN.set(name)
    try:
        yield
    finally:
        _CHOSEN.reset(before)


def check_solver(name: str, ranks: int) -> None:
    """Refuse a solver that cannot run here. Not collective.

    Args:
        name: A key of :data:`SOLVERS`.
        ranks: How many ranks there are.

    Raises:
        InputError: If it is not installed, or works on one rank only.
    """
    if name != USUAL:
        check_clarabel(ranks)


def chosen_conic() -> ConicSolver:
    """Return the solver that is chosen here, the interior point method by default."""
    return SOLVERS[_CHOSEN.get()]
