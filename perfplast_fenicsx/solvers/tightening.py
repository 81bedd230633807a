"""Tightening bolts: how far shanks are shortened until each has its preload."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.assembled.load_case import LoadCase
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem


def tighten(problem: Problem, at_rest: Callable[[], Level]) -> Level | None:
    """Shorten the shanks until each has its preload, with no load acting. Collective.

    All bolts together. Shortenings are found by Broyden's method, which takes two levels where the
    bodies answer in proportion and there is one bolt. Supports that move, overlaps and strains that
    stay are there already.

    Args:
        problem: Whose bolts are loose.
        at_rest: Solves ζ = 0.

    Returns:
        None; or a level that says why they cannot be tightened, where the bolts are loose again.
    """
    # Of the preload. As large as what steps of a level leave by default, and
    # so many levels are tried.
    tolerance, most = 1e-6, 12
    shanks, preloads = problem.shanks, problem.shanks.preloads
    declared, e0 = problem.loads, problem.initial_strain
    assert e0 is not None  # of a problem with bolts
    others: Floats = e0.x.array.copy()
    nothing = problem.create_vector()
    problem.loads = LoadCase(nothing, nothing)
    slope: Floats = np.diag(shanks.stiffness())
    step: Floats = preloads / slope.diagonal()
    shortening: Floats = np.zeros(len(preloads))
    before: Floats = np.zeros(len(preloads))
    try:
        for number in range(most):
            shortening = shortening + step
            shanks.shortening = shortening
            e0.x.array[:] = others + shanks.strain()
            level = at_rest()
            forces = np.array([level.report.bolts[name] for name in shanks.names])
            missing = preloads - forces
            if level.report.converged and np.abs(missing / preloads).max() <= tolerance:
                return None
            if not level.report.converged:
                break
            change = forces - before
            if number == 0:  # what has closed a gap at least tells its stiffness
                told = forces > tolerance * preloads
                slope = np.diag(np.where(told, forces / shortening, slope.diagonal()))
            else:
                slope = slope + np.outer(change - slope @ step, step) / (step @ step)
            step, before = np.linalg.solve(slope, missing), forces
        worst = int(np.abs(missing / preloads).argmax())
        why = level.report.reason if not level.report.converged else "its shank yields, or slips"
        shanks.shortening = None
        e0.x.array[:] = others
        reason = (
            f"the bolt '{shanks.names[worst]}' is not tightened to its preload of"
            f" {preloads[worst]:.6g}, but to {forces[worst]:.6g}: {why}"
        )
        return replace(level, report=replace(level.report, converged=False, reason=reason))
    finally:
        problem.loads = declared
        nothing.destroy()
