"""Solve systems by CG with smoothed aggregation, whose coarse spaces extend across closed contact.

The coarse grids may be reused while the operator and the held unknowns change; the finest grid is
always up to date.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.blocked_products import BlockedProducts
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.krylov import Krylov
from perfplast_fenicsx.solvers.linear.outcome import Outcome
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import CoarseSpaces

MULTIGRID = {
    "ksp_type": "cg",
    "ksp_norm_type": "unpreconditioned",
    "ksp_max_it": 1000,
    "pc_type": "mg",
    "pc_mg_cycle_type": "w",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "pbjacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.05",
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "cholesky",
}

WORTH = {1: 24, 2: 12}
"""Number of iterations that cost as much as a set-up, by the degree of the elements."""


class Multigrid:
    """A Krylov method with smoothed aggregation in the jump basis.

    Attributes:
        name: Name of the solver in messages.
        worth: Number of Krylov iterations that cost about as much as a set-up.
    """

    def __init__(self, problem: Problem) -> None:
        """Create the solver; the first operator defines the aggregates. Collective."""
        self._problem = problem
        self.worth = WORTH[problem.degree]
        self._krylov = Krylov(problem.comm, MULTIGRID, parts=True)
        self.name = self._krylov.name
        self._spaces: CoarseSpaces | None = None
        self._operator: ContactOperator | None = None
        self._single: BlockedProducts | None = None
        self._held: Ints = np.zeros(0, dtype=np.int32)

    @phase("linear set-up")
    def prepare(self, operator: ContactOperator) -> bool:
        """Create the aggregates in the first call, before other matrices take memory.

        Returns:
            Whether aggregates exist; a small problem has none, and multigrid does not suit it.
        """
        if self._spaces is None:
            nodal = operator.nodal()
            self._spaces = CoarseSpaces(self._problem, nodal)
            nodal.destroy()
            if self._spaces.levels > 1:
                self._krylov.preconditioner.setMGLevels(self._spaces.levels)
        return self._spaces.levels > 1

    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Set the matrix of an operator in which ``held`` is eliminated. Collective."""
        self._operator, self._held = operator, held
        self._krylov.set_matrix(operator, held)
        if self._single is None:
            self._single = BlockedProducts(operator.matrix, np.float32)
        self._single.fill(operator.matrix)

    @phase("linear set-up")
    def renew(self, flow: PETSc.Vec | None) -> None:
        """Form the coarse operators from the current matrix. Collective.

        Args:
            flow: A solution in the jump basis that becomes an additional motion of every aggregate;
                None to keep the aggregates.
        """
        assert self._spaces is not None
        assert self._operator is not None and self._single is not None
        self._krylov.renew(flow)
        pc = self._krylov.preconditioner
        if flow is not None:
            pc.reset()  # the new levels have other sizes
            pc.setMGLevels(self._spaces.levels)
            self._krylov.attach()
            self._spaces.add(flow, self._operator.nodal)
        A = self._operator.matrix
        pc.getMGSmoother(self._spaces.levels - 1).setOperators(self._single.matrix, A)
        self._spaces.project(A, self._held, pc)

    def keep(self) -> None:
        """Use the current coarse grids in the next solves."""
        self._krylov.keep()

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, to ``rtol`` relative to b or to a smaller tolerance of the user.

        Collective.
        """
        return self._krylov.solve(b, x, rtol)

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        self._krylov.destroy()
        if self._single is not None:
            self._single.destroy()
        if self._spaces is not None:
            self._spaces.destroy()
