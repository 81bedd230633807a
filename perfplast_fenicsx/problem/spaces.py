"""Finite element spaces of one degree: displacements, and points where the law is evaluated."""

from dataclasses import dataclass

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.mandel import mandel_size

DEGREES = (1, 2)


@dataclass(frozen=True)
class Spaces:
    """V_h, S_h and the quadrature they share.

    Strains of linear elements are constant in a cell, so S_h is DG0 there. Those of quadratic
    elements are known at the points of a rule of degree 2 (3 in a triangle, 4 in a tetrahedron),
    which integrates ε(u):ε(v) exactly in straight-sided cells.

    Attributes:
        degree: 1 or 2.
        V: Continuous displacements, one vector a node.
        S: Mandel vectors (strain, stress) at the points.
        Q: Scalars at the points.
        dx: Integrates over these points.
    """

    degree: int
    V: fem.FunctionSpace
    S: fem.FunctionSpace
    Q: fem.FunctionSpace
    dx: ufl.Measure


def make_spaces(mesh: Mesh, degree: int) -> Spaces:
    """Make the spaces of a degree. Collective.

    Raises:
        InputError: If the degree is not 1 or 2.
    """
    if degree not in DEGREES or isinstance(degree, bool):
        raise InputError(f"degree = {degree!r} is not an element here; give 1 (linear) or 2.")
    gdim, cell, accuracy = mesh.geometry.dim, mesh.basix_cell(), 2 * (degree - 1)
    metadata = {"quadrature_degree": accuracy, "quadrature_scheme": "default"}
    return Spaces(
        degree,
        fem.functionspace(mesh, basix.ufl.element("P", cell, degree, shape=(gdim,))),
        point_space(mesh, degree, mandel_size(gdim)),
        point_space(mesh, degree, 1),
        ufl.Measure("dx", domain=mesh, metadata=metadata),
    )


def point_space(mesh: Mesh, degree: int, size: int) -> fem.FunctionSpace:
    """Vectors of a size, numbers if it is 1, at the points of elements of a degree. Collective.

    Args:
        mesh: The mesh.
        degree: 1 or 2, that of the displacements.
        size: Numbers at each point.
    """
    cell, shape = mesh.basix_cell(), (size,) if size > 1 else ()
    if degree == 1:
        element = basix.ufl.element("DG", cell, 0, shape=shape or None)
    else:
        element = basix.ufl.quadrature_element(
            cell.name, value_shape=shape, degree=2 * (degree - 1)
        )
    return fem.functionspace(mesh, element)


def by_cell(function: fem.Function) -> npt.NDArray[np.float64]:
    """Values of a function of Q by local cell and point, shape (num_cells, points_per_cell)."""
    return function.x.array[function.function_space.dofmap.list]
