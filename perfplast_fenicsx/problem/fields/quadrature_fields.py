"""Evaluate strain and stress with DOLFINx Expressions, their integrals, and their energy norms.

A problem compiles all forms and Expressions once. No function loops over cells in Python.
"""

from functools import cached_property

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem, la

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import evaluate, interpolation_points
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.law_on_cells import (
    LawExpression,
    LawOnCells,
    OfLaw,
    integrate,
)
from perfplast_fenicsx.problem.assembled.spaces import Integral, assemble_force, by_cell
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase

RIGID = 1e-5
"""Fraction of √:func:`jagged_norm2`, with which the energy norm of strains is compared.

If the norm of strains is smaller, bodies move almost rigidly. Strain and stress then consist mainly
of rounding errors and cannot serve as a reference."""


def stress_norm2(problem: Problem, stress: OfLaw) -> Integral:
    """Return ‖σ‖² for a stress of each law, as an integral that is compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        s = stress(on)
        return ufl.dot(on.law.elastic.compliance(s), s)

    return Integral(problem.comm, integrate(problem.laws, square))


def strain_norm2(problem: Problem, strain: Expr) -> Integral:
    """Return ∫ Ce : e for a strain e, as an integral that is compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        return ufl.dot(on.law.elastic.hooke(strain), strain)

    return Integral(problem.comm, integrate(problem.laws, square))


def stiffness_of_nodes(problem: Problem) -> float:
    """Return the mean stiffness (force/length) of a node while all other nodes are fixed.

    Collective.

    √(stiffness · energy) estimates the norm of the nodal forces that a stress of a given energy
    exerts, before forces from different cells cancel.
    """
    return stiffness_of_all(problem) / problem.V.dofmap.index_map.size_global


def stiffness_of_all(problem: Problem) -> float:
    """Return ∫ 2μ/h²; its product with the largest |u|² bounds :func:`jagged_norm2`.

    Collective.
    """
    h2 = abs(ufl.JacobianDeterminant(problem.tagged_mesh.mesh)) ** (
        2 / problem.tagged_mesh.mesh.geometry.dim
    )
    stiffness = integrate(problem.laws, lambda on: 2 * on.law.elastic.shear / h2)
    return Integral(problem.comm, stiffness)()


def jagged_norm2(problem: Problem, u: fem.Function) -> Integral:
    """Return ∫ 2μ|u|²/h², which is about ‖u‖² if neighbouring nodes move in opposite directions.

    Collective.

    Rounding errors of ε(u) are relative to this norm, however smooth u is. The integral is compiled
    once.
    """
    mesh = problem.tagged_mesh.mesh
    h2 = abs(ufl.JacobianDeterminant(mesh)) ** (2 / mesh.geometry.dim)

    def square(on: LawOnCells) -> Expr:
        return 2 * on.law.elastic.shear * ufl.inner(u, u) / h2

    return Integral(problem.comm, integrate(problem.laws, square))


