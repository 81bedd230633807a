"""Strains at the quadrature points as whole vectors, their forces, and a stiffness of any moduli.

Unlike in limit analysis the stress out of the plane counts in plane strain, so that stresses are
Mandel vectors (:mod:`mandel`), and moduli matrices of these.
"""

from petsc4py import PETSc

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import evaluate, interpolation_points
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, SprungMatrix
from perfplast_fenicsx.limit_analysis.discrete.point_strains import weights_of_points
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT


class Strains:
    """ε(u) at the points of a problem."""

    def __init__(self, problem: Problem) -> None:
        """Compile the expression. Collective."""
        self._u, self._e = fem.Function(problem.V), fem.Function(problem.S)
        self._cells, self._count = problem.cells, problem.Q.dofmap.index_map.size_local
        points = interpolation_points(problem.S.element)
        self._strain = fem.Expression(problem.kinematics.strain(self._u), points)

    def __call__(self, u: fem.Function) -> Floats:
        """Mandel vectors, shape (count, m). Collective.

        Args:
            u: Its ghosts up to date.
        """
        self._u.x.array[:] = u.x.array
        evaluate(self._strain, self._e, self._cells)
        size = self._e.function_space.dofmap.index_map_bs
        return self._e.x.array[: self._count * size].reshape(-1, size).copy()


class PointOperator(SprungMatrix):
    """B of ε = B y, its transpose, and K = ∫ BᵀCB with matrices C at the points.

    Attributes:
        count: Points of this rank.
        size: Components m.
        weights: Volume that a point stands for, shape (count,).
        force_unit: Largest force that a stress of size 1 at all points may have, about.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the forms. Collective."""
        self._problem, self._basis = problem, problem.basis.T
        self.count = problem.Q.dofmap.index_map.size_local
        self.size = problem.S.dofmap.index_map_bs
        self._u, self._stress = fem.Function(problem.V), fem.Function(problem.S)
        self._strains, strain = Strains(problem), problem.kinematics.strain
        self._force_form = fem.form(problem.internal_form(self._stress))
        self._force = problem.create_vector()
        self.weights = weights_of_points(problem)
        self._moduli = fem.Function(_tensors_at_points(problem, self.size))
        e, d = (strain(f(problem.V)) for f in (ufl.TrialFunction, ufl.TestFunction))
        self._form = fem.form(ufl.dot(ufl.dot(self._moduli, e), d) * problem.dx)
        self._stiffness = create_stiffness(problem)
        self._operator = ContactOperator(problem, self._stiffness)
        super().__init__(problem.comm, self._operator.matrix, NONE, DIRECT)

        ones, unit = self.create_vector(), np.ones((self.count, self.size))
        self.forces(unit, ones)
        self.force_unit = float(ones.norm(PETSc.NormType.NORM_INFINITY))
        ones.destroy()

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of the basis, zero. Collective."""
        return self._problem.create_vector()

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        super().destroy()
        for thing in (self._stiffness, self._force):
            thing.destroy()

    def strains(self, y: PETSc.Vec) -> Floats:
        """B y, shape (count, m). Collective."""
        self.displace(y, self._u)
        return self._strains(self._u)

    def displace(self, y: PETSc.Vec, u: fem.Function) -> None:
        """Set u to the displacement of y. Collective."""
        self._basis.mult(y, u.x.petsc_vec)
        u.x.scatter_forward()

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ σ:ε(v) for all v. Collective.

        Args:
            stress: Shape (count, m).
            out: A vector of the basis.
        """
        self._stress.x.array[: self.count * self.size] = stress.ravel()
        assemble_force(self._force, self._force_form, self._problem.bcs)
        self._basis.multTranspose(self._force, out)

    def reduced(self, force: PETSc.Vec, out: PETSc.Vec) -> None:
        """Set ``out`` to a load of V's dual in the basis. Collective."""
        self._basis.multTranspose(force, out)

    @phase("assembly")
    def assemble(self, moduli: Floats) -> None:
        """Bring K to moduli, shape (count, m, m), and factorise it. Collective.

        Raises:
            SingularStiffness: If that fails.
        """
        self._moduli.x.array[: moduli.size] = moduli.ravel()
        self._stiffness.zeroEntries()
        fem_petsc.assemble_matrix(self._stiffness, self._form, self._problem.bcs)  # type: ignore[arg-type]
        self._stiffness.assemble()
        self._problem.free.hold(self._stiffness)
        self._operator.hold(NONE)
        self.factorise()


def _tensors_at_points(problem: Problem, n: int) -> fem.FunctionSpace:
    """Return matrices at the points of a problem, shape (n, n). Collective."""
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
