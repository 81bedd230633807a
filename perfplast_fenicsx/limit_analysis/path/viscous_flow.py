"""Compute the slow flow of viscous bodies under loads.

The velocity v minimises ½∫ η‖ε(v)‖² − L₀(v) over all velocities with L₁(v) = 1 and without
penetration. A penalty makes ε(v) nearly admissible for the laws. The method of conjugate residuals
removes the inadmissible part that remains, by further flows under stresses that are proportional to
this part. These flows do not need exact solutions. The method also removes parts whose pressures an
element can hardly resolve.

A few solves are sufficient. With reusable factors, a large penalty and few solves are fastest. With
conjugate gradients, a smaller penalty is better, because each solve takes longer with a larger
penalty.
"""

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.machine_memory import spare_memory
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells, integrate
from perfplast_fenicsx.problem.assembled.spaces import Integral, assemble_force
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.conjugate_residuals import ConjugateResiduals
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT, price
from perfplast_fenicsx.solvers.linear.multigrid import Multigrid
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import BOUND, own_prefix

LARGE = 60_000
"""Smallest number of unknowns for which the factors may need more memory than is available."""


class NoFlow(RuntimeError):
    """Raised on every rank, with the reason, if no flow can be computed."""


class FactorisedFlow:
    """Solve A y = b for a flow in the jump basis by MUMPS, with a memory limit for large problems.

    Attributes:
        penalty: Weight of the inadmissible part relative to the viscosity.
        exact: Share of ‖ε(v)‖ below which an inadmissible strain rate counts as zero.
        closes: If a pair closes, the flow holds all pairs whose jumps exceed this share of the
            largest velocity.
        large: Whether the problem is so large that :class:`IteratedFlow` may succeed if this solver
            fails.
    """

    penalty = 1e8
    exact = 1e-11
    closes = ROUNDING

    def __init__(self, problem: Problem) -> None:
        """Create the solver. Collective."""
        self.large = problem.num_dofs >= LARGE
        self._priced = not self.large
        memory = spare_memory(problem.comm) if self.large else np.inf
        some = {} if np.isinf(memory) else {"mat_mumps_icntl_23": max(int(memory), 1)}
        self._ksp = PETSc.KSP().create(problem.comm)
        self._ksp.setOptionsPrefix(own_prefix(self, BOUND, DIRECT | some))
        self._ksp.setFromOptions()

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Set up the solver for an operator that holds the closed pairs. Collective.

        Args:
            operator: The operator with its matrix.
            closed: Local (owned) unknowns that are held.
            flow: Approximate flow of the bodies, in the jump basis.

        Raises:
            NoFlow: If the operator cannot be factorised, or if for a large problem the factors of
                MUMPS do not fit into memory or take more time than CG.
        """
        self._ksp.setOperators(operator.matrix)
        pc = self._ksp.getPC()
        if not self._priced and (pc.getType(), pc.getFactorSolverType()) == ("cholesky", "mumps"):
            cost = price(self._ksp, operator.matrix)
            # A bound needs about 4 factorisations or 1200 iterations.
            worth = 300
            if not cost.fits or cost.iterations > worth:
                raise NoFlow("the factors of the flow's matrix need too much memory or time")
        self._priced = True
        self._ksp.setUp()
        if pc.getFailedReason():
            forget_factors(self._ksp)
            raise NoFlow(
                "the matrix of the flow cannot be factorised: the flow is not unique, or "
                "memory is short"
            )

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Solve for y. Collective.

        Args:
            b: The forces.
            y: Initial guess, or zero; the function overwrites it with the solution.
            left: Share of the initial residual that may remain; factors leave rounding errors only.
        """
        self._ksp.solve(b, y)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._ksp.destroy()


