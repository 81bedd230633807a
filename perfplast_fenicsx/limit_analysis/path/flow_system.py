"""Solve for viscous flows that are nearly admissible, by a penalty.

A few solves remove the inadmissible part that a penalty leaves. Factors are used again, so that a
large penalty and fewer solves are best. But CG takes longer if the penalty is larger.
"""

from typing import Protocol

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.machine_memory import spare_memory
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT, price
from perfplast_fenicsx.solvers.linear.multigrid import Multigrid
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import BOUND, own_prefix

LARGE = 60_000
"""Number of unknowns from which on the factors may need more memory than is available."""


class NoFlow(RuntimeError):
    """Reason why there is no flow, on every rank."""


class FlowSystem(Protocol):
    """A way to solve A y = b for a flow in the jump basis.

    Attributes:
        penalty: Weight of the inadmissible part relative to the viscosity.
        exact: Share of ‖ε(v)‖ below which an inadmissible strain rate counts as zero.
        closes: If a pair closes, all pairs are held whose jumps exceed this share of the largest
            velocity.
        large: Whether the problem is so large that iterations may succeed where this way fails.
    """

    penalty: float
    exact: float
    closes: float
    large: bool

    def suits(self, matrix: PETSc.Mat) -> bool:
        """Return whether this way is better for a matrix, before any is set up. Collective."""

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Use an operator that holds the closed pairs. Collective.

        Args:
            operator: The operator with its matrix.
            closed: Local (owned) unknowns that are held.
            flow: Approximate flow of the bodies, in the jump basis.

        Raises:
            NoFlow: If the system cannot be solved.
        """

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Solve for y, which is an approximate solution, or zero, at first. Collective.

        Args:
            b: The forces.
            y: Initial value; overwritten with the solution.
            left: Share of the residual that may remain.

        Raises:
            NoFlow: If the system cannot be solved.
        """

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""


class FactorisedFlow:
    """MUMPS Cholesky; with a limit of its memory if the factors are large."""

    penalty = 1e8
    exact = 1e-11
    closes = ROUNDING

    def __init__(self, problem: Problem) -> None:
        """Create the solver. Collective."""
        self.large = problem.num_dofs >= LARGE
        memory = spare_memory(problem.comm) if self.large else np.inf
        some = {} if np.isinf(memory) else {"mat_mumps_icntl_23": max(int(memory), 1)}
        self._ksp = PETSc.KSP().create(problem.comm)
        self._ksp.setOptionsPrefix(own_prefix(self, BOUND, DIRECT | some))
        self._ksp.setFromOptions()

    def suits(self, matrix: PETSc.Mat) -> bool:
        """Return whether the factors fit into memory, and cost less than CG. Collective."""
        pc = self._ksp.getPC()
        if not self.large or pc.getType() != "cholesky" or pc.getFactorSolverType() != "mumps":
            return True
        self._ksp.setOperators(matrix)
        cost = price(self._ksp, matrix)
        # A bound takes about 4 factorisations, or 1200 iterations.
        worth = 300
        return cost.fits and cost.iterations <= worth

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Factorise the operator. Collective."""
        self._ksp.setOperators(operator.matrix)
        self._ksp.setUp()
        if self._ksp.getPC().getFailedReason():
            forget_factors(self._ksp)
            raise NoFlow("the flow cannot be factorised: it is not unique, or memory is short")

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Solve with the factors, which leave no residual. Collective."""
        self._ksp.solve(b, y)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._ksp.destroy()


class IteratedFlow:
    """CG with smoothed aggregation, whose coarse spaces contain an approximate flow."""

    penalty = 3e4
    exact = 1e-7
    # the residual moves pairs back and forth: half of the pairs near zero are held at a time
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

    def suits(self, matrix: PETSc.Mat) -> bool:
        """Return True: this way is used where factors do not suit."""
        return True

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Form the coarse operators. Collective."""
        self._multigrid.prepare(operator)  # which has coarse spaces, as the problem is large
        self._matrix = operator.matrix
        self._at_rest = np.concatenate([self._supported, closed])
        self._multigrid.set_matrix(operator, closed)
        self._multigrid.renew(flow)

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Remove most of the residual, without moving supports. Collective."""
        assert self._matrix is not None
        self._matrix.mult(y, self._residual)
        self._residual.aypx(-1.0, b)
        outcome = self._multigrid.solve(self._residual, self._change, left)
        if not outcome.solved:
            raise NoFlow(f"the flow cannot be solved for: {outcome.failure}")
        y.axpy(1.0, self._change)
        y.array[self._at_rest] = 0.0

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._multigrid.destroy()
        for vector in (self._residual, self._change):
            vector.destroy()
