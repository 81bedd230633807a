"""Compute the best stress and velocity for the bodies of a proof with Clarabel, if installed.

This is an independent computation: it uses only the arrays in the proof files.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.touching import touching

Floats = npt.NDArray[np.float64]


@dataclass
class Rows:
    """Rows of a sparse matrix."""

    count: int = 0
    rows: list[npt.NDArray] = field(default_factory=list)
    columns: list[npt.NDArray] = field(default_factory=list)
    values: list[npt.NDArray] = field(default_factory=list)

    def new(self, *shape: int) -> npt.NDArray:
        """Return the indices of additional rows."""
        numbers = self.count + np.arange(int(np.prod(shape))).reshape(shape)
        self.count += numbers.size
        return numbers

    def add(self, rows: npt.NDArray, columns: npt.NDArray, values: npt.NDArray) -> None:
        """Add entries; the shapes are broadcast."""
        some = [part.ravel() for part in np.broadcast_arrays(rows, columns, values)]
        for them, part in zip((self.rows, self.columns, self.values), some, strict=True):
            them.append(part)

    def matrix(self, width: int) -> sp.csc_matrix:
        """Return all rows as a matrix."""
        if not self.rows:
            return sp.csc_matrix((self.count, width))
        parts = [np.concatenate(them) for them in (self.values, self.rows, self.columns)]
        return sp.csc_matrix((parts[0], (parts[1], parts[2])), shape=(self.count, width))


Solve = Callable[[Floats, tuple[Any, Floats], Any, Rows, Floats], float | None]
"""A function like :func:`solve`."""


def best_load(body: Body, by: Solve | None = None) -> float | None:
    """Return the largest λ for linear stresses; None if Clarabel does not converge.

    Args:
        body: The bodies.
        by: Function that solves the program; :func:`solve` by default.
    """
    d = body.dim
    pairs = [(i, j) for i in range(d) for j in range(i, d)]
    basis = np.zeros((len(pairs), d, d))
    for n, (i, j) in enumerate(pairs):
        basis[n, i, j] = basis[n, j, i] = 1.0
    at = np.arange(len(body.cells) * (d + 1) * len(pairs)).reshape(-1, d + 1, len(pairs))
    load = at.size
    pushes = {facet: load + 1 + d * i for i, facet in enumerate(_hosts(body))}
    width = load + 1 + d * len(pushes)
    equal, least = Rows(), Rows()

    rows = equal.new(len(body.cells), d)
    terms = np.einsum("nij,cvj->civn", basis, body.gradients)
    equal.add(rows[:, :, None, None], at[:, None], terms)
    equal.add(rows, np.array(load), body.sought.body_force)

    def traction(rows: npt.NDArray, sides: npt.NDArray, places: npt.NDArray) -> None:
        terms = np.einsum("nij,fj->fin", basis, body.normals_of(sides))
        columns = at[(sides // (d + 1))[:, None], places]
        equal.add(rows[..., None], columns[:, :, None], terms[:, None])

    inner = body.sides[0]
    rows = equal.new(len(inner), d, d)
    for sides in inner.T:
        places = body.corners[sides % (d + 1)]
        numbers = np.take_along_axis(body.cells[sides // (d + 1)], places, axis=1)
        traction(rows, sides, np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1))

    rows = equal.new(len(body.facets), d, d)
    loose = equal.count
    traction(rows, body.outer, body.places)
    equal.add(rows, np.array(load), -body.sought.traction)
    for facet, column, normal in _pushed(body, pushes):
        equal.add(rows[facet], column[:, None], normal[None])
    keep = np.ones(loose, dtype=bool)
    keep[rows[np.broadcast_to(body.held[:, None], rows.shape)]] = False

    columns = np.arange(load + 1, width)
    least.add(least.new(len(columns)), columns, -np.ones(len(columns)))
    trace = np.trace(basis, axis1=1, axis2=2)[:, None, None] / d
    deviator = (basis - trace * np.eye(d)).reshape(len(pairs), d * d)
    yields = at[body.plastic].reshape(-1, len(pairs))
    cones = Rows()
    rows = cones.new(len(yields), 1 + d * d)
    cones.add(rows[:, 1:, None], yields[:, None], -deviator.T[None])
    right = np.zeros(rows.shape)
    right[:, 0] = np.repeat(body.yield_radius[body.plastic], d + 1)
    cost = np.zeros(width)
    cost[load] = -1.0
    equalities = equal.matrix(width)[keep]
    rows_and_right = (equalities, np.zeros(keep.sum()))
    found = (by or solve)(cost, rows_and_right, least.matrix(width), cones, right)
    return None if found is None else -found


def solve(
    cost: Floats, equal: tuple[Any, Floats], least: Any, cones: Rows, right: Floats
) -> float | None:
    """Return min cost·x with A x = b, C x ≤ 0 and right − S x in equal cones; None on failure."""
    import clarabel  # the calling test has checked that the package exists

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    problem = posed(cost, equal, least, cones, right)
    solution = clarabel.DefaultSolver(*problem, settings).solve()
    return float(solution.obj_val) if str(solution.status) == "Solved" else None


def posed(
    cost: Floats, equal: tuple[Any, Floats], least: Any, cones: Rows, right: Floats
) -> tuple[Any, ...]:
    """Return the same program in the form of Clarabel, without its settings."""
    import clarabel

    matrix = sp.vstack([equal[0], least, cones.matrix(len(cost))], format="csc")
    b = np.concatenate([equal[1], np.zeros(least.shape[0]), right.ravel()])
    kinds = [clarabel.ZeroConeT(equal[0].shape[0]), clarabel.NonnegativeConeT(least.shape[0])]
    kinds += [clarabel.SecondOrderConeT(right.shape[1])] * len(right)
    nothing = sp.csc_matrix((len(cost), len(cost)))
    return nothing, cost, matrix, b, kinds


def least_power(
    body: Body, nodes: npt.NDArray, points: Floats, by: Solve | None = None
) -> float | None:
    """Return the least dissipation of quadratic velocities with L(v) = 1, integrated at points.

    Args:
        body: The bodies.
        nodes: Nodes of the cells.
        points: Barycentric coordinates of points of equal weight in a cell.
        by: Function that solves the program; :func:`solve` by default.

    Returns:
        The dissipation; None if Clarabel does not converge.
    """
    d, g = body.dim, body.gradients
    edges = list(combinations(range(d + 1), 2))
    slopes = np.zeros((len(g), d + 1, d + 1 + len(edges), d))  # of shape functions, at vertices
    for a in range(d + 1):
        slopes[:, :, a] = (4 * np.eye(d + 1)[a] - 1)[None, :, None] * g[:, None, a]
    for n, (a, b) in enumerate(edges, start=d + 1):
        slopes[:, a, n], slopes[:, b, n] = 4 * g[:, b], 4 * g[:, a]
    count = int(nodes.max()) + 1
    at = np.arange(count * d).reshape(-1, d)
    plastic, width = np.flatnonzero(body.plastic), count * d
    times = width + np.arange(len(plastic) * len(points)).reshape(-1, len(points))
    width += times.size
    equal, least, cones = Rows(), Rows(), Rows()
    of_cells = at[nodes]

    rows = equal.new(len(plastic), d + 1)
    equal.add(rows[:, :, None, None], of_cells[plastic][:, None], slopes[plastic])
    unit = np.eye(d)
    strain = (unit[:, None, :, None] * unit[None, :, None, :]).reshape(d * d, d, d)
    strain = (strain + strain.transpose(0, 2, 1)) / 2
    elastic = np.flatnonzero(~body.plastic)
    rows = equal.new(len(elastic), d + 1, d * d)
    terms = np.einsum("sij,cknj->cksni", strain, slopes[elastic])
    equal.add(rows[..., None, None], of_cells[elastic][:, None, None], terms)

    facet_nodes = nodes[(body.outer // (d + 1))[:, None], _facet_places(body)]
    fixed = np.unique(at[facet_nodes][np.broadcast_to(body.held[:, None], (*facet_nodes.shape, d))])
    equal.add(equal.new(len(fixed)), fixed, np.ones(len(fixed)))
    work = equal.new(1)
    equal.add(work, at, _loads(body, nodes, facet_nodes, count))
    b = np.zeros(equal.count)
    b[work] = 1.0

    for ours, theirs, normals in _opposite(body, facet_nodes):
        rows = least.new(*ours.shape)
        bernstein = np.eye(ours.shape[1])
        for n, (i, j) in enumerate(combinations(range(d), 2), start=d):
            bernstein[n, [i, j, n]] = -0.5, -0.5, 2.0
        terms = bernstein[None, :, :, None] * normals[:, None, None]
        least.add(rows[..., None, None], at[ours][:, None], terms)
        if theirs is not None:
            least.add(rows[..., None, None], at[theirs][:, None], -terms)

    rows = cones.new(len(plastic), len(points), 1 + d * d)
    cones.add(rows[..., 0], times, -np.ones(times.shape))
    terms = np.einsum("sij,qk,cknj->cqsni", strain, points, slopes[plastic])
    cones.add(rows[..., 1:, None, None], of_cells[plastic][:, None, None], -terms)
    cost = np.zeros(width)
    cost[times] = (body.volumes * body.yield_radius)[plastic, None] / len(points)
    right = np.zeros((times.size, 1 + d * d))
    return (by or solve)(cost, (equal.matrix(width), b), least.matrix(width), cones, right)


def _facet_places(body: Body) -> npt.NDArray:
    """Return the indices in its cell of the vertices and midsides of each outer facet."""
    d = body.dim
    edges = {pair: n for n, pair in enumerate(combinations(range(d + 1), 2), start=d + 1)}
    rows = [
        [*places, *(edges[min(a, b), max(a, b)] for a, b in combinations(places, 2))]
        for places in body.places.tolist()
    ]
    return np.array(rows)


def _loads(body: Body, nodes: npt.NDArray, facet_nodes: npt.NDArray, count: int) -> Floats:
    """Return L of the nodal shape functions for loads that are constant on facets."""
    d = body.dim
    forces = np.zeros((count, d))
    facet = {2: [1 / 6, 1 / 6, 4 / 6], 3: [0, 0, 0, 1 / 3, 1 / 3, 1 / 3]}[d]
    cell = {2: [0, 0, 0, *[1 / 3] * 3], 3: [*[-1 / 20] * 4, *[1 / 5] * 6]}[d]
    for places, shares, sizes, values in (
        (facet_nodes, facet, body.areas, body.sought.traction.mean(axis=1)),
        (nodes, cell, body.volumes, body.sought.body_force),
    ):
        parts = np.array(shares)[None, :, None] * (sizes[:, None] * values)[:, None]
        np.add.at(forces, places, parts)
    return forces


def _hosts(body: Body) -> list[int]:
    """Return the facets to which a contact pressure belongs."""
    hosts: list[int] = []
    for one, other in body.contacts:
        hosts += touching(body, one, other).first.tolist()
    for tag in body.obstacles:
        hosts += body.on(tag).tolist()
    return hosts


def _pushed(body: Body, pushes: dict[int, int]) -> Any:
    """Return facets, columns of the pressures at their vertices, and pressure directions."""
    d = body.dim
    for one, other in body.contacts:
        pair = touching(body, one, other)
        for a, b, order in zip(pair.first, pair.second, pair.order, strict=True):
            column = pushes[int(a)] + np.arange(d)
            yield a, column, body.normals[a]
            opposite = np.empty(d, dtype=int)
            opposite[order] = column
            yield b, opposite, body.normals[b]
    for tag, normal in zip(body.obstacles, body.obstacle_normals, strict=True):
        for facet in body.on(tag):
            yield facet, pushes[int(facet)] + np.arange(d), normal


def _opposite(body: Body, facet_nodes: npt.NDArray) -> Any:
    """Return nodes of facets that may penetrate, the opposite nodes or None, and the directions."""
    x = body.dim
    for one, other in body.contacts:
        pair = touching(body, one, other)
        edges = {frozenset(e): n for n, e in enumerate(combinations(range(x), 2), start=x)}
        order = [
            [*row, *(edges[frozenset((row[a], row[b]))] for a, b in combinations(range(x), 2))]
            for row in pair.order.tolist()
        ]
        theirs = np.take_along_axis(facet_nodes[pair.second], np.array(order), axis=1)
        yield facet_nodes[pair.first], theirs, body.normals[pair.first]
    for tag, normal in zip(body.obstacles, body.obstacle_normals, strict=True):
        facets = body.on(tag)
        yield facet_nodes[facets], None, np.tile(normal, (len(facets), 1))
