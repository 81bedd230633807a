"""Systems of viscous flows that nearly keep what the laws ask for, by a penalty: how one is solved.

What a penalty leaves is done away with afterwards, by a few solves. Factors are used again, so that
a large penalty and fewer solves are best; but CG takes the longer, the larger the penalty is.
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
"""From so many unknowns on the factors may use no more memory than there is to spare."""


class NoFlow(RuntimeError):
    """Why there is no flow, on every rank alike."""


class FlowSystem(Protocol):
    """A way of solving A y = b for a flow in the jump basis.

    Attributes:
        penalty: Weight of what is inadmissible against the viscosity.
        exact: A strain rate that is inadmissible counts as none below this share of ‖ε(v)‖.
        closes: Where a pair closes, all those are held whose jumps are above this share of the
            largest velocity.
        large: Whether there are so many unknowns that iterating may do where this way does not.
    """

    penalty: float
    exact: float
    closes: float
    large: bool

    def suits(self, matrix: PETSc.Mat) -> bool:
        """Whether this way is the better one for a matrix, before any is set up. Collective."""

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Take an operator that holds the closed pairs. Collective.

        Args:
            operator: With its matrix.
            closed: Local (owned) unknowns that are held.
            flow: About how the bodies flow, in the jump basis.

        Raises:
            NoFlow: If it cannot be solved for.
        """

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Solve for y, which is near the solution, or zero, to begin with. Collective.

        Args:
            b: The forces.
            y: Where to start, and what is found.
            left: Share of the residual that may be left.

        Raises:
            NoFlow: If it cannot be solved for.
        """

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""


class FactorisedFlow:
    """MUMPS Cholesky; where the factors are large, with an end to its memory."""

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
        """Return whether the factors fit, and cost less than CG. Collective."""
        pc = self._ksp.getPC()
        if not self.large or pc.getType() != "cholesky" or pc.getFactorSolverType() != "mumps":
            return True
        self._ksp.setOperators(matrix)
        cost = price(self._ksp, matrix)
        # A bound takes some 4 factorisations, or 1200 iterations.
        worth = 300
        return cost.fits and cost.iterations <= worth

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Factorise. Collective."""
        self._ksp.setOperators(operator.matrix)
        self._ksp.setUp()
        if self._ksp.getPC().getFailedReason():
            forget_factors(self._ksp)
            raise NoFlow("the flow cannot be factorised: it is not unique, or memory is short")

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Solve with the factors, which leave nothing. Collective."""
        self._ksp.solve(b, y)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._ksp.destroy()


class IteratedFlow:
    """CG with smoothed aggregation, whose coarse spaces know about how the bodies flow."""

    penalty = 3e4
    exact = 1e-7
    closes = -1e-3  # what is left moves pairs to and fro: of those near to it, half at a time
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
        """Whenever factors do not."""
        return True

    def set_up(self, operator: ContactOperator, closed: Ints, flow: PETSc.Vec) -> None:
        """Form the coarse operators. Collective."""
        self._multigrid.prepare(operator)  # which has coarse spaces, as the problem is large
        self._matrix = operator.matrix
        self._at_rest = np.concatenate([self._supported, closed])
        self._multigrid.set_matrix(operator, closed)
        self._multigrid.renew(flow)

    def solve(self, b: PETSc.Vec, y: PETSc.Vec, left: float) -> None:
        """Do away with most of the residual, and move no support. Collective."""
        assert self._matrix is not None
        self._matrix.mult(y, self._residual)
        self._residual.aypx(-1.0, b)
        outcome = self._multigrid.solve(self._residual, self._change, left)
        if not outcome.solved:
            raise NoFlow(f"the flow cannot be solved for: {outcome.failure}")
        y.axpy(1.0, self._change)
        y.array[self._at_rest] = 0.0

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._multigrid.destroy()
        for vector in (self._residual, self._change):
            vector.destroy()
