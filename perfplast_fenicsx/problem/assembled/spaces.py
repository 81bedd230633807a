"""Create finite element spaces of a given degree, and forms that are compiled once."""

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.mesh.kinematics import Kinematics


@dataclass(frozen=True)
class Spaces:
    """The spaces V_h of displacements and S_h of stresses, with their common quadrature rule.

    Strains of linear elements are constant in a cell, so S_h is DG0 for them. Strains of quadratic
    elements are evaluated at the points of a rule of degree 2 (3 points in a triangle, 4 in a
    tetrahedron). This rule integrates ε(u):ε(v) exactly in straight-sided cells. In axisymmetry
    both statements hold only approximately. All integrals of the method use these points, so the
    dual certificate holds for quadratic elements as for linear elements. Plane strain has four
    Mandel components, because the out-of-plane stress is one of them.

    Attributes:
        degree: Degree of the displacements, 1 or 2.
        V: Continuous displacements, one vector per node.
        S: Mandel vectors (strain, stress) at the points.
        Q: Scalars at the points.
        dx: Measure with this quadrature rule; in axisymmetry it includes the full turn.
    """

    degree: int
    V: fem.FunctionSpace
    S: fem.FunctionSpace
    Q: fem.FunctionSpace
    dx: Any


def make_spaces(mesh: Mesh, degree: int, kinematics: Kinematics | None = None) -> Spaces:
    """Return the spaces; without kinematics ``dx`` is the plain measure of the mesh. Collective.

    Raises:
        InputError: If the degree is not 1 or 2.
    """
    degrees = (1, 2)
    if degree not in degrees or isinstance(degree, bool):
        raise InputError(f"degree = {degree!r} is not supported; give 1 (linear) or 2 (quadratic).")
    gdim, cell = mesh.geometry.dim, mesh.basix_cell()
    metadata = {"quadrature_degree": _accuracy(degree), "quadrature_scheme": "default"}
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    return Spaces(
        degree,
        fem.functionspace(mesh, basix.ufl.element("P", cell, degree, shape=(gdim,))),
        space_at_points(mesh, degree, (mandel_size(gdim),)),
        space_at_points(mesh, degree, ()),
        kinematics.measure(dx) if kinematics else dx,
    )


def space_at_points(mesh: Mesh, degree: int, shape: tuple[int, ...]) -> fem.FunctionSpace:
    """Return the space of values of ``shape`` at the points of ``degree``'s rule. Collective."""
    cell = mesh.basix_cell()
    if degree == 1:
        element = basix.ufl.element("DG", cell, 0, shape=shape or None)
    else:
        accuracy = _accuracy(degree)
        element = basix.ufl.quadrature_element(cell.name, value_shape=shape, degree=accuracy)
    return fem.functionspace(mesh, element)


def _accuracy(degree: int) -> int:
    """Return the degree of a quadrature rule that integrates products of strains exactly."""
    return 2 * (degree - 1)


def coordinates_of_points(space: fem.FunctionSpace) -> Floats:
    """Return the coordinates of the points of S or Q, shape (num_points, gdim). Collective."""
    mesh, places = space.mesh, interpolation_points(space.element)
    gdim, num_cells = mesh.geometry.dim, len(space.dofmap.list)
    coordinates = fem.Expression(ufl.SpatialCoordinate(mesh), places)
    values = coordinates.eval(mesh, np.arange(num_cells, dtype=np.int32))
    x = np.zeros((space.dofmap.list.max(initial=-1) + 1, gdim))
    x[space.dofmap.list.ravel()] = np.asarray(values).reshape(-1, gdim)
    return x


def by_cell(function: fem.Function) -> Floats:
    """Return the values of a function in Q by local cell and point, shape (num_cells, points)."""
    return function.x.array[function.function_space.dofmap.list]


class Integral:
    """A scalar form that is compiled once; each call sums its value over the ranks."""

    def __init__(self, comm: MPI.Intracomm, form: ufl.Form) -> None:
        self._comm = comm
        self._form = fem.form(form)

    def __call__(self) -> float:
        """Return the integral of the current values. Collective."""
        return float(self._comm.allreduce(fem.assemble_scalar(self._form)))


def assemble_force(vector: PETSc.Vec, form: fem.Form, bcs: list[fem.DirichletBC]) -> None:
    """Assemble a linear form into a vector, with ghosts summed and zero at supports. Collective."""
    with vector.localForm() as local:
        local.set(0)
    fem_petsc.assemble_vector(vector, form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    fem_petsc.set_bc(vector, bcs)
