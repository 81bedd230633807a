"""Evaluate tractions that are linear on facets: stresses linear in the cells can balance them.

The module treats pore pressures that are linear in each cell in the same way.

The program replaces a formula by a quadratic through its values at vertices and midsides
(:mod:`perfplast_fenicsx.problem.declared.loads`). So a formula of degree 1 is exact, and one with
kinks is linear if its kinks are at vertices.
"""

from itertools import combinations

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.problem.declared.loads import (
    CosinePressure,
    EnclosedPores,
    Load,
    PorePressure,
    Pressure,
    Traction,
)

ROUNDING = 1e-12
"""Allowed difference of a linear traction at midsides from the mean of the ends, relative to the
largest value. Formulas whose terms cancel lose some digits."""


def linear_tractions(load: Load, corners: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return the tractions on straight facets for ζ = 1. Not collective.

    Args:
        load: A traction or a pressure, or the cosine pressure of a bearing.
        corners: Vertices of the facets, shape (n, d, d).
        normals: Outward unit normals, shape (n, d).

    Returns:
        The tractions at the vertices, shape (n, d, d), and how much the quadratic differs from the
        linear traction at midsides, shape (n,) (stress).

    Raises:
        InputError: If the formula is not finite on these facets.
        TypeError: If the load is of another kind.
    """
    at_ends = _values(load, corners, normals)
    return at_ends, _off(at_ends, _values(load, _middles(corners), normals))


def linear_pores(load: PorePressure, corners: Floats) -> tuple[Floats, Floats]:
    """Return the pore pressure in straight cells for ζ = 1. Not collective.

    Args:
        load: The pore pressure.
        corners: Vertices of the cells, shape (n, d + 1, d).

    Returns:
        The pressures at the vertices, shape (n, d + 1), and how much the quadratic differs from the
        linear pressure at midsides, shape (n,) (stress).

    Raises:
        InputError: If the formula is not finite in these cells.
        TypeError: If no linear function can enclose the pressure.
    """
    place = f"the load on '{load.on}'"
    values = load.at_corners(corners)
    if values is not None:
        return values, np.zeros(len(corners))
    if isinstance(load, EnclosedPores):
        raise TypeError(f"{place} has no linear functions around it")
    at_ends, at_middles = (
        evaluate(load.value, _points(x), place).reshape(x.shape[:2])
        for x in (corners, _middles(corners))
    )
    return at_ends, _off(at_ends[..., None], at_middles[..., None])


def _edges(count: int) -> list[tuple[int, int]]:
    """Return the ends of the edges of a simplex with ``count`` vertices."""
    return list(combinations(range(count), 2))


def _middles(corners: Floats) -> Floats:
    """Return the midpoints of the edges."""
    edges = _edges(corners.shape[1])
    return np.stack([corners[:, edge].mean(axis=1) for edge in edges], axis=1)


def _off(at_ends: Floats, at_middles: Floats) -> Floats:
    """Return how much values differ at midsides from the mean of the ends, for each simplex."""
    off: Floats = np.abs(at_middles - _middles(at_ends)).max(axis=(1, 2), initial=0.0)
    return off


def _points(x: Floats) -> Floats:
    """Return the points of some simplices as one list, with three coordinates each."""
    points = np.zeros((x.shape[0] * x.shape[1], 3))
    points[:, : x.shape[2]] = x.reshape(-1, x.shape[2])
    return points


def _values(load: Load, x: Floats, normals: Floats) -> Floats:
    """Return the tractions at some points on each facet, shape (n, k, d) as the points."""
    count, of_each, d = x.shape
    points, place = _points(x), f"the load on '{load.on}'"
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
