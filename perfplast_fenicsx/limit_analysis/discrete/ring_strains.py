"""Evaluate strain rates of v = ru in axisymmetry by Bernstein coefficients, for dilating ground.

For the strain rates ε of u, r²ε is quadratic in a cell of the section
(:func:`~perfplast_fenicsx.mesh.ring_polynomials.ring_rates`). The admissible rates of a yield set
are a convex cone. Bernstein's polynomials are not negative. So r²ε lies in the cone everywhere in
the cell if its six coefficients q_i do. The power D is convex and of degree one, and ∫ D(ε) r ≤ Σ
D(q_i) ∫ B_i/r. So the points of a cell are its coefficients. The rate of a point is q_i/ρ_i with
the coefficient ρ_i of r, and its weight is ρ_i ∫ B_i/r. On the axis ρ_i = 0, and q_i is zero; such
a point is treated as elastic.
"""

import math

from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import (
    coefficients_of_radius,
    equal_parts,
    of_parts,
    ring_rates,
    weights_of_rates,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.problem.problem import Problem

COUNT = 6
"""Number of coefficients of a quadratic function in a triangle."""

PARTS = 8
"""Number of parts of a cell's edge for the integrals of B_i/r."""


def has_coefficients(problem: Problem) -> bool:
    """Return whether the points of a problem are Bernstein coefficients. Not collective."""
    by_flux = isinstance(problem.kinematics, RingFlux)
    return by_flux and problem.Q.dofmap.dof_layout.num_dofs == COUNT


def nodes_of_cells(problem: Problem, count: int) -> tuple[Ints, Ints]:
    """Return the nodes of cells: at the vertices, then on the edges opposite these vertices.

    Args:
        problem: A problem with quadratic elements on triangles.
        count: Number of cells, counted from the first.

    Returns:
        Local numbers, shape (count, 6); their positions among the nodes of a cell, shape (6,).
    """
    layout = problem.V.dofmap.dof_layout
    columns = [layout.entity_dofs(of, i)[0] for of in (0, 1) for i in range(3)]
    return problem.V.dofmap.list[:count][:, columns], np.array(columns, dtype=np.int32)


class RingCoefficients:
    """Rates q_i/ρ_i of velocities v = ru; see :class:`point_strains.Rates` for the methods.

    Attributes:
        weights: Weights, shape (count,); a point on the axis has a sixth of its cell.
        on_axis: Flags of the points on the axis, whose rates are zero, shape (count,).
    """

    def __init__(self, problem: Problem) -> None:
        """Compute the matrices of the cells. Not collective."""
        self._problem, self._sums = problem, fem.Function(problem.V)
        cells, places = corners(problem.tagged_mesh.mesh)
        x = places[cells]
        self._points = problem.Q.dofmap.list[: len(cells)]
        self._nodes, self._columns = nodes_of_cells(problem, len(cells))
        rho = coefficients_of_radius(x)
        off = rho > 0
        self._matrices = np.zeros((len(x), COUNT, 4, 2 * COUNT))
        for unknown in range(2 * COUNT):
            v = np.zeros((len(x), 2 * COUNT))
            v[:, unknown] = 1.0
            rates = ring_rates(x, v.reshape(-1, COUNT, 2))
            self._matrices[..., unknown] = np.where(
                off[..., None], rates / np.where(off, rho, 1.0)[..., None], 0.0
            )
        _, areas = gradients(x)
        count = problem.Q.dofmap.index_map.size_local
        self.weights: Floats = np.zeros(count)
        whole = 2 * math.pi * np.where(off, rho * _over_radius(x, areas), areas[:, None] / COUNT)
        self.weights[self._points] = whole
        self.on_axis: PairFlags = np.zeros(count, dtype=np.bool_)
        self.on_axis[self._points] = ~off

    def of(self, v: fem.Function) -> Floats:
        """See :meth:`point_strains.Rates.of`."""
        values = v.x.array.reshape(-1, 2)[self._nodes].reshape(len(self._nodes), -1)
        found = np.zeros((len(self.weights), 4), order="F")
        found[self._points] = np.einsum("cpij,cj->cpi", self._matrices, values)
        return found

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """See :meth:`point_strains.Rates.forces`."""
        weighted = (self.weights[:, None] * stress)[self._points]
        parts = np.einsum("cpij,cpi->cj", self._matrices, weighted, optimize=True)
        sums = self._sums.x.array.reshape(-1, 2)
        sums[:] = 0.0
        np.add.at(sums, self._nodes, parts.reshape(-1, COUNT, 2))
        self._sums.x.scatter_reverse(la.InsertMode.add)
        sums[self._problem.fixed] = 0.0
        out.array[:] = self._sums.x.array[: out.getLocalSize()]

    def of_unknowns(self) -> Floats:
        """See :meth:`point_strains.Rates.of_unknowns`."""
        found = np.zeros_like(self._matrices).reshape(*self._matrices.shape[:3], COUNT, 2)
        found[:, :, :, self._columns] = self._matrices.reshape(found.shape)
        return found.reshape(self._matrices.shape)


def _over_radius(x: Floats, areas: Floats) -> Floats:
    """Return upper bounds of ∫ B_i/r in cells, shape (num_cells, 6).

    Args:
        x: Vertices of cells, shape (num_cells, 3, 2).
        areas: Areas of the cells, shape (num_cells,).
    """
    parts = equal_parts(PARTS)
    unit = np.eye(COUNT)[None]  # coefficients of each polynomial
    found = np.zeros((len(x), COUNT))
    for part in parts:
        weights = weights_of_rates(x[..., 0] @ part.T, areas / len(parts))
        found += weights @ of_parts(unit, part[None])[0]
    return found