class QuadratureFields:
    """Strain and stress at the displacement u.

    Attributes:
        problem: The problem of the fields.
        u: Displacement.
        e: ε(u) − e₀ as Mandel vectors at the quadrature points, as are all strains and stresses.
        stress: Σ(e).
        force: The vector of :meth:`assemble_force`.
        bolt_forces: Collective function that returns the current force in each bolt's shank, by
            name.
        potential: Ψ(ε(u)).
        conjugate: S(σ) of the duality gap, without ⟨σ, e₀⟩; with a history, S of the current step.
        stress_norm2: ‖σ‖² in the energy norm, ∫ σ:C⁻¹σ.
        u_norm2: ‖u‖² in the energy norm, ∫ e:Ce.
    """

    def __init__(self, problem: Problem) -> None:
        """Create fields of zeros, and compile the expressions that evaluate them. Collective."""
        self.problem, laws, comm = problem, problem.laws, problem.comm
        mesh, V, S, Q = problem.tagged_mesh.mesh, problem.V, problem.S, problem.Q
        self.u = fem.Function(V, name="displacement")
        self.e, self.stress = fem.Function(S), fem.Function(S)
        e, s = self.e, self.stress

        def integral(density: OfLaw) -> Integral:
            return Integral(comm, integrate(laws, density))

        initial = problem.initial_strain
        seen = problem.kinematics.strain(self.u)
        seen = seen if initial is None else seen - initial
        self._strain = fem.Expression(seen, interpolation_points(S.element))
        self._initial = (
            None if initial is None else Integral(comm, ufl.dot(s, initial) * problem.dx)
        )
        self.bolt_forces = problem.shanks.forces(s)
        self._stress = LawExpression(laws, S, lambda on: on.law.stress(e, on.old))
        self.potential = integral(lambda on: on.law.potential(e, on.old))
        self.conjugate = integral(lambda on: on.law.conjugate(s, on.old))
        self.stress_norm2 = stress_norm2(problem, lambda on: s)
        self.u_norm2 = strain_norm2(problem, e)
        self._jagged_norm2 = jagged_norm2(problem, self.u)
        self._left = (0.0, 0.0)
        self._plastic_volume = integral(lambda on: on.law.plastic(e, on.old))
        one = fem.Constant(mesh, default_scalar_type(1))
        self._volume = Integral(comm, one * problem.dx)()
        self._at_points = fem.Function(Q)
        self._plastic = LawExpression(laws, Q, lambda on: on.law.plastic(e, on.old))
        self._overstress = LawExpression(
            laws, Q, lambda on: on.law.yields.gauge(on.law.elastic.hooke(e))
        )
        self._history = {name: self._updated(name) for name in problem.history}
        self._force_form = fem.form(problem.internal_form(s))
        self._owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
        self.force: PETSc.Vec = problem.create_vector()
        self._remembers = bool(problem.history)
        strained = self._remembers or initial is not None
        self._stiffness = stiffness_of_nodes(problem) if strained else 0.0

    @phase("return map")
    def update(self) -> None:
        """Update strain and stress from u. The ghosts of u must be up to date."""
        evaluate(self._strain, self.e, self.problem.cells)
        self._stress.interpolate(self.stress)

    def take_elastic_stress(self, before: tuple[Floats, Floats] | None = None) -> None:
        """Set the stress to Ce until the next update. Collective.

        Args:
            before: Strain e' and stress σ' from which to start if bodies have a plastic history.
                The stress is then σ' + C(e − e').
        """
        strain, stress = before or (0.0, 0.0)
        now = self.e.x.array.copy()
        self.e.x.array[:] -= strain
        hooke = LawExpression(
            self.problem.laws, self.problem.S, lambda on: on.law.elastic.hooke(self.e)
        )
        hooke.interpolate(self.stress)
        self.e.x.array[:] = now
        self.stress.x.array[:] += stress

    def updated_history(self) -> dict[str, fem.Function]:
        """Return the internal variables by name at the end of the level; {} for Hencky's laws.

        Strain and stress must be up to date. The history of the problem does not change.
        """
        after = {}
        for name, expression in self._history.items():
            after[name] = fem.Function(self.problem.history[name].function_space, name=name)
            expression.interpolate(after[name])
        return after

    def largest_overstress(self) -> float:
        """Return the largest yield ratio of the elastic stress Ce at all points. Collective."""
        self._overstress.interpolate(self._at_points)
        largest = float(self._at_points.x.array.max(initial=0))
        return self.problem.comm.allreduce(largest, MPI.MAX)

    def plastic_cells(self) -> int:
        """Return the number of cells with a plastic point. Collective."""
        self._plastic.interpolate(self._at_points)
        plastic = (by_cell(self._at_points)[: self._owned_cells] > 0).any(axis=1)
        return self.problem.comm.allreduce(int(plastic.sum()))

    def plastic_fraction(self) -> float:
        """Return the plastic fraction of the volume. Collective."""
        return self._plastic_volume() / self._volume

    def initial_work(self) -> float:
        """Return the work ⟨σ, e₀⟩ of the stress on the initial strain. Collective."""
        return 0.0 if self._initial is None else self._initial()

    def size(self) -> float:
        """Return |Ψ| + ½‖σ‖² (energy), the reference for duality gaps. Collective.

        With laws that have a history, the stress follows from a difference of two strains, so
        rounding errors of ψ + ψ* are larger. Then the reference is at least 1e-4 of the elastic
        energy of the strain.
        """
        energy = abs(self.potential()) + self.stress_norm2() / 2
        # Fraction of the elastic energy of the strain that scales gaps after plastic flow.
        share = 1e-4
        return max(energy, share * self.u_norm2() / 2) if self._remembers else energy

    def inner_force(self) -> float:
        """Return an estimate of the norm of nodal forces that no load causes. Collective.

        The estimate is 0 if stress results from loads and supports only, whose forces are known.
        """
        return (self._stiffness * self.size()) ** 0.5 if self._stiffness else 0.0

    @phase("assembly")
    def assemble_force(self) -> PETSc.Vec:
        """Return ⟨Σ(e), ε(v)⟩ as a vector, zero at supports. Collective."""
        assemble_force(self.force, self._force_form, self.problem.bcs)
        return self.force

    @phase("assembly")
    def assemble_all_forces(self) -> PETSc.Vec:
        """Return ⟨Σ(e), ε(v)⟩ as a vector, including supports, in ``force``. Collective."""
        assemble_force(self.force, self._force_form, [])
        return self.force

    def leave(self) -> None:
        """Store the reference sizes of u at the start of a level. Collective.

        The scale for rounding errors of later strains is the larger of these sizes and the sizes of
        the current u. The stored sizes matter if bodies are unloaded almost completely.
        """
        self._left = (0.0, 0.0)
        self._left = (self.jagged_norm2(), self.gross_force())

    def jagged_norm2(self) -> float:
        """Return the reference for rounding errors in ``u_norm2`` (:func:`jagged_norm2`).

        Collective.
        """
        return max(self._jagged_norm2(), self._left[0])

    def at_least(self, share: float, norm: float) -> float:
        """Return the larger of ``norm`` and a fraction ``share`` of √``jagged_norm2``. Collective.

        The function computes the integral ``jagged_norm2`` only if a bound from the largest
        displacement does not decide.
        """
        largest = float(np.abs(self.u.x.array).max(initial=0.0))
        largest = self.problem.comm.allreduce(largest, MPI.MAX)
        beyond = 4.0  # |u| between nodes may exceed the largest nodal value
        bound = max(self._stiffness_of_all * (beyond * largest) ** 2, self._left[0])
        return (
            norm if share**2 * bound <= norm**2 else max(norm, share * self.jagged_norm2() ** 0.5)
        )

    @cached_property
    def _stiffness_of_all(self) -> float:
        return stiffness_of_all(self.problem)

    def gross_force(self) -> float:
        """Return the norm (force) that scales the rounding errors of nodal forces.

        Collective.
        """
        size = float(la.norm(self.u.x))  # PETSc would return the cached norm of an earlier u
        return max(self._jagged_norm2() / size if size > 0 else 0.0, self._left[1])

    def _updated(self, name: str) -> LawExpression:
        """Return the expression that updates a history variable."""
        space, e = self.problem.history[name].function_space, self.e
        laws = [on for on in self.problem.laws if name in on.old]
        return LawExpression(laws, space, lambda on: on.law.updated(e, on.old)[name])


