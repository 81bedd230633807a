"""The stiffness with moduli given at each point, factorised in the contact basis."""

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, Moduli
from perfplast_fenicsx.limit_analysis.conic.sprung_matrix import SprungMatrix
from perfplast_fenicsx.limit_analysis.discrete.point_coordinates import PointCoordinates
from perfplast_fenicsx.limit_analysis.discrete.point_strains import deviator_in_plane
from perfplast_fenicsx.materials.mandel import trace
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT


class ConicStiffness(SprungMatrix):
    """K of displacements in the contact basis; see :class:`discretisation.Stiffness`."""

    def __init__(self, problem: Problem) -> None:
        """Compile the form, and find the pattern. Collective."""
        self._problem = problem
        Q, S, strain = problem.Q, problem.S, problem.kinematics.strain
        self._at = at = PointCoordinates(problem)
        trial, test = (strain(f(problem.V)) for f in (ufl.TrialFunction, ufl.TestFunction))
        if at.isotropic:
            self._bulk, self._a, self._normal = fem.Function(Q), fem.Function(Q), fem.Function(S)
            self._along = fem.Function(S)
            e, d = (deviator_in_plane(rate, at.normal) for rate in (trial, test))
            N, volume, as_much = self._normal, trace(trial), trace(test)
            if at.dilates:
                volume -= ufl.dot(self._along, e)
                as_much -= ufl.dot(self._along, d)
            density = self._bulk * volume * as_much + self._a * ufl.dot(e, d)
            density -= ufl.dot(N, e) * ufl.dot(N, d)
        else:
            self._moduli = fem.Function(tensors_at_points(problem, len(at.among)))
            e, d = (ufl.as_vector([rate[i] for i in at.among]) for rate in (trial, test))
            density = ufl.dot(ufl.dot(self._moduli, e), d)
        self._form = fem.form(density * problem.dx)
        self._stiffness = create_stiffness(problem)
        self._operator = ContactOperator(problem, self._stiffness)
        super().__init__(problem.comm, self._operator.matrix, problem.basis.index, DIRECT)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        super().destroy()
        self._stiffness.destroy()

    @phase("assembly")
    def assemble(self, moduli: Moduli, held: npt.NDArray[np.int32] = NONE) -> None:
        """Bring K to moduli at the points of this rank. Collective.

        Args:
            moduli: At the points.
            held: Local (owned) unknowns that stay zero.
        """
        if self._at.isotropic:
            given = [(self._bulk, moduli.bulk), (self._a, moduli.a), (self._normal, moduli.normal)]
            if moduli.along is not None:
                given.append((self._along, moduli.along))
        else:
            given = [(self._moduli, self._at.frames.moduli(moduli.matrices()))]
        for function, values in given:
            function.x.array[: values.size] = values.ravel()
        self._stiffness.zeroEntries()
        fem_petsc.assemble_matrix(self._stiffness, self._form, self._problem.bcs)  # type: ignore[arg-type]
        self._stiffness.assemble()
        self._problem.free.hold(self._stiffness)
        self._operator.hold(held)

    def add_springs(self, springs: tuple[Ints, Floats]) -> None:
        """Let K have springs at a few unknowns, from the next assembly on.

        Args:
            springs: See :meth:`ContactOperator.add_springs`.
        """
        self._operator.add_springs(springs)


def tensors_at_points(problem: Problem, n: int) -> fem.FunctionSpace:
    """Matrices at the points of a problem, shape (n, n). Collective."""
    mesh, points = problem.tagged_mesh.mesh, interpolation_points(problem.S.element)
    cell = mesh.basix_cell()
    if problem.degree == 1:
        element = basix.ufl.element("DG", cell, 0, shape=(n, n))
    else:
        weights = np.full(len(points), basix.cell.volume(cell) / len(points))
        element = basix.ufl.quadrature_element(
            cell, value_shape=(n, n), points=points, weights=weights
        )
    return fem.functionspace(mesh, element)
