"""The slow flow of bodies as viscous as one says, under their loads.

v minimises ½∫ η‖ε(v)‖² − L₀(v) over the velocities with L₁(v) = 1 that enter no other body and of
which the laws admit ε(v), by the method of multipliers.
"""

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.limit_analysis.path.flow_system import (
    FactorisedFlow,
    FlowSystem,
    IteratedFlow,
    NoFlow,
)
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.integrals import Integral, assemble_force
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells, integrate
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator

MOST_ITERATIONS = 30
"""Iterations of the multipliers of what is inadmissible, at most."""


class ViscousFlow:
    """Flows of the bodies of a problem whose laws tell linearly what is admissible.

    Attributes:
        velocity: v, with L₁(v) = 1 after a solve.
        viscosity: η > 0 at the points, to be set before one.
        drag: The same of friction, force over rate of slip, shape (num_places,).
        factorisations: So far.
        solves: Linear systems solved so far.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the forms. Collective."""
        self._problem, laws = problem, problem.laws
        self.factorisations = self.solves = 0
        self.velocity = v = fem.Function(problem.V, name="mechanism")
        self.viscosity = eta = fem.Function(problem.Q)
        self.drag: Floats = np.zeros(len(problem.friction.bound))
        strain = problem.kinematics.strain
        rate = strain(v)
        trial, test = (strain(f(problem.V)) for f in (ufl.TrialFunction, ufl.TestFunction))
        multipliers = {
            on: fem.Function(problem.space_at_points(on.law.yields.inadmissible(rate).ufl_shape))
            for on in laws
        }

        self._system: FlowSystem = FactorisedFlow(problem)
        self._penalty = penalty = fem.Constant(problem.V.mesh, np.float64(self._system.penalty))

        def risen(on: LawOnCells) -> Expr:
            return multipliers[on] + penalty * eta * on.law.yields.inadmissible(rate)

        def density(on: LawOnCells) -> Expr:
            lost = (on.law.yields.inadmissible(e) for e in (trial, test))
            return eta * (on.law.yields.resistance(trial, test) + penalty * ufl.dot(*lost))

        self._multipliers = [
            (multiplier, LawExpression([on], multiplier.function_space, risen))
            for on, multiplier in multipliers.items()
        ]
        self._operator_form = fem.form(integrate(laws, density))
        self._force_form = fem.form(
            integrate(laws, lambda on: -ufl.dot(multipliers[on], on.law.yields.inadmissible(test)))
        )
        lost = integrate(laws, lambda on: ufl.dot(*[on.law.yields.inadmissible(rate)] * 2))
        self._lost = Integral(problem.comm, lost)
        self._square = Integral(problem.comm, integrate(laws, lambda on: ufl.dot(rate, rate)))
        self._stiffness = create_stiffness(problem)
        self._operator = ContactOperator(problem, self._stiffness)
        self._force = problem.create_vector()
        self._b, self._y = problem.create_vector(), problem.create_vector()
        self._live, self._rest = problem.create_vector(), problem.create_vector()
        self._work = 1.0  # L₁ of the flow under L₁
        self._closed: Ints = np.zeros(0, dtype=np.int32)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        vectors = (self._force, self._b, self._y, self._live, self._rest)
        self._system.destroy()
        for part in (self._operator.matrix, self._stiffness, *vectors):
            part.destroy()

    def solve(self, held: PairFlags) -> None:
        """Find the flow with these pairs closed, which is nearly admissible. Collective.

        Args:
            held: Shape (num_pairs,).

        Raises:
            NoFlow: If there is none.
        """
        problem = self._problem
        self._closed = np.concatenate([problem.basis.index[held], problem.basis.tied])
        self._set_up(problem.basis.index[held])
        for multiplier, _ in self._multipliers:
            multiplier.x.array[:] = 0
        problem.loads.live.copy(self._force)
        self._live.array[self._closed] = 0
        self._solve(self._force, self._live)
        problem.basis.T.mult(self._live, self.velocity.x.petsc_vec)
        self._work = problem.loads.alpha(self.velocity.x.petsc_vec)
        largest = float(self._live.norm(PETSc.NormType.NORM_INFINITY))
        if not self._work > ROUNDING * problem.loads.live.norm() * largest:
            raise NoFlow("the loads do no work on the flow")
        self._rest.set(0)
        if problem.loads.has_dead():
            problem.loads.dead.copy(self._force)
            self._solve(self._force, self._rest)
        self._combine()

    def slips(self) -> Floats:
        """Rates of slip of the velocity, shape (num_places, gdim − 1). Collective."""
        self._problem.basis.M.mult(self.velocity.x.petsc_vec, self._y)
        return self._problem.friction.jumps(self._y)

    def make_admissible(self) -> None:
        """Do away with what is inadmissible in the last flow, but for rounding. Collective.

        Raises:
            NoFlow: If nothing is left of it.
        """
        left, slowed = self._inadmissible(), np.inf
        first, patience = left, 10  # where so many iterations do little, no more are tried
        for count in range(MOST_ITERATIONS):
            if left <= self._system.exact:
                break
            self._ascend(1.0)
            before, left = left, self._inadmissible()
            if count >= patience and left > first / 10:
                raise NoFlow("the flow hardly becomes admissible")
            if left < before / 2 or not self._system.tells:
                continue
            if not left < min(before, slowed / 2):
                raise NoFlow("no velocity is admissible: nothing can flow, or the elements lock")
            slowed = left
            self._ascend(1 / (1 - left / before))  # all such steps to come at once
            left = self._inadmissible()
        else:
            raise NoFlow("the flow does not become admissible")

    def _ascend(self, stretch: float) -> None:
        """Let the multipliers rise by so many times what is inadmissible, and flow. Collective."""
        problem = self._problem
        for multiplier, ascent in self._multipliers:
            here = multiplier.x.array.copy()
            ascent.interpolate(multiplier)
            multiplier.x.array[:] = here + stretch * (multiplier.x.array - here)
        assemble_force(self._force, self._force_form, problem.bcs)
        self._force.axpy(1.0, problem.loads.dead)
        self._solve(self._force, self._rest)
        self._combine()

    def dead_work(self) -> float:
        """L₀(v). Collective."""
        return float(self._problem.loads.dead.dot(self.velocity.x.petsc_vec))

    def _solve(self, force: PETSc.Vec, y: PETSc.Vec) -> None:
        """The flow in the contact basis under nodal forces."""
        self._problem.basis.T.multTranspose(force, self._b)
        self._b.array[self._closed] = 0
        self._system.solve(self._b, y)
        self.solves += 1

    def _combine(self) -> None:
        """V of the flow under the rest of the forces and as much of L₁ as makes L₁(v) = 1."""
        problem, v = self._problem, self.velocity
        problem.basis.T.mult(self._rest, v.x.petsc_vec)
        share = (1 - problem.loads.alpha(v.x.petsc_vec)) / self._work
        self._y.waxpy(share, self._live, self._rest)
        problem.basis.T.mult(self._y, v.x.petsc_vec)
        v.x.scatter_forward()

    def _inadmissible(self) -> float:
        """Relative to ‖ε(v)‖."""
        return float(np.sqrt(self._lost() / (self._square() or 1.0)))

    def jumps(self) -> Floats:
        """Of the last flow at the pairs hosted here, relative to its largest velocity. Collective.

        Returns:
            Shape (num_pairs,), positive where a pair closes.
        """
        largest = float(self._y.norm(PETSc.NormType.NORM_INFINITY))
        return self._y.array_r[self._problem.basis.index] / (largest or 1.0)

    def _set_up(self, closed: Ints) -> None:
        """Take the viscosity and these closed pairs, in the way that suits."""
        self._assemble(closed)
        try:
            if self.factorisations or self._system.suits(self._operator.matrix):
                self._take(closed)
                return
        except NoFlow:
            if not self._system.large:
                raise
        self._system.destroy()
        self._system = IteratedFlow(self._problem)
        self._penalty.value = self._system.penalty
        self._assemble(closed)
        self._take(closed)

    def _take(self, closed: Ints) -> None:
        self._problem.basis.M.mult(self.velocity.x.petsc_vec, self._y)
        self._system.set_up(self._operator, closed, self._y)
        self.factorisations += 1

    def _assemble(self, closed: Ints) -> None:
        self._stiffness.zeroEntries()
        fem_petsc.assemble_matrix(self._stiffness, self._operator_form, self._problem.bcs)  # type: ignore[arg-type]
        self._stiffness.assemble()
        self._problem.free.hold(self._stiffness)
        friction = self._problem.friction
        each = self.drag[:, None, None] * np.eye(friction.index.shape[1])
        self._operator.add_springs((friction.index, each) if friction.count else None)
        self._operator.hold(closed)
