"""Loading: a sequence of load levels, each started from the one before."""

from collections.abc import Iterator, Sequence

from perfplast_fenicsx.newton import Monitor, Newton
from perfplast_fenicsx.state import Level, State


def load_path(
    solver: Newton,
    values: Sequence[float],
    monitor: Monitor | None = None,
    start: State | None = None,
) -> Iterator[Level]:
    """Solve (P)_ζ for each ζ in turn.

    Args:
        solver: ALG1 of a problem.
        values: Load parameters ζ, rising.
        monitor: Called on every rank after each iteration.
        start: State to begin with; None for the unloaded one.

    Yields:
        The levels. One that has not converged is the last: the state of the level before is the
        last valid one.
    """
    for zeta in values:
        level = solver.solve(zeta, start, monitor)
        yield level
        if not level.report.converged:
            return
        start = level.state