class IteratedFlow:
    """CG with smoothed aggregation multigrid, whose coarse spaces contain an approximate flow.

    For the attributes and arguments, see :class:`FactorisedFlow`.
    """

    penalty = 3e4
    exact = 1e-7
    # Because of residuals, pairs with jumps near zero may open or close. With this value, the flow
    # also holds pairs that open slightly.
    closes = -1e-3
    large = False

    def __init__(self, problem: Problem) -> None:
        """Create the solver. Collective."""
        self._multigrid = Multigrid(problem)
        self._residual, self._change = problem.create_vector(), problem.create_vector()
        self._matrix: PETSc.Mat | None = None
        owned = problem.V.dofmap.index_map.size_local
        self._supported = np.flatnonzero(problem.fixed[:owned]).astype(np.int32)
        self._at_rest = self._supported

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Compute the coarse operators. Collective."""
        self._multigrid.prepare(operator)  # builds coarse spaces, since the problem is large
        self._matrix = operator.matrix
        self._at_rest = np.concatenate([self._supported, closed])
        self._multigrid.set_matrix(operator, closed)
        self._multigrid.renew(flow)

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Reduce the residual to the share ``left``, without moving supports. Collective.

        Raises:
            NoFlow: If the system cannot be solved.
        """
        assert self._matrix is not None
        self._matrix.mult(y, self._residual)
        self._residual.aypx(-1.0, b)
        outcome = self._multigrid.solve(self._residual, self._change, left)
        if not outcome.solved:
            raise NoFlow(f"the linear system of the flow cannot be solved: {outcome.failure}")
        y.axpy(1.0, self._change)
        y.array[self._at_rest] = 0.0

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._multigrid.destroy()
        for vector in (self._residual, self._change):
            vector.destroy()


MOST_ITERATIONS, PATIENCE = 400, 20
"""Largest number of flows that remove the inadmissible part, and number of flows within which the
inadmissible part must at least halve.
"""


