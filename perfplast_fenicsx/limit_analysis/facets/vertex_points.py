"""A problem whose laws hold at the vertices of cells, as strict bounds of dilating bodies want it.

Strain rates of a quadratic velocity are linear in a straight cell, and those that a yield set
admits are a convex cone: what is admissible at the vertices is so everywhere. Where a body grows,
tr ε ≥ α‖dev ε‖, it dissipates (γ/α) tr ε, which the mean of the vertices integrates exactly.
"""

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def with_points_at_vertices(problem: Problem) -> Problem:
    """Return the same problem with the vertices of each cell as its points. Collective.

    It shares all with the given one but spaces and laws at the points.

    Args:
        problem: Quadratic, on straight cells of the plane or space, of laws without a history.
    """
    mesh = problem.tagged_mesh.mesh
    cell, gdim = mesh.basix_cell(), mesh.geometry.dim
    places: Floats = np.asarray(basix.geometry(cell), dtype=np.float64)
    shares = np.full(len(places), basix.cell.volume(cell) / len(places))

    def space(shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            cell, value_shape=shape, points=places, weights=shares
        )
        return fem.functionspace(mesh, element)

    metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    return variant(problem, points=spaces)
