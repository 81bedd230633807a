"""Tractions that are linear on facets, which stresses that are linear in the cells can balance.

A formula counts as what the program takes it for
(:mod:`perfplast_fenicsx.problem.declared.loads`): a quadratic through its values at vertices and
midsides. So one of degree 1 is exact, and one with kinks is linear where its kinks are at vertices.
"""

from itertools import combinations

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.problem.declared.loads import CosinePressure, Load, Pressure, Traction

ROUNDING = 1e-12
"""Difference of a linear traction at midsides from the mean of the ends', relative to the largest:
of formulas whose terms cancel some digits."""


def linear_tractions(load: Load, corners: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Tractions of ζ = 1 on straight facets. Not collective.

    Args:
        load: A traction or a pressure, also one that follows the cosine.
        corners: Vertices of the facets, shape (n, d, d).
        normals: Outward unit normals, shape (n, d).

    Returns:
        At the vertices, shape (n, d, d), and how much the quadratic differs from them at midsides,
        shape (n,) (stress).

    Raises:
        InputError: If the formula is not finite there.
        TypeError: If the load is of another kind.
    """
    d = corners.shape[1]
    edges = list(combinations(range(d), 2))
    middles = np.stack([corners[:, edge].mean(axis=1) for edge in edges], axis=1)
    at_ends, at_middles = _values(load, corners, normals), _values(load, middles, normals)
    means = np.stack([at_ends[:, edge].mean(axis=1) for edge in edges], axis=1)
    off: Floats = np.abs(at_middles - means).max(axis=(1, 2), initial=0.0)
    return at_ends, off


def _values(load: Load, x: Floats, normals: Floats) -> Floats:
    """Tractions at points, some on each facet: shape (n, k, d), as the points."""
    count, of_each, d = x.shape
    points = np.zeros((count * of_each, 3))
    points[:, :d] = x.reshape(-1, d)
    place = f"the load on '{load.on}'"
    if isinstance(load, Pressure):
        pressures = evaluate(load.value, points, place).reshape(count, of_each, 1)
        return -pressures * normals[:, None]
    if isinstance(load, CosinePressure):
        pressure = np.maximum(-(normals @ np.asarray(load.value, dtype=np.float64)), 0.0)
        return np.repeat((-pressure[:, None] * normals)[:, None], of_each, axis=1)
    if isinstance(load, Traction):
        each = [evaluate(value, points, place) for value in load.value]
        return np.stack(each, axis=1).reshape(count, of_each, d)
    raise TypeError(f"a {type(load).__name__} has no tractions")