class ViscousFlow:
    """Compute flows of bodies whose laws have linear admissibility conditions.

    Attributes:
        velocity: Velocity v, with L₁(v) = 1 after a solve.
        viscosity: Viscosity η > 0 at the points; the caller sets it before a solve.
        drag: Viscosity of friction, a force divided by a slip rate, shape (num_places,); the caller
            also sets it before a solve.
        solves: Number of linear systems solved so far.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the forms. Collective."""
        self._problem, laws = problem, problem.laws
        self.solves = 0
        self.velocity = v = fem.Function(problem.V, name="mechanism")
        self.viscosity = eta = fem.Function(problem.Q)
        self.drag: Floats = np.zeros(len(problem.friction.bound))
        strain = problem.kinematics.strain
        rate = strain(v)
        trial, test = (strain(f(problem.V)) for f in (ufl.TrialFunction, ufl.TestFunction))
        stresses = {
            on: fem.Function(problem.space_at_points(on.law.yields.inadmissible(rate).ufl_shape))
            for on in laws
        }

        self._system: FactorisedFlow | IteratedFlow = FactorisedFlow(problem)
        self._penalty = penalty = fem.Constant(problem.V.mesh, np.float64(self._system.penalty))

        def resisted(on: LawOnCells) -> Expr:
            return penalty * eta * on.law.yields.inadmissible(rate)

        def density(on: LawOnCells) -> Expr:
            lost = (on.law.yields.inadmissible(e) for e in (trial, test))
            return eta * (on.law.yields.resistance(trial, test) + penalty * ufl.dot(*lost))

        self._resisted = [
            (on, stress, LawExpression([on], stress.function_space, resisted))
            for on, stress in stresses.items()
        ]
        self._operator_form = fem.form(integrate(laws, density))
        self._force_form = fem.form(
            integrate(laws, lambda on: ufl.dot(stresses[on], on.law.yields.inadmissible(test)))
        )
        self._weight_form = fem.form(integrate(laws, lambda on: ufl.TestFunction(problem.Q)))
        lost = integrate(laws, lambda on: ufl.dot(*[on.law.yields.inadmissible(rate)] * 2))
        self._lost = Integral(problem.comm, lost)
        self._square = Integral(problem.comm, integrate(laws, lambda on: ufl.dot(rate, rate)))
        self._stiffness = create_stiffness(problem)
        self._operator = ContactOperator(problem, self._stiffness)
        self._force = problem.create_vector()
        self._b, self._y = problem.create_vector(), problem.create_vector()
        self._live, self._rest = problem.create_vector(), problem.create_vector()
        self._closed: Ints = np.zeros(0, dtype=np.int32)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        vectors = (self._force, self._b, self._y, self._live, self._rest)
        self._system.destroy()
        for part in (self._operator.matrix, self._stiffness, *vectors):
            part.destroy()

    def solve(self, held: PairFlags) -> None:
        """Compute the nearly admissible flow with given closed pairs. Collective.

        Args:
            held: Flags of the closed pairs, shape (num_pairs,).

        Raises:
            NoFlow: If there is no such flow.
        """
        problem = self._problem
        self._closed = np.concatenate([problem.basis.index[held], problem.basis.tied])
        self._set_up(problem.basis.index[held])
        problem.loads.live.copy(self._force)
        self._live.array[self._closed] = 0
        self._solve(self._force, self._live)
        problem.basis.T.mult(self._live, self.velocity.x.petsc_vec)
        work = problem.loads.alpha(self.velocity.x.petsc_vec)
        largest = float(self._live.norm(PETSc.NormType.NORM_INFINITY))
        if not work > ROUNDING * problem.loads.live.norm() * largest:
            raise NoFlow("the loads do no work on the flow")
        self._rest.set(0)
        if problem.loads.has_dead():
            problem.loads.dead.copy(self._force)
            self._solve(self._force, self._rest)
        self._move_to(self._rest)
        # the combination of the flows under constant and live loads with L₁(v) = 1
        share = (1 - problem.loads.alpha(self.velocity.x.petsc_vec)) / work
        self._rest.axpy(share, self._live)
        self._move_to(self._rest)

    def slips(self) -> Floats:
        """Return the slip rates of the velocity, shape (num_places, gdim − 1). Collective."""
        self._problem.basis.M.mult(self.velocity.x.petsc_vec, self._y)
        return self._problem.friction.jumps(self._y)

    def make_admissible(self) -> None:
        """Remove the inadmissible part of the last flow, up to rounding. Collective.

        Raises:
            NoFlow: If the inadmissible part does not vanish.
        """
        directions, left = ConjugateResiduals(self._problem.comm.allreduce), self._inadmissible()
        units, halved = self._units(), np.inf
        for count in range(MOST_ITERATIONS):
            if left <= self._system.exact:
                break
            if count % PATIENCE == 0:
                if not left < halved / 2:
                    raise NoFlow(
                        "no velocity is admissible: nothing can flow, or the elements lock"
                    )
                halved = left
            self._oppose(directions, units)
            left = self._inadmissible()
        else:
            raise NoFlow("the flow does not become admissible")
        self._move_to(self._y / self._problem.loads.alpha(self.velocity.x.petsc_vec))

    def _oppose(self, directions: ConjugateResiduals, units: list[tuple[Ints, Floats]]) -> None:
        """Subtract the flow under stresses that oppose the inadmissible part. Collective."""
        problem, here = self._problem, self._y.copy()
        left = self._inadmissible_at(units)
        assemble_force(self._force, self._force_form, problem.bcs)
        self._rest.set(0)
        roughly = 0.1  # remaining share of a residual; a smaller share would take more time
        self._solve(self._force, self._rest, roughly)
        self._move_to(self._rest)
        step = directions.step(self._rest.array_r, self._inadmissible_at(units), left)
        if step is not None:
            here.array[:] -= step
        self._move_to(here)
        here.destroy()

    def _units(self) -> list[tuple[Ints, Floats]]:
        """Return the points of each law, with √(w/η) at the points, the unit of inadmissible parts.

        Collective.

        With inadmissible parts in this unit, the operator of conjugate residuals is symmetric. The
        number of required directions is the number of distinct magnitudes of pressures that the
        elements resolve.
        """
        Q = self._problem.Q
        owned, points = Q.dofmap.index_map.size_local, Q.dofmap.list
        weights = fem.assemble_vector(self._weight_form).array[:owned]
        found: Floats = np.sqrt(weights / self.viscosity.x.array[:owned])
        of_laws = (points[on.cells].ravel() for on, _, _ in self._resisted)
        return [(at, found[at]) for at in (of_law[of_law < owned] for of_law in of_laws)]

    def _inadmissible_at(self, units: list[tuple[Ints, Floats]]) -> Floats:
        """Return the inadmissible parts at this rank's points, in the given units. Collective."""
        parts: list[Floats] = []
        for (_, stress, expression), (at, unit) in zip(self._resisted, units, strict=True):
            expression.interpolate(stress)
            block = stress.function_space.dofmap.index_map_bs
            parts.append((unit[:, None] * stress.x.array.reshape(-1, block)[at]).ravel())
        return np.concatenate(parts)

    def dead_work(self) -> float:
        """Return the work L₀(v) of the constant loads on the velocity. Collective."""
        return float(self._problem.loads.dead.dot(self.velocity.x.petsc_vec))

    def _solve(self, force: PETSc.Vec, y: PETSc.Vec, left: float = 1e-2) -> None:
        """Solve for the flow in the jump basis under nodal forces. Collective."""
        self._problem.basis.T.multTranspose(force, self._b)
        self._b.array[self._closed] = 0
        self._system.solve(self._b, y, left)
        self.solves += 1

    def _move_to(self, y: PETSc.Vec) -> None:
        """Set the velocity to y, given in the jump basis. Collective."""
        v = self.velocity.x
        y.copy(self._y)
        self._problem.basis.T.mult(y, v.petsc_vec)
        v.scatter_forward()

    def _inadmissible(self) -> float:
        """Return the norm of the inadmissible part, divided by the norm of ε(v). Collective."""
        return float(np.sqrt(self._lost() / (self._square() or 1.0)))

    def hold(self, held: PairFlags) -> bool:
        """Hold more pairs if the last flow closes a pair that is not held. Collective.

        Args:
            held: Flags of the held pairs, shape (num_pairs,); the function sets the flags of
                further pairs.

        Returns:
            Whether the flow closes a pair that was not held.
        """
        jumps = self._jumps()
        closes = self._problem.comm.allreduce(int(((jumps > ROUNDING) & ~held).sum())) > 0
        if closes:
            held |= jumps > self._system.closes
        return closes

    def _jumps(self) -> Floats:
        """Return the jumps of the last flow, divided by its largest velocity. Collective.

        Returns:
            Jumps, shape (num_pairs,), positive for pairs that close.
        """
        largest = float(self._y.norm(PETSc.NormType.NORM_INFINITY))
        return self._y.array_r[self._problem.basis.index] / (largest or 1.0)

    def _set_up(self, closed: Ints) -> None:
        """Set up a suitable solver with the viscosity and the closed pairs. Collective."""
        self._assemble(closed)
        self._problem.basis.M.mult(self.velocity.x.petsc_vec, self._y)
        try:
            self._system.set_up(self._operator, closed, self._y)
        except NoFlow:
            if not self._system.large:
                raise
            self._system.destroy()
            self._system = IteratedFlow(self._problem)
            self._penalty.value = self._system.penalty
            self._assemble(closed)
            self._system.set_up(self._operator, closed, self._y)

    def _assemble(self, closed: Ints) -> None:
        self._stiffness.zeroEntries()
        fem_petsc.assemble_matrix(self._stiffness, self._operator_form, self._problem.bcs)  # type: ignore[arg-type]
        self._stiffness.assemble()
        self._problem.free.hold(self._stiffness)
        friction = self._problem.friction
        each = self.drag[:, None, None] * np.eye(friction.index.shape[1])
        self._operator.add_springs((friction.index, each) if friction.count else None)
        self._operator.hold(closed)