class Direction:
    """A direction δu at the displacement u of given fields.

    Attributes:
        du: The direction.
        de: Strain ε(δu) of the direction.
        beta: Step length β in ``slope``.
        slope: ⟨Σ(ε(u + β δu)), ε(δu)⟩, the derivative of Ψ along δu.
        change_norm2: ‖Σ(ε(u + δu)) − σ‖² in the energy norm.
        moved_stress_norm2: ‖Σ(ε(u + δu))‖².
        du_norm2: ‖δu‖² in the energy norm.
        moved_norm2: ‖u + δu‖².
    """

    def __init__(self, fields: QuadratureFields) -> None:
        """Create a zero direction, and compile the integrals. Collective."""
        problem, e, s = fields.problem, fields.e, fields.stress
        S = problem.S
        self._cells = problem.cells
        self.du, self.de = fem.Function(problem.V), fem.Function(S)
        self.beta = fem.Constant(problem.tagged_mesh.mesh, default_scalar_type(1))
        self._strain = fem.Expression(
            problem.kinematics.strain(self.du), interpolation_points(S.element)
        )
        de = self.de

        def ended(on: LawOnCells) -> Expr:
            return on.law.stress(e + de, on.old)

        def power(on: LawOnCells) -> Expr:
            return ufl.dot(on.law.stress(e + self.beta * de, on.old), de)

        self.slope = Integral(problem.comm, integrate(problem.laws, power))
        self.change_norm2 = stress_norm2(problem, lambda on: ended(on) - s)
        self.moved_stress_norm2 = stress_norm2(problem, ended)
        self.du_norm2 = strain_norm2(problem, de)
        self.moved_norm2 = strain_norm2(problem, e + de)

    @phase("return map")
    def update(self) -> None:
        """Update ε(δu) from δu. The ghosts of δu must be up to date."""
        evaluate(self._strain, self.de, self._cells)
