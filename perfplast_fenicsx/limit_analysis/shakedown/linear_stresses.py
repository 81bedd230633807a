"""Points for stresses that are linear in each cell and known at its vertices.

What is within yield at the vertices of a straight cell is so in all of it, up to the surface of the
bodies, where elastic stresses are largest. With shape functions λ_v and linear strain rates

    ∫ σ:ε = Σ_v |T|/(d + 1) σ_v:ε(x_v),    x_v = (2 x_v + Σ other vertices)/(d + 2),

exactly: the work of the stress at a vertex is that on the strain at a point between it and the
middle of the cell.
"""

from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.facets.vertex_points import with_points_at_vertices
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


@dataclass(frozen=True, eq=False)
class StressPoints:
    """A problem at the points where stresses are known, and at those where they do work.

    Attributes:
        known: Its points are those of the stresses.
        working: Its points are those of the strains that these do work on, in the same order.
        linear: Whether the former are the vertices of cells; else both are those of the quadrature.
    """

    known: Problem
    working: Problem
    linear: bool


def stress_points(problem: Problem) -> StressPoints:
    """Return the points of a problem. Collective.

    They are those of the quadrature where strains are not linear in a cell: of linear elements,
    around an axis and in curved cells.
    """
    mesh = problem.tagged_mesh.mesh
    linear = problem.degree == 2 and not problem.tagged_mesh.axisymmetric
    if not linear or has_curved_cells(mesh):
        return StressPoints(problem, problem, False)
    cell, gdim = mesh.basix_cell(), mesh.geometry.dim
    vertices: Floats = np.asarray(basix.geometry(cell), dtype=np.float64)
    places = (vertices + vertices.sum(axis=0)) / (gdim + 2)
    shares = np.full(len(places), basix.cell.volume(cell) / len(places))

    def space(shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            cell, value_shape=shape, points=places, weights=shares
        )
        return fem.functionspace(mesh, element)

    metadata = {
        "quadrature_rule": "custom",
        "quadrature_points": tuple(map(tuple, places)),
        "quadrature_weights": tuple(shares),
    }
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    working = variant(problem, points=spaces)
    return StressPoints(with_points_at_vertices(problem), working, True)
