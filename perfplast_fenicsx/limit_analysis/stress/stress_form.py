"""Compute areas of facets and cells in the balance of a stress, and loads on multipliers.

In the plane and in space stresses are linear in the cells, with as many nodes on a facet as it has
vertices. In axisymmetry rσ is quadratic, with one more node (:mod:`stress_cells`).
"""

import math
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, FacetLoads
from perfplast_fenicsx.limit_analysis.facets.stress_cells import (
    NODES,
    cell_layout,
    on_facets,
    ring_forces,
)
from perfplast_fenicsx.mesh.straight_geometry import gradients
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class StressForm:
    """Geometry of the cells that a rank owns and of its local facets.

    Attributes:
        vertices: Vertices of the cells, shape (num_cells, d + 1, d).
        turned: Whether the cells are sections of rings.
        nodes: Number of nodes of a facet, its vertices first.
        twins: Twins of the facets' unknowns, shape (num_facets, nodes, d).
        areas: Area of each node, in axisymmetry for the full turn, shape (num_facets, nodes).
        measures: The same, with a value other than zero on an axis.
        sections: V^((d − 1)/d), in axisymmetry times 2πr.
        slopes: Gradients of barycentric coordinates, shape (num_cells, d + 1, d).
        shares: Area of each facet of each cell over d, shape (num_cells, d + 1).
        volumes: Volumes of the cells; in axisymmetry areas of their sections.
    """

    vertices: Floats
    turned: bool
    nodes: int
    twins: Longs
    areas: Floats
    measures: Floats
    sections: Floats
    slopes: Floats
    shares: Floats
    volumes: Floats

    @classmethod
    def of(cls, problem: Problem, at: BoundBody) -> "StressForm":
        """Return the geometry of a problem. Not collective."""
        x, on, turned = at.vertices, at.numbers.facets, problem.tagged_mesh.axisymmetric
        tdim = x.shape[2]
        slopes, volumes = gradients(x)
        shares = np.linalg.norm(slopes, axis=2) * volumes[:, None]
        nodes = NODES if turned else tdim
        lengths = np.zeros((len(at.facets.held), 1))
        lengths[on, 0] = shares * tdim / nodes
        rings = np.ones((len(at.facets.held), nodes))
        twins, sections = at.facets.twins, volumes ** ((tdim - 1) / tdim)
        if turned:
            rings[on[..., None], at.numbers.places] = x[:, _others(tdim), 0]
            rings[:, 2] = rings[:, :2].mean(axis=1)
            rings *= 2 * math.pi
            sections = sections * 2 * math.pi * x[..., 0].mean(axis=1)
            twins = _with_middles(at.facets.twins)
        some = np.where(rings > 0, rings, rings.max(axis=1, keepdims=True))
        return cls(
            vertices=x,
            turned=turned,
            nodes=nodes,
            twins=twins,
            areas=lengths * rings,
            measures=lengths * np.where(some > 0, some, 1.0),
            sections=sections,
            slopes=slopes,
            shares=shares,
            volumes=volumes,
        )

    def pushes(self, tractions: Floats, loads: FacetLoads) -> Floats:
        """Return the Cartesian loads of the nodes of facets.

        Args:
            tractions: Tractions of the loads at their vertices, shape (num_cells, d + 1, d, d).
            loads: The loads; in axisymmetry without pore pressure.

        Returns:
            Shape (num_cells, d + 1, nodes, d).
        """
        shares = self.shares[:, :, None, None]
        if self.turned:
            radii = self.vertices[:, _others(2), 0]
            return np.asarray(on_facets(tractions, radii) * (4 * math.pi / NODES) * shares)
        around, _ = loads.pushes(self.slopes, self.volumes)
        return np.asarray(around + tractions * shares)

    def forces(self, loads: FacetLoads) -> Floats:
        """Return the loads of the cells' multipliers, shape (num_cells, inner).

        Args:
            loads: The loads; in axisymmetry without pore pressure.
        """
        if self.turned:
            return ring_forces(self.vertices, loads.forces)
        layout = cell_layout(self.vertices.shape[2])
        parts = layout.rows[:, 0, 0] - layout.outer
        _, inside = loads.pushes(self.slopes, self.volumes)
        inside = inside + loads.forces * self.volumes[:, None]
        found = np.zeros((len(inside), layout.inner))
        found[:, parts] = (inside / len(parts))[:, None]
        return found


def _others(tdim: int) -> Longs:
    """Return the vertices of the facet opposite each vertex of a cell."""
    return np.array([[b for b in range(tdim + 1) if b != a] for a in range(tdim + 1)])


def _with_middles(twins: Longs) -> Longs:
    """Return numbers of facet unknowns, renumbered for facets with a node between their ends."""
    facet, rest = np.divmod(twins, 4)
    moved = np.where(twins >= 0, facet * 2 * NODES + rest, -1)
    middle = np.where(twins[:, 0] >= 0, facet[:, 0] * 2 * NODES + 4 + rest[:, 0] % 2, -1)
    return np.concatenate([moved, middle[:, None]], axis=1)
