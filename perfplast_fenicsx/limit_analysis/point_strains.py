"""Strain rates of velocities at the quadrature points as arrays, and the forces of stresses there.

Mandel vectors are split into trace and deviator. In plane strain the deviator is that in the plane:
the stress out of it is in no equation, and its best value is the mean of those in the plane, so
that ‖dev σ‖ is the norm of the deviator in the plane.
"""

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import Law
from perfplast_fenicsx.materials.mandel import Expr, trace
from perfplast_fenicsx.materials.von_mises import VonMisesSet
from perfplast_fenicsx.materials.yield_set import NeverYields
from perfplast_fenicsx.problem.integrals import assemble_force
from perfplast_fenicsx.problem.law_on_cells import LawExpression
from perfplast_fenicsx.problem.problem import Problem


class PointStrains:
    """ε(v) of velocities in the contact basis; see :class:`conic_program.Strains`."""

    def __init__(self, problem: Problem) -> None:
        """Compile what evaluates them. Collective."""
        self._problem, self.gdim = problem, trace_dim(problem)
        self._u, self._e = fem.Function(problem.V), fem.Function(problem.S)
        self._stress = fem.Function(problem.S)
        points = interpolation_points(problem.S.element)
        self._strain = fem.Expression(problem.kinematics.strain(self._u), points)
        self._force_form = fem.form(problem.internal_form(self._stress))
        self._force = problem.create_vector()
        self.count = problem.Q.dofmap.index_map.size_local
        self.size = problem.S.dofmap.index_map_bs
        self.weights = self._weights()
        self.radii = yield_radii(problem)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._force.destroy()

    def _weights(self) -> Floats:
        form = fem.form(ufl.TestFunction(self._problem.Q) * self._problem.dx)
        vector = fem_petsc.assemble_vector(form)
        weights: Floats = vector.array_r[: self.count].copy()
        vector.destroy()
        return weights

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of ε(Ty). Collective.

        Returns:
            Shapes (count,) and (count, m).
        """
        self._problem.basis.T.mult(y, self._u.x.petsc_vec)
        self._u.x.scatter_forward()
        return self._split()

    def of_function(self, v: fem.Function) -> tuple[Floats, Floats]:
        """The same of ε(v) for a function whose ghosts are up to date. Collective."""
        self._u.x.array[:] = v.x.array
        return self._split()

    def _split(self) -> tuple[Floats, Floats]:
        self._e.interpolate(self._strain, self._problem.cells)
        e = self._e.x.array[: self.count * self.size].reshape(-1, self.size).copy()
        sums = e[:, :3].sum(axis=1)
        e[:, : self.gdim] -= sums[:, None] / self.gdim
        return sums, e

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) for all v of the contact basis. Collective."""
        array = self._stress.x.array[: self.count * self.size].reshape(-1, self.size)
        array[:] = deviator
        array[:, :3] += pressure[:, None]
        assemble_force(self._force, self._force_form, self._problem.bcs)
        self._problem.basis.T.multTranspose(self._force, out)


def trace_dim(problem: Problem) -> int:
    """How many normal stresses are in equations of equilibrium: all but that out of the plane."""
    return 3 if problem.kinematics.whole else 2


def deviator_in_plane(e: Expr, gdim: int) -> Expr:
    """The deviator of a strain rate, of its part in the plane in plane strain; UFL."""
    mean = trace(e) / gdim
    return ufl.as_vector([e[i] - mean if i < gdim else e[i] for i in range(len(e))])


def weakness(law: Law) -> Expr | None:
    """1/γ (1/stress) of the yield set ‖dev σ‖ ≤ γ, 0 for bodies that never yield; else None.

    The interior point method for limit loads knows these sets alone.
    """
    if law.carries_any_load:
        return None
    yields = law.yields
    if type(yields) is VonMisesSet:  # what derives from it may be another set
        return 1 / yields.radius
    return ufl.as_ufl(0) if type(yields) is NeverYields else None


def yield_radii(problem: Problem) -> Floats:
    """γ (stress) at the points of this rank, ∞ in elastic bodies, shape (count,). Collective.

    Raises:
        InputError: If a body's yield set is none that the method knows (:func:`weakness`).
    """
    for on in problem.laws:
        if weakness(on.law) is None:
            raise InputError(
                f"the interior point method knows no yield set of {type(on.law).__name__}; use"
                " von Mises or elastic bodies with it, or load by work (limit_load)."
            )
    inverse = fem.Function(problem.Q)
    LawExpression(problem.laws, problem.Q, lambda on: weakness(on.law)).interpolate(inverse)
    values = inverse.x.array[: problem.Q.dofmap.index_map.size_local]
    radii = np.full(len(values), np.inf)
    np.divide(1.0, values, out=radii, where=values > 0)
    return radii


def radii_of_cells(problem: Problem) -> Floats:
    """γ of each cell that this rank owns, the least of its points. Collective."""
    topology = problem.tagged_mesh.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    radii: Floats = yield_radii(problem)[problem.Q.dofmap.list[:owned]].min(axis=1)
    return radii
