"""Evaluate laws at the vertices of cells, for strict bounds of bodies that dilate.

Strain rates of a quadratic velocity are linear in a straight cell, and the admissible rates of a
yield set are a convex cone. So rates that are admissible at the vertices are admissible everywhere.
Where a body dilates, tr ε ≥ α‖dev ε‖, it dissipates (γ/α) tr ε, which the mean of the vertices
integrates exactly.

In axisymmetry r²ε is quadratic. There the points are at vertices and edges, one for each of its
Bernstein coefficients (:mod:`~perfplast_fenicsx.limit_analysis.discrete.ring_strains`).
"""

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import EDGES
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def with_points_at_vertices(problem: Problem) -> Problem:
    """Return the problem with the vertices of each cell as its points. Collective.

    In axisymmetry the midpoints of edges are points, too. The new problem shares everything but the
    spaces and laws at the points with the given one.

    Args:
        problem: Problem with quadratic elements on straight cells, in the plane, in space, or in
            axisymmetry for v = ru (:mod:`ring_flux`), and laws without a history.
    """
    mesh = problem.tagged_mesh.mesh
    cell, gdim = mesh.basix_cell(), mesh.geometry.dim
    places: Floats = np.asarray(basix.geometry(cell), dtype=np.float64)
    if isinstance(problem.kinematics, RingFlux):
        places = np.concatenate([places, places[np.array(EDGES)].mean(axis=1)])
    shares = np.full(len(places), basix.cell.volume(cell) / len(places))

    def space(shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            cell, value_shape=shape, points=places, weights=shares
        )
        return fem.functionspace(mesh, element)

    # not a rule for Bernstein coefficients; no form is assembled with them
    metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    return variant(problem, points=spaces)
