"""Strain rates of velocities at the quadrature points as arrays, and the forces of stresses there.

Mandel vectors are split into trace and deviator. In plane strain the deviator is that in the plane:
the stress out of it is in no equation, and takes its best value (:func:`yield_cones`); with von
Mises that is the mean of those in the plane, so that ‖dev σ‖ is the norm of the deviator there.
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
from perfplast_fenicsx.materials.yield_set import AxialCone
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells
from perfplast_fenicsx.problem.problem import Problem


class PointStrains:
    """ε(v) of velocities in the contact basis; see :class:`discretisation.Strains`."""

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
        self.radii, self.slopes = yield_cones(problem)

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


def axial_cone_of(law: Law) -> tuple[Expr, Expr] | None:
    """1/γ and α/γ (1/stress) of ‖dev σ‖ ≤ γ − αp in space; None for any other yield set.

    Both are 0 for bodies that never yield.
    """
    cones = None if law.carries_any_load else law.yields.cones(6)
    if cones is None:
        return None
    if len(cones) == 0:
        return ufl.as_ufl(0), ufl.as_ufl(0)
    (cone, *more) = cones
    if more or not isinstance(cone, AxialCone):
        return None
    return 1 / cone.bound, cone.alpha / cone.bound


def yield_cones(problem: Problem) -> tuple[Floats, Floats]:
    """γ (stress) and α of ‖dev σ‖ ≤ γ − αp at the points of this rank. Collective.

    In plane strain these are of the stress in the plane: with the stress p − (α/2)‖dev σ‖ out of
    it, which leaves the most room, both are divided by √(1 − α²/6), α being that in space. A cone
    with α ≥ √6 has room for any stress in the plane.

    Returns:
        γ, ∞ in elastic bodies, and α, 0 where the mean stress plays no part; shapes (count,).

    Raises:
        InputError: If a body's yield set is none that the method knows (:func:`axial_cone_of`).
    """
    for on in problem.laws:
        if axial_cone_of(on.law) is None:
            raise InputError(
                f"the interior point method knows no yield set of {type(on.law).__name__}; give"
                " limit_method = 'path', or bodies of von Mises, Drucker and Prager, or elastic"
                " ones."
            )

    def at_points(which: int) -> Floats:
        def of(on: LawOnCells) -> Expr:
            cone = axial_cone_of(on.law)
            assert cone is not None
            return cone[which]

        values = fem.Function(problem.Q)
        LawExpression(problem.laws, problem.Q, of).interpolate(values)
        found: Floats = values.x.array[: problem.Q.dofmap.index_map.size_local].copy()
        return found

    weakness = at_points(0)
    radii = np.full(len(weakness), np.inf)
    np.divide(1.0, weakness, out=radii, where=weakness > 0)
    if not any(on.law.dilates for on in problem.laws):
        return radii, np.zeros_like(radii)
    slopes = at_points(1)
    np.divide(slopes, weakness, out=slopes, where=weakness > 0)
    if trace_dim(problem) == 2:
        room = 1 - slopes**2 / 6
        radii[room <= 0], slopes[room <= 0] = np.inf, 0.0
        size = np.sqrt(np.where(room > 0, room, 1.0))
        radii, slopes = radii / size, slopes / size
    return radii, slopes


def cones_of_cells(problem: Problem) -> tuple[Floats, Floats]:
    """γ and α of each cell that this rank owns, as of :func:`yield_cones`. Collective.

    They are of one point of each, as bodies are of one material.
    """
    topology = problem.tagged_mesh.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    first = problem.Q.dofmap.list[:owned, 0]
    radii, slopes = yield_cones(problem)
    return radii[first], slopes[first]
