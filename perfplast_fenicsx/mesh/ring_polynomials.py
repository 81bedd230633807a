"""Represent quadratic functions on half sections of bodies of revolution by Bernstein coefficients.

A cell has coefficients at its vertices, followed by coefficients at its edges. The Bernstein
polynomials B_i are non-negative and sum to 1. This module uses only NumPy.
"""

import math
from functools import lru_cache
from itertools import product

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.mesh.straight_geometry import gradients

EDGES = ((1, 2), (0, 2), (0, 1))
"""Ends of the edges in the order of their coefficients; edge a is opposite vertex a."""

COEFFICIENTS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""Index of the coefficient for each pair of vertices (a pair of equal vertices is the vertex)."""


@lru_cache
def means() -> Floats:
    """Return the means of B_i λ_j over a triangle, with barycentric coordinates λ, shape (6, 3)."""
    found: Floats = np.concatenate([1 + 2 * np.eye(3), 2 - np.eye(3)]) / 30
    return found


def polynomials(places: Floats) -> Floats:
    """Return the values of the Bernstein polynomials at points, shape (num_places, 6).

    Args:
        places: Barycentric coordinates of the points, shape (num_places, 3).
    """
    a, b = np.array(EDGES).T
    return np.hstack([places**2, 2 * places[:, a] * places[:, b]])


def coefficients_of_radius(x: Floats) -> Floats:
    """Return the coefficients of r, shape (num_cells, 6).

    Args:
        x: Vertices (r, z) of cells, shape (num_cells, 3, 2).
    """
    radii = x[..., 0]
    ends = np.array(EDGES)
    return np.concatenate([radii, radii[:, ends].mean(axis=2)], axis=1)


def coefficients_of_product(radii: Floats, values: Floats) -> Floats:
    """Return the coefficients of r times k linear functions in cells, shape (num_cells, 6, k).

    Args:
        radii: Radii at the vertices, shape (num_cells, 3).
        values: Values of the linear functions at the vertices, shape (num_cells, 3, k).
    """
    a, b = np.array(EDGES).T
    between = radii[:, a, None] * values[:, b] + radii[:, b, None] * values[:, a]
    return np.concatenate([radii[..., None] * values, between / 2], axis=1)


def of_parts(stress: Floats, corners: Floats) -> Floats:
    """Return the coefficients of polynomials on parts of cells.

    Args:
        stress: Coefficients of the polynomials on the parent cell of each part, shape (num_parts,
            6, m).
        corners: Barycentric coordinates of each part's vertices in the parent, shape (num_parts, 3,
            3).
    """
    whole = stress[:, COEFFICIENTS]
    polar = np.einsum("pua,pvb,pabm->puvm", corners, corners, whole, optimize=True)
    ends: Longs = np.array([(a, a) for a in range(3)] + list(EDGES))
    return np.asarray(polar[:, ends[:, 0], ends[:, 1]])


def ring_rates(x: Floats, v: Floats) -> Floats:
    """Return the coefficients of r²ε as Mandel vectors, shape (num_cells, 6, 4).

    Args:
        x: Vertices of cells, shape (num_cells, 3, 2).
        v: Values of v = ru at vertices and midpoints, in the order of :data:`EDGES`, shape
            (num_cells, 6, 2).
    """
    ends = np.array(EDGES)
    bernstein = v.copy()
    bernstein[:, 3:] = 2 * v[:, 3:] - v[:, ends].mean(axis=2)
    slopes, _ = gradients(x)
    # ∂_k v_i at the vertices
    grad = 2 * np.einsum("cbk,cabi->caik", slopes, bernstein[:, COEFFICIENTS])
    r_grad = coefficients_of_product(x[..., 0], grad.reshape(len(x), 3, 4)).reshape(-1, 6, 2, 2)
    shear = r_grad[..., 0, 1] + r_grad[..., 1, 0] - bernstein[..., 1]
    return np.stack(
        [
            r_grad[..., 0, 0] - bernstein[..., 0],
            r_grad[..., 1, 1],
            bernstein[..., 0],
            math.sqrt(0.5) * shear,
        ],
        axis=2,
    )


def weights_of_rates(radii: Floats, areas: Floats) -> Floats:
    """Return upper bounds on ∫ B_i/r over triangles; 0 if coefficient i belongs to the axis.

    Args:
        radii: Radii at the vertices of the triangles, shape (n, 3).
        areas: Areas of the triangles, shape (n,).

    Returns:
        Bounds, shape (n, 6).
    """
    on_axis = radii == 0
    inverse = np.divide(1.0, radii, out=np.zeros_like(radii), where=~on_axis)
    weights = inverse @ means().T
    for a, (b, c) in enumerate(EDGES):
        ab, ac = COEFFICIENTS[a, [b, c]]
        at_vertex = on_axis[:, a] & (on_axis.sum(axis=1) == 1)
        r, s = inverse[at_vertex][:, [b, c]].T / 36
        found = np.zeros((len(r), 6))
        found[:, b], found[:, c], found[:, 3 + a] = 6 * r + 2 * s, 2 * r + 6 * s, 4 * (r + s)
        found[:, ab], found[:, ac] = 8 * r + 4 * s, 4 * r + 8 * s
        weights[at_vertex] = found
        on_edge = on_axis[:, b] & on_axis[:, c]
        share = inverse[on_edge, a] / 3
        found = np.zeros((len(share), 6))
        found[:, a], found[:, ab], found[:, ac] = share, 2 * share, 2 * share
        weights[on_edge] = found
    return np.asarray(areas[:, None] * weights)


def equal_parts(count: int) -> list[Floats]:
    """Return the barycentric coordinates of the vertices of n² equal parts; n = count."""
    parts = []
    for i, j in product(range(count), repeat=2):
        low = np.array([[i, j], [i + 1, j], [i, j + 1]])
        high = np.array([[i + 1, j], [i + 1, j + 1], [i, j + 1]])
        for part in (low, high):
            if part.sum(axis=1).max() <= count:
                first = count - part.sum(axis=1, keepdims=True)
                parts.append(np.hstack([first, part]) / count)
    return parts
