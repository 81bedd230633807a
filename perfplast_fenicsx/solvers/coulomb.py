"""Solve Coulomb's friction as a fixed point of Tresca's: c ← c₀ + μ λ, with contact forces λ.

Each iteration is a convex problem whose friction bounds c come from the previous iteration, and the
certificate of the level is the certificate of this problem. The fixed point is not a minimiser: it
may not exist or may not be unique, and it has neither a duality gap nor limit theorems. A level is
one step of the path: at its end, slip and friction force are opposite, whatever happened during the
step.
"""

from collections.abc import Callable
from dataclasses import replace

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.problem.judged.certificate import friction_forces
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem

Solve = Callable[[State | None], Level]
"""Function that solves a level with Tresca's friction from a state."""

Largest = Callable[[], float]
"""Function that returns the largest nodal force of the stress after the last level; collective."""


def solve_coulomb(
    problem: Problem, solve: Solve, largest_force: Largest, start: State | None, pushes: Floats
) -> Level:
    """Solve a level with Coulomb's friction. Collective.

    Args:
        problem: Problem whose friction bounds are updated.
        solve: Function that solves the level with the current friction bounds.
        largest_force: Function that returns the force to which rounding errors of contact forces
            are compared.
        start: Initial state; None for the unloaded bodies.
        pushes: Contact forces in the initial state, shape (num_pairs,). If the friction bounds from
            these forces are all zero, or if the first level with these bounds fails, the iteration
            begins with a level without slip.
    """
    first = _bounds(problem, pushes)
    if start is not None and problem.comm.allreduce(float(first.sum())) > 0:
        level = _rounds(problem, solve, largest_force, start, first, 0.0)
        if level.report.converged or level.report.rounds > 1:
            return level
    largest = float(first.max(initial=0))
    return _rounds(problem, solve, largest_force, start, np.full_like(first, np.inf), largest)


def _rounds(
    problem: Problem,
    solve: Solve,
    largest_force: Largest,
    start: State | None,
    bounds: Floats,
    most: float,
) -> Level:
    """Repeat the level, from the initial bounds until the bounds converge. Collective.

    Args:
        problem: Problem whose friction bounds are updated.
        solve: See :func:`solve_coulomb`.
        largest_force: See :func:`solve_coulomb`.
        start: Initial state; None for the unloaded bodies.
        bounds: Initial friction bounds.
        most: Largest friction bound on this rank before the iteration.
    """
    friction, comm = problem.friction, problem.comm
    follows = friction.coulomb > 0
    friction.bound[follows] = bounds
    most = comm.allreduce(float(bounds[np.isfinite(bounds)].max(initial=most)), MPI.MAX)
    rounds: list[Level] = []
    most_rounds = 100
    reason = f"the bounds of Coulomb's friction have not converged in {most_rounds} iterations"
    # Relative change of the bounds at which the iteration ends.
    settled = 1e-8
    # Contact and friction forces below this fraction of the largest nodal force, or of the largest
    # contact force in a level, are rounding errors of unloaded surfaces.
    rounding = 1e-10
    for _ in range(most_rounds):
        level = solve(start)
        rounds.append(level)
        if not level.report.converged:
            bounds_of = "previous contact forces" if len(rounds) > 1 else "initial bounds"
            reason = (
                f"iteration {len(rounds)} of Coulomb's friction, with the {bounds_of}: "
                f"{level.report.reason}"
            )
            return _together(rounds, False, reason)
        start = level.state
        forces = level.contact_forces
        bounds = _bounds(problem, np.where(forces > rounding * largest_force(), forces, 0.0))
        largest_bound = comm.allreduce(float(bounds.max(initial=0)), MPI.MAX)
        most = max(most, largest_bound)
        if largest_bound <= rounding * most:
            bounds[:] = 0.0
            rubs = norms(friction_forces(problem, level.stress, level.state.zeta)[follows])
            if comm.allreduce(float(rubs.max(initial=0)), MPI.MAX) <= rounding * most:
                return _together(rounds, True, level.report.reason)
        change = np.abs(bounds - friction.bound[follows]).max(initial=0)
        if comm.allreduce(float(change), MPI.MAX) <= settled * largest_bound:
            return _together(rounds, True, level.report.reason)
        friction.bound[follows] = bounds
    return _together(rounds, False, reason)


def _bounds(problem: Problem, forces: Floats) -> Floats:
    """Return c₀ + μ λ at the points with Coulomb's friction, with the adhesion c₀."""
    friction = problem.friction
    follows = friction.coulomb > 0
    bounds: Floats = friction.coulomb[follows] * np.maximum(forces[friction.pair[follows]], 0.0)
    bounds += friction.adhesion[follows]
    return bounds


def _together(rounds: list[Level], converged: bool, reason: str) -> Level:
    """Return the last level, with counts summed over all iterations."""
    last, reports = rounds[-1], [level.report for level in rounds]
    sums = {
        name: sum(getattr(report, name) for report in reports)
        for name in (
            *("newton_iterations", "active_set_iterations", "linear_iterations"),
            *("linear_solves", "setups", "seconds"),
            *("contact_programs", "snes_vi_programs", "snes_vi_iterations"),
        )
    }
    report = replace(last.report, converged=converged, reason=reason, rounds=len(rounds), **sums)
    iterations = [one for level in rounds for one in level.iterations]
    numbered = [replace(one, number=i) for i, one in enumerate(iterations, start=1)]
    return replace(last, report=report, iterations=numbered)
