"""Linear systems of one step, with some unknowns held: presets by size, reuse, last resorts."""

import logging
from collections.abc import Mapping

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, own_prefix
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import CoarseSpaces, blocked

DIRECT_LIMIT = {2: 300_000, 3: 40_000}
"""Up to so many unknowns, by dimension, a sparse Cholesky factorisation is the quicker one."""

FALLBACK_LIMIT = 400_000
"""Up to so many unknowns a factorisation takes over where multigrid has become too slow."""

SLOW = 300
"""Krylov iterations of one solve that count as too slow."""

USELESS = 0.1
"""A solution that leaves more of the right-hand side is none."""

SET_UP_WORTH = 12
"""A multigrid set-up costs about as much as so many Krylov iterations."""

WORTH_A_MOTION = 6.0
"""Krylov iterations a decimal digit from which on coarse spaces get the last solution as a motion;
elastic bodies take two."""

DIRECT = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # more room to work in (%): pivoting in parallel may need it
}

MULTIGRID = {
    "ksp_type": "cg",
    "ksp_norm_type": "unpreconditioned",
    "ksp_max_it": 1000,
    "pc_type": "mg",
    "pc_mg_cycle_type": "w",
    "pc_use_amat": None,  # the smoothers work with the blocked matrix, as CG does
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "pbjacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.05",
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "cholesky",
}


NAMES = {("preonly", "cholesky"): "MUMPS Cholesky", ("cg", "mg"): "CG + smoothed aggregation"}

log = logging.getLogger(__name__)


class LinearFailure(RuntimeError):
    """A linear system that could not be solved; the message is the reason, alike on every rank."""


