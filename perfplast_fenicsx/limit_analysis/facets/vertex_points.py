"""A problem whose laws hold at the vertices of cells, as strict bounds of dilating bodies want it.

Strain rates of a quadratic velocity are linear in a straight cell, and those that a yield set
admits are a convex cone: what is admissible at the vertices is so everywhere. Where a body grows,
tr ε ≥ α‖dev ε‖, it dissipates (γ/α) tr ε, which the mean of the vertices integrates exactly.

Around an axis r²ε is quadratic. There the points are at vertices and edges, one for each of its
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
    """Return the same problem with the vertices of each cell as its points. Collective.

    Around an axis the middles of edges are points, too.

    It shares all with the given one but spaces and laws at the points.

    Args:
        problem: Quadratic, on straight cells of the plane or space, or around an axis in v = ru
            (:mod:`ring_flux`), of laws without a history.
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

    # not a rule for coefficients, of which no form is assembled
    metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    return variant(problem, points=spaces)
