"""Solve limit loads with Clarabel, an interior point solver independent of the program's own.

P. J. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic
objectives (2024), arXiv:2405.12762. The module passes the matrices of
:class:`~cone_program.ConeProgram` to Clarabel.
"""

import time
from importlib import import_module
from typing import Any

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.cone import ConeKind
from perfplast_fenicsx.limit_analysis.conic.cone_program import ConeProgram
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    CARRIES_NONE,
    InteriorStep,
    Monitor,
    Verdict,
    carries_none,
)

TRIANGLE: Longs = np.array([0, 5, 1, 4, 3, 2])
"""Indices of the upper triangle's entries in a Mandel vector, column by column."""


def by_clarabel(
    iteration: InteriorIteration,
    rtol: float,
    steps: list[InteriorStep],
    monitor: Monitor | None,
    share: float = 1.0,
    least: float = 0.0,
) -> tuple[Verdict, str]:
    """Solve the program of an iteration with Clarabel, and store the solution in the iteration.

    For the arguments, see :class:`conic_solver.ConicSolver`. The steps are Clarabel's iterations.
    The function does not use ``least``, because Clarabel itself detects unbounded loads.

    Raises:
        InputError: If there are several ranks, if Clarabel is not installed, or if a block's cones
            cannot be written as rows of a matrix.
    """
    program, began = iteration.program, time.perf_counter()
    clarabel = check_clarabel(program.comm.size)
    data = ConeProgram.of(program)
    stop: list[BaseException] = []

    def report(info: Any) -> bool:
        if info.iterations == 0:
            return False
        step = InteriorStep(
            number=len(steps) + 1,
            load=-info.cost_primal * program.load_unit,
            gap=abs(info.gap_rel),
            unbalanced=info.res_primal,
            inadmissible=info.res_dual,
            length=info.step_length,
            seconds=time.perf_counter() - began,
        )
        steps.append(step)
        try:
            if monitor is not None:
                monitor(step)
        except BaseException as raised:
            stop.append(raised)
        return bool(stop)

    rows = [data.members(number) for number in range(len(data.cones))]
    orders = [_order(it.kind, it.right.shape) for it in data.cones]
    matrix = sparse.vstack(
        [data.A, *(-part[at] for (part, _), at in zip(rows, orders, strict=True))]
    )
    right = np.concatenate([data.b, *(r[at] for (_, r), at in zip(rows, orders, strict=True))])
    cones = [clarabel.ZeroConeT(len(data.b))]
    for it in data.cones:
        cones += _cones(clarabel, it.kind, it.right.shape)
    nothing = sparse.csc_matrix((len(data.c), len(data.c)))
    settings = _settings(clarabel, share * rtol)
    solver = clarabel.DefaultSolver(
        nothing, -data.c, sparse.csc_matrix(matrix), right, cones, settings
    )
    solver.set_termination_callback(report)
    solution = solver.solve()
    if stop:
        raise stop[0]
    return _put(iteration, data, orders, solution, rtol)


def check_clarabel(ranks: int) -> Any:
    """Return the module ``clarabel`` after checking that it can run on these ranks. Not collective.

    Args:
        ranks: Number of ranks.

    Raises:
        InputError: If there are several ranks, or if Clarabel is not installed.
    """
    if ranks > 1:
        raise InputError(
            f"conic = 'clarabel' works on one rank only, but the run has {ranks} ranks; start the"
            " run without mpirun, or remove conic."
        )
    try:
        return import_module("clarabel")
    except ImportError as missing:
        raise InputError(
            "conic = 'clarabel' needs the package clarabel, which is not installed; "
            "install it (pip install clarabel), or remove conic."
        ) from missing


def _settings(clarabel: Any, rtol: float) -> Any:
    """Return Clarabel's settings for a relative tolerance of the load."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_rel = settings.tol_gap_abs = rtol
    settings.tol_feas = min(1e-8, rtol)
    # With the default values 2e-7, 1e-8 and 10, the solution of some 3D bounds ends with numerical
    # errors.
    settings.dynamic_regularization_delta = 1e-5
    settings.static_regularization_constant = 1e-7
    settings.iterative_refinement_max_iter = 30
    return settings


def _order(kind: ConeKind, shape: tuple[int, ...]) -> Longs:
    """Return the indices that put the rows of a block into Clarabel's order."""
    rows = np.arange(shape[0] * shape[1]).reshape(shape)
    return (rows[:, TRIANGLE] if kind is ConeKind.SEMIDEFINITE else rows).ravel()


def _cones(clarabel: Any, kind: ConeKind, shape: tuple[int, ...]) -> list[Any]:
    """Return Clarabel's objects for the cones of a block."""
    num, size = shape
    match kind:
        case ConeKind.NONNEGATIVE:
            return [clarabel.NonnegativeConeT(num * size)]
        case ConeKind.SECOND_ORDER:
            return [clarabel.SecondOrderConeT(size)] * num
        case ConeKind.SEMIDEFINITE:
            return [clarabel.PSDTriangleConeT(3)] * num


def _put(
    iteration: InteriorIteration, data: ConeProgram, orders: list[Longs], solution: Any, rtol: float
) -> tuple[Verdict, str]:
    """Store a solution in the iteration if there is one; return the verdict and its reason."""
    status, program = str(solution.status), iteration.program
    if status in ("DualInfeasible", "AlmostDualInfeasible"):
        reason = "Clarabel has found admissible stresses that balance any multiple of the loads"
        return Verdict.UNBOUNDED, reason
    if status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
        return Verdict.STALLED, "Clarabel has found that no admissible stress is in equilibrium"
    static: list[Floats] = []
    kinematic: list[Floats] = []
    s, z, first = np.array(solution.s), np.array(solution.z), len(data.b)
    for order in orders:
        here = slice(first, first + len(order))
        first += len(order)
        for found, values in ((static, s[here]), (kinematic, z[here])):
            rows: Floats = np.empty(len(order))
            rows[order] = values
            found.append(rows)
    now = data.unknowns(np.array(solution.x), static, kinematic)
    iteration.put(now, -z[: len(data.b)])
    if status != "Solved":
        return Verdict.STALLED, f"Clarabel ended with the status {status}"
    _, rate = program.rates(iteration.velocity)
    if carries_none(program, iteration.size() + iteration.gap(), rate):
        return Verdict.NO_RESISTANCE, CARRIES_NONE
    return Verdict.FOUND, f"Clarabel has converged to {rtol:g}"
