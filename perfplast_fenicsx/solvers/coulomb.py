"""Coulomb's friction as a fixed point of Tresca's: c ← c₀ + μ λ, with the contact forces λ.

Each round is a convex problem with the bounds of the round before, and is certified as one. The
fixed point is not the minimum of anything: there may be none, or several, and neither duality gap
nor limit theorems are known of it. The path counts as one step, for which slip and the force of
friction are opposite in the end, whatever was in between.
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
"""Solves a level with Tresca's friction from a state."""

Largest = Callable[[], float]
"""The largest nodal force of the stress that the last level has ended with; collective."""


def solve_coulomb(
    problem: Problem, solve: Solve, largest_force: Largest, start: State | None, pushes: Floats
) -> Level:
    """Solve a level with Coulomb's friction. Collective.

    Args:
        problem: Whose friction is brought up to date.
        solve: Solves it with the bounds that it has.
        largest_force: Beside which contact forces may be rounding.
        start: State to begin with; None for none.
        pushes: Contact forces there, shape (num_pairs,). Where there are none, or they bound
            friction too low for what the loads have grown to, nothing slips in the first round.
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
    """Return rounds from first bounds until these settle. Collective.

    Args:
        problem: Whose friction is brought up to date.
        solve: See :func:`solve_coulomb`.
        largest_force: See there.
        start: State to begin with; None for none.
        bounds: The first ones.
        most: Bounds that surfaces on this rank have had before.
    """
    friction, comm = problem.friction, problem.comm
    follows = friction.coulomb > 0
    friction.bound[follows] = bounds
    most = comm.allreduce(float(bounds[np.isfinite(bounds)].max(initial=most)), MPI.MAX)
    rounds: list[Level] = []
    most_rounds = 100
    reason = f"the limits of friction have not converged in {most_rounds} rounds"
    # Change of the bounds in a round, relative to the largest one, that makes it the last.
    settled = 1e-8
    # Contact forces below this share of the largest force on bodies, or of the largest contact
    # force that a level has had, are rounding of unloaded surfaces, and so are forces of friction.
    rounding = 1e-10
    for _ in range(most_rounds):
        level = solve(start)
        rounds.append(level)
        if not level.report.converged:
            bounds_of = "with the last round's forces of contact" if len(rounds) > 1 else "at first"
            reason = (
                f"round {len(rounds)} of Coulomb's friction, {bounds_of}: {level.report.reason}"
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
    """c₀ + μ λ where friction is Coulomb's, with the adhesion c₀."""
    friction = problem.friction
    follows = friction.coulomb > 0
    bounds: Floats = friction.coulomb[follows] * np.maximum(forces[friction.pair[follows]], 0.0)
    bounds += friction.adhesion[follows]
    return bounds


def _together(rounds: list[Level], converged: bool, reason: str) -> Level:
    """Return the last round with the counts of all."""
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
