"""Tightening bolts: how far shanks are shortened until each has the force that is wanted."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.assembled.load_case import LoadCase
from perfplast_fenicsx.problem.assembled.shanks import Shanks
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem


def tighten(problem: Problem, at_rest: Callable[[], Level]) -> Level | None:
    """Shorten the shanks until each has its preload, with no load acting. Collective.

    All bolts together. Supports that move, overlaps and strains that stay are there already.

    Args:
        problem: Whose bolts are loose.
        at_rest: Solves ζ = 0.

    Returns:
        None; or a level that says why they cannot be tightened, where the bolts are loose again.
    """
    shanks, declared, e0 = problem.shanks, problem.loads, problem.initial_strain
    assert e0 is not None  # of a problem with bolts
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
    """Tighten, or loosen, some of the bolts beside what acts; others keep their length. Collective.

    Args:
        shanks: Shanks of the problem, tightened before.
        wanted: Forces by name.
        solve: Solves a level with the shortenings that the shanks have then.

    Returns:
        The level in which they have these forces; or one that says why there is none, where they
        are as long as before.
    """
    level = solve()
    if not level.report.converged:
        return level
    assert shanks.shortening is not None  # a level was solved
    before = shanks.shortening
    forces: Floats = np.array([level.report.bolts[name] for name in wanted])
    level = _shorten(shanks, wanted, forces, solve)
    if not level.report.converged:
        shanks.shortening = before
    return level


def _shorten(
    shanks: Shanks, wanted: Mapping[str, float], before: Floats, solve: Callable[[], Level]
) -> Level:
    """Shorten some shanks until their forces are as wanted. Collective.

    By Broyden's method, which takes two levels where the bodies answer in proportion and there is
    one bolt.

    Args:
        shanks: Shanks of the problem; they have shortenings.
        wanted: Forces by name.
        before: Forces at these shortenings.
        solve: Solves a level with the shortenings that the shanks have then.
    """
    # Of the preload. As large as what steps of a level leave by default, and
    # so many levels are tried.
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
        if number == 0:  # what has closed a gap at least shows its stiffness
            told = change * np.sign(step) > tolerance * scale
            own = np.divide(change, step, out=slope.diagonal().copy(), where=told)
            slope = np.diag(own)
        else:
            slope = slope + np.outer(change - slope @ step, step) / (step @ step)
        step[:], before = np.linalg.solve(slope, missing), forces
    worst = int(np.abs(missing / scale).argmax())
    why = level.report.reason if not level.report.converged else "its shank yields, or slips"
    name = list(wanted)[worst]
    to = "its preload of" if targets[worst] == scale[worst] else "the force"
    reason = (
        f"the bolt '{name}' is not tightened to {to} {targets[worst]:.6g}, but to"
        f" {forces[worst]:.6g}: {why}"
    )
    return replace(level, report=replace(level.report, converged=False, reason=reason))
