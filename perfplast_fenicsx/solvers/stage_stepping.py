"""Solve the levels of stages, in which bodies are loaded, unloaded and loaded again."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.history.loading_history import ROUNDING, LoadingHistory
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton_options import Monitor
from perfplast_fenicsx.solvers.tightening import tighten_anew


def stage_path(
    solver: LevelSolver,
    history: LoadingHistory,
    monitor: Monitor | None = None,
    start: State | None = None,
) -> Iterator[Level]:
    """Solve the levels of all stages in order; each level starts from the previous one. Collective.

    If the bodies are loaded before the first stage, the first level is ζ = 0.

    Args:
        solver: Solver of the history's problem; it must prescribe load factors.
        history: The stages.
        monitor: Function that is called on every rank after each iteration.
        start: State in these stages from which to continue; None for the virgin bodies.

    Yields:
        The levels. If a level does not converge, it is the last; the level before it has the last
        valid state.

    Raises:
        InputError: If the solver prescribes works, or if a stage before the start has tightened
            bolts again.
    """
    if solver.prescribes is not Prescribed.LOAD_FACTOR:
        raise InputError(
            f"stages prescribe load factors, but the method '{solver.method}' prescribes the work; "
            "give method = 'newton'."
        )
    if start is not None:
        history.check_start(start.zeta)
    rest = [0.0] if start is None and history.rests_first() else []
    for time in chain(rest, history.times()):
        if start is not None and time <= start.zeta + ROUNDING:
            continue
        level = _told(history, _solved(solver, history, time, start, monitor))
        yield level
        if not level.report.converged:
            return
        start = level.state


def _solved(
    solver: LevelSolver,
    history: LoadingHistory,
    time: float,
    start: State | None,
    monitor: Monitor | None,
) -> Level:
    """Return the level at a time, with the bolt forces that its stage requires. Collective."""

    def solve() -> Level:
        history.go_to(time)
        return solver.solve(time, start, monitor)

    wanted = history.tightened(time)
    return tighten_anew(solver.problem.shanks, wanted, solve) if wanted else solve()


def _told(history: LoadingHistory, level: Level) -> Level:
    """Return the level with the stage, factors and works of the history in its report.

    Collective.
    """
    report, stage = level.report, history.label(level.state.zeta)
    factors, reason = history.factors(level.state.zeta), report.reason
    if not report.converged and stage:
        reached = ", ".join(f"{name} = {factor:.6g}" for name, factor in factors.items())
        reason = f"in '{stage}', at {reached}: {reason}"
    works = history.works(level.state.u.x.petsc_vec)
    told = replace(report, reason=reason, stage=stage, factors=factors, works=works)
    return replace(level, report=told)