class LinearSolver:
    """Solves A y = b in the contact basis, with any set of unknowns held at zero.

    CG with smoothed aggregation for large problems, MUMPS Cholesky for small ones; every PETSc
    option can be given with the prefix ``perfplast_``. The coarse grids are kept while the operator
    and the held unknowns change, with the finest one up to date, until the iterations that this has
    cost beyond those of new ones outweigh a set-up. Where bodies flow and it takes many iterations,
    they are made for the last solution as well.

    CG and its smoothers multiply with a copy that stores the upper triangle in blocks, more than
    twice as fast.

    Attributes:
        iterations: Krylov iterations so far.
        solves: Systems solved so far.
        setups: Factorisations or multigrid set-ups so far.
        name: What is used, for people.
    """

    def __init__(self, problem: Problem) -> None:
        """Choose a solver by size."""
        self.iterations = self.solves = self.setups = 0
        self._problem = problem
        self._spaces: CoarseSpaces | None = None
        self._blocked: PETSc.Mat | None = None
        self._configure(_preset(problem))
        self._operator: ContactOperator | None = None
        self._held: npt.NDArray[np.int32] = np.zeros(0, dtype=np.int32)
        self._ready, self._due = False, True
        self._rate = self._latest_rate = self._excess = 0.0
        self._motion: PETSc.Vec | None = None

    def _configure(self, preset: Mapping[str, object], heed: bool = True) -> None:
        self._ksp = PETSc.KSP().create(self._problem.comm)
        self._ksp.setOptionsPrefix(own_prefix(LINEAR, preset, heed))
        self._ksp.setFromOptions()
        pc = self._ksp.getPC().getType()
        self.direct = self._ksp.getType() == "preonly"
        asked = PETSc.Options(self._ksp.getOptionsPrefix()).hasName("ksp_rtol")
        self._least_rtol = self._ksp.getTolerances()[0] if asked else 1.0
        self._aggregates = pc == "mg"
        self.name = _name(self._ksp.getType(), pc)
        self._old = False

    def counts(self) -> tuple[int, int, int]:
        """Systems solved, set-ups and Krylov iterations so far."""
        return self.solves, self.setups, self.iterations

    def set_operator(self, operator: ContactOperator) -> None:
        """Take a new operator, or the same one with new values; nothing is held."""
        self._operator = operator
        self._ready = False
        if self._aggregates and self._spaces is None:
            self._aggregate()  # before other matrices are made, since it needs the most memory

    def hold(self, held: npt.NDArray[np.int32]) -> bool:
        """Hold the unknowns with these local (owned) indices at zero. Collective.

        Returns:
            Whether this called for a new set-up.
        """
        changed = not np.array_equal(held, self._held)
        if self._ready and not self._problem.comm.allreduce(changed):
            return False
        self._held = held.copy()
        self._current.hold(held)
        self._set_matrices()
        self._renew(self.direct or self._due or self._excess > SET_UP_WORTH)
        self._ready = True
        return True

    @property
    def _current(self) -> ContactOperator:
        assert self._operator is not None
        return self._operator

    @phase("linear set-up")
    def _set_matrices(self) -> None:
        matrix = self._current.matrix
        if self.direct:
            self._ksp.setOperators(matrix)
            return
        self._blocked = blocked(matrix, self._blocked)
        self._ksp.setOperators(self._blocked, matrix)

    def _renew(self, new: bool) -> None:
        """Make a new preconditioner at the next solve, or keep the coarse grids there are."""
        self._ksp.getPC().setReusePreconditioner(not new)
        self._old, self._due = not new, new
        if new:
            if self._aggregates:
                self._coarsen()
            self.setups += 1
            self._rate = self._excess = 0.0

    @phase("linear set-up")
    def _aggregate(self) -> None:
        nodal = self._current.nodal()
        self._spaces = CoarseSpaces(self._problem, nodal)
        nodal.destroy()
        if self._spaces.levels > 1:
            self._ksp.getPC().setMGLevels(self._spaces.levels)
        else:  # a small problem
            self._ksp.destroy()
            self._configure(DIRECT, heed=False)

    @phase("linear set-up")
    def _coarsen(self) -> None:
        assert self._spaces is not None
        pc = self._ksp.getPC()
        if self._motion and self._latest_rate > WORTH_A_MOTION:
            pc.reset()  # its levels will have other sizes
            pc.setMGLevels(self._spaces.levels)
            self._ksp.setOperators(self._blocked, self._current.matrix)
            self._spaces.add(self._motion, self._current.nodal)
        self._spaces.project(self._current.matrix, self._held, pc)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, correction: bool = False) -> None:
        """Solve for x. Collective.

        Args:
            b: Right-hand side; entries at held unknowns must be zero.
            x: Takes the solution.
            rtol: Tolerance relative to b.
            correction: Whether x is a small part of a solution, which tells nothing of how bodies
                flow, nor of what a digit costs.

        Raises:
            LinearFailure: If the system is singular or the iteration fails.
        """
        self.solves += 1
        reason = self._try(b, x, rtol, correction)
        if self._slow(reason) and self._old:
            self._renew(True)
            reason = reason if reason > 0 else self._try(b, x, rtol, correction)
        elif self._slow(reason) and self._may_fall_back():
            self._fall_back()
            reason = reason if reason > 0 else self._try(b, x, rtol, correction)
        if reason <= 0 and self._may_fall_back():
            self._fall_back()
            reason = self._try(b, x, rtol, correction)
        if reason <= 0:
            raise self._failure(_REASONS.get(reason, str(reason)))
        if self.direct and self._left(b, x) > USELESS:
            raise self._failure("the solution leaves most of the right-hand side")

    def _failure(self, label: str) -> LinearFailure:
        return LinearFailure(
            f"the linear system could not be solved ({self.name}: {label}); it is singular or"
            " nearly so, as where bodies lose all contact or everything flows plastically"
        )

    def _slow(self, reason: int) -> bool:
        return reason <= 0 or self._ksp.getIterationNumber() > SLOW

    def _may_fall_back(self) -> bool:
        return not self.direct and self._problem.num_dofs <= FALLBACK_LIMIT

    def _left(self, b: PETSc.Vec, x: PETSc.Vec) -> float:
        """Share of b that A x misses: a factorisation of a singular matrix may go unnoticed."""
        image = b.duplicate()
        self._current.matrix.mult(x, image)
        image.axpy(-1.0, b)
        left = image.norm() / b.norm()
        image.destroy()
        return float(left)

    def _try(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, correction: bool) -> int:
        """Solve, and tell PETSc's reason for having ended."""
        if not self.direct:
            self._ksp.setTolerances(rtol=min(rtol, self._least_rtol))
        self._set_up()
        self._due = False
        self._iterate(b, x)
        iterations = self._ksp.getIterationNumber()
        self.iterations += iterations
        reason = int(self._ksp.getConvergedReason())
        if correction:
            return reason
        self._latest_rate = iterations / -np.log10(rtol)
        if reason > 0 and not self.direct:
            self._motion = x.copy(self._motion)
        if not self._rate:
            self._rate = self._latest_rate
        self._excess += iterations + self._rate * np.log10(rtol)
        return reason

    @phase("linear set-up")
    def _set_up(self) -> None:
        self._ksp.setUp()

    @phase("linear solve")
    def _iterate(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        self._ksp.solve(b, x)

    def _fall_back(self) -> None:
        """Factorise from now on: near collapse multigrid finds no good coarse spaces."""
        log.info("%s has become slow; a factorisation takes over", self.name)
        self._ksp.destroy()
        if self._spaces:
            self._spaces.destroy()
        self._configure(DIRECT, heed=False)
        self._set_matrices()
        self.setups += 1


_REASONS = {
    value: name.lower().replace("_", " ")
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if isinstance(value, int)
}


def chosen_solver(problem: Problem) -> str:
    """What :class:`LinearSolver` begins with for a problem, for people."""
    preset, options = _preset(problem), PETSc.Options()
    kinds = (options.getString(LINEAR + key, str(preset[key])) for key in ("ksp_type", "pc_type"))
    return _name(*kinds)


def _name(ksp: str, pc: str) -> str:
    return NAMES.get((ksp, pc), f"{ksp} + {pc}")


def _preset(problem: Problem) -> Mapping[str, object]:
    """The preset whose preconditioner the user asks for, or the one for this size."""
    asked = PETSc.Options().getString(LINEAR + "pc_type", "")
    for preset in (DIRECT, MULTIGRID):
        if preset["pc_type"] == asked:
            return preset
    return DIRECT if problem.num_dofs <= DIRECT_LIMIT[problem.bodies.gdim] else MULTIGRID
