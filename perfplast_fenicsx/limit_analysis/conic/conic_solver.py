"""Define the protocol for conic solvers, and store the solver that a run uses."""

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
    """A function that solves a conic program, such as :func:`interior_steps.iterate`."""

    def __call__(
        self,
        iteration: InteriorIteration,
        rtol: float,
        steps: list[InteriorStep],
        monitor: Monitor | None,
        share: float = 1.0,
        least: float = 0.0,
    ) -> tuple[Verdict, str]:
        """Solve the program, and store the solution in the iterate and the velocity. Collective.

        Args:
            iteration: The iteration at its start, with the program.
            rtol: Largest relative difference between the static and the kinematic load.
            steps: List to which the steps are appended.
            monitor: Called on every rank after each step.
            share: Fraction of ``rtol`` to which the solution is computed.
            least: Load factor up to which the solver does not report that the load is unbounded.

        Returns:
            The outcome, and the reason for it.
        """
        ...


USUAL = "interior-point"
"""Name of the default solver."""

SOLVERS: dict[str, ConicSolver] = {USUAL: iterate, "clarabel": by_clarabel}
"""Solvers by the value of the key ``conic`` in case files."""

CONIC = (
    "The solver for limit loads and bounds: the program's own interior point method, or Clarabel, a"
    " package that is installed by pip install clarabel and works on one rank. Give no other"
    " key with conic, because the other keys belong to a loading path."
)
"""Description of the key ``conic`` of ``[solve]``, for the reference pages."""

_CHOSEN: ContextVar[str] = ContextVar("conic solver", default=USUAL)


@contextmanager
def conic_solver(name: str) -> Iterator[None]:
    """Use a solver for all limit loads and bounds within a ``with`` block.

    Args:
        name: A key of :data:`SOLVERS`.

    Raises:
        InputError: If there is no such solver.
    """
    if name not in SOLVERS:
        raise InputError(f"conic = '{name}' is unknown; {nearest(name, SOLVERS)}")
    before = _CHOSEN.set(name)
    try:
        yield
    finally:
        _CHOSEN.reset(before)


def check_solver(name: str, ranks: int) -> None:
    """Check that a solver can run on a number of ranks. Not collective.

    Args:
        name: A key of :data:`SOLVERS`.
        ranks: Number of ranks.

    Raises:
        InputError: If the solver is not installed, or if there are several ranks and the solver
            works on one rank only.
    """
    if name != USUAL:
        check_clarabel(ranks)


def chosen_conic() -> ConicSolver:
    """Return the solver that :func:`conic_solver` has set, by default the interior point method."""
    return SOLVERS[_CHOSEN.get()]
