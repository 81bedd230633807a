"""Tighten bolts: shorten their shanks until each bolt has the required force."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.assembled.declared_loads import LoadCase
from perfplast_fenicsx.problem.assembled.initial_strain import Shanks
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem


def tighten(problem: Problem, at_rest: Callable[[], Level]) -> Level | None:
    """Shorten the shanks until each bolt has its preload, without loads. Collective.

    All bolts are tightened together. Moving supports, overlaps and initial strains already act.

    Args:
        problem: Problem whose bolts are loose.
        at_rest: Function that solves the level at ζ = 0.

    Returns:
        None if all bolts have their preloads; otherwise a level that reports why not, with the
        bolts loose again.
    """
    shanks, declared, e0 = problem.shanks, problem.loads, problem.initial_strain
    assert e0 is not None  # a problem with bolts has initial strains
    others: Floats = e0.x.array.copy()
    nothing = problem.create_vector()
    problem.loads = LoadCase(nothing, nothing)

    def solve() -> Level:
        e0.x.array[:] = others + shanks.strain()
        return at_rest()

    try:
        shanks.shortening = np.zeros(len(shanks.bolts))
        loose: Floats = np.zeros(len(shanks.bolts))
        level = _shorten(
            shanks, dict(zip(shanks.names, shanks.preloads, strict=True)), loose, solve
        )
        if level.report.converged:
            return None
        shanks.shortening = None
        e0.x.array[:] = others
        return level
    finally:
        problem.loads = declared
        nothing.destroy()


def tighten_anew(shanks: Shanks, wanted: Mapping[str, float], solve: Callable[[], Level]) -> Level:
    """Tighten or loosen some bolts under the current loads; the others keep their shortening.

    Collective.

    Args:
        shanks: Shanks of the problem; their bolts are already tightened.
        wanted: Required forces by the names of the bolts.
        solve: Function that solves a level with the current shortenings.

    Returns:
        The level with these forces; or, with the previous shortenings, a level that reports why the
        forces cannot be reached.
    """
    level = solve()
    if not level.report.converged:
        return level
    assert shanks.shortening is not None  # at least one level was solved
    before = shanks.shortening
    forces: Floats = np.array([level.report.bolts[name] for name in wanted])
    level = _shorten(shanks, wanted, forces, solve)
    if not level.report.converged:
        shanks.shortening = before
    return level


def _shorten(
    shanks: Shanks, wanted: Mapping[str, float], before: Floats, solve: Callable[[], Level]
) -> Level:
    """Shorten some shanks until their bolts have the required forces. Collective.

    The function uses Broyden's method; with a linear response and one bolt it solves two levels.

    Args:
        shanks: Shanks of the problem; their bolts are tightened.
        wanted: Required forces by the names of the bolts.
        before: Forces at the current shortenings.
        solve: Function that solves a level with the current shortenings.

    Returns:
        The last level; its report says whether the bolts have the required forces.
    """
    # Tolerance relative to the preload, as accurate as the default level tolerance, and largest
    # number of levels.
    tolerance, most = 1e-6, 12
    which = [shanks.names.index(name) for name in wanted]
    scale, targets = shanks.preloads[which], np.array(list(wanted.values()))
    assert shanks.shortening is not None
    shortening: Floats = shanks.shortening.copy()
    slope: Floats = np.diag(shanks.stiffness()[which])
    missing: Floats = targets - before
    step: Floats = missing / slope.diagonal()
    for number in range(most):
        shortening = shortening.copy()
        shortening[which] += step
        shanks.shortening = shortening
        level = solve()
        forces: Floats = np.array([level.report.bolts[name] for name in wanted])
        missing = targets - forces
        if not level.report.converged:
            break
        if np.abs(missing / scale).max() <= tolerance:
            return level
        change = forces - before
        if number == 0:  # a change beyond the tolerance gives the stiffness
            told = change * np.sign(step) > tolerance * scale
            own = np.divide(change, step, out=slope.diagonal().copy(), where=told)
            slope = np.diag(own)
        else:
            slope = slope + np.outer(change - slope @ step, step) / (step @ step)
        step[:], before = np.linalg.solve(slope, missing), forces
    worst = int(np.abs(missing / scale).argmax())
    why = level.report.reason if not level.report.converged else "its shank yields or slips"
    name = list(wanted)[worst]
    to = "its preload of" if targets[worst] == scale[worst] else "the force"
    reason = (
        f"the bolt '{name}' could not be tightened to {to} {targets[worst]:.6g}; it reached "
        f"only {forces[worst]:.6g}: {why}"
    )
    return replace(level, report=replace(level.report, converged=False, reason=reason))
