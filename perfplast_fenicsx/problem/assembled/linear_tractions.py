"""Tractions that are linear on facets, which stresses that are linear in the cells can balance.

So can they a pressure in pores that is linear in each cell.

A formula counts as what the program takes it for
(:mod:`perfplast_fenicsx.problem.declared.loads`): a quadratic through its values at vertices and
midsides. So one of degree 1 is exact, and one with kinks is linear where its kinks are at vertices.
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
"""Difference of a linear traction at midsides from the mean of the ends', relative to the largest:
of formulas whose terms cancel some digits."""


def linear_tractions(load: Load, corners: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return tractions of ζ = 1 on straight facets. Not collective.

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
    at_ends = _values(load, corners, normals)
    return at_ends, _off(at_ends, _values(load, _middles(corners), normals))


def linear_pores(load: PorePressure, corners: Floats) -> tuple[Floats, Floats]:
    """Return a pressure in the pores of straight cells, of ζ = 1. Not collective.

    Args:
        load: The pressure.
        corners: Vertices of the cells, shape (n, d + 1, d).

    Returns:
        At the vertices, shape (n, d + 1), and how much the quadratic differs from it at midsides,
        shape (n,) (stress).

    Raises:
        InputError: If the formula is not finite there.
        TypeError: If there is no linear function to take in its place.
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
    """Return ends of the edges of a simplex with so many vertices."""
    return list(combinations(range(count), 2))


def _middles(corners: Floats) -> Floats:
    """Return the midpoints of the edges."""
    edges = _edges(corners.shape[1])
    return np.stack([corners[:, edge].mean(axis=1) for edge in edges], axis=1)


def _off(at_ends: Floats, at_middles: Floats) -> Floats:
    """Return how much values differ at midsides from the mean of the ends', of each simplex."""
    off: Floats = np.abs(at_middles - _middles(at_ends)).max(axis=(1, 2), initial=0.0)
    return off


def _points(x: Floats) -> Floats:
    """Return points of some simplices, in a row and with three coordinates."""
    points = np.zeros((x.shape[0] * x.shape[1], 3))
    points[:, : x.shape[2]] = x.reshape(-1, x.shape[2])
    return points


def _values(load: Load, x: Floats, normals: Floats) -> Floats:
    """Return tractions at points, some on each facet: shape (n, k, d), as the points."""
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
