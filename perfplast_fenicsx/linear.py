"""Linear systems of one step, with some unknowns held: presets by size, near-nullspace, reuse."""

import logging
from collections.abc import Mapping

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.contact import RIGID
from perfplast_fenicsx.petsc_options import LINEAR, own_prefix
from perfplast_fenicsx.phases import phase
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.rigidity import contact_gram, null_space

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

MOST_MODES = 12
"""With more near-null motions than this (many bodies) only the common ones are kept."""

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
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 1,
    "pc_gamg_coarse_eq_limit": 1000,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "jacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.05",
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "cholesky",
}


log = logging.getLogger(__name__)


class LinearFailure(RuntimeError):
    """A linear system that could not be solved; the message is the reason, alike on every rank."""


class LinearSolver:
    """Solves A y = b in the contact basis, with any set of unknowns held at zero.

    CG + GAMG for large problems, MUMPS Cholesky for small ones; every PETSc option can be given
    with the prefix ``perfplast_``. The coarse grids are kept while the operator and the held
    unknowns change, with the finest one up to date, until the iterations that this has cost beyond
    those of new ones outweigh a set-up.

    Attributes:
        iterations: Krylov iterations so far.
        solves: Systems solved so far.
        setups: Factorisations or multigrid set-ups so far.
        name: What is used, for people.
    """

    def __init__(self, problem: Problem) -> None:
        self.iterations = self.solves = self.setups = 0
        self._modes: PETSc.NullSpace | None = None
        self._problem = problem
        self._configure(
            DIRECT if problem.num_dofs <= DIRECT_LIMIT[problem.bodies.gdim] else MULTIGRID
        )
        self._full: PETSc.Mat | None = None
        self._reduced: PETSc.Mat | None = None
        self._held: npt.NDArray[np.int32] = np.zeros(0, dtype=np.int32)
        self._ready = False
        self._rate = self._excess = 0.0

    def _configure(self, preset: Mapping[str, object]) -> None:
        self._ksp = PETSc.KSP().create(self._problem.comm)
        self._ksp.setOptionsPrefix(own_prefix(LINEAR, preset))
        self._ksp.setFromOptions()
        self.direct = self._ksp.getType() == "preonly"
        self.name = f"{self._ksp.getType()} + {self._ksp.getPC().getType()}"
        self._old = False

    def counts(self) -> tuple[int, int, int]:
        """Systems solved, set-ups and Krylov iterations so far."""
        return self.solves, self.setups, self.iterations

    def set_operator(self, A: PETSc.Mat) -> None:
        """Take a new matrix, or the same one with new values; nothing is held."""
        A.setOption(PETSc.Mat.Option.SPD, True)
        if self._modes is None and not self.direct:
            self._modes = near_null_space(self._problem, A)
        if self._modes is not None:
            A.setNearNullSpace(self._modes)
        self._full = A
        self._ready = False

    def hold(self, held: npt.NDArray[np.int32]) -> bool:
        """Hold the unknowns with these local (owned) indices at zero. Collective.

        Returns:
            Whether this called for a new set-up.
        """
        assert self._full is not None
        changed = not np.array_equal(held, self._held)
        if self._ready and not self._problem.comm.allreduce(changed):
            return False
        self._held = held.copy()
        self._reduce()
        self._ready = True
        return True

    @phase("linear set-up")
    def _reduce(self) -> None:
        full = self._full
        assert full is not None
        if self._reduced is None:
            self._reduced = full.copy()
            self._reduced.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            self._reduced.setOption(PETSc.Mat.Option.SPD, True)
            if self._modes is not None:
                self._reduced.setNearNullSpace(self._modes)
        else:
            full.copy(self._reduced, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first = full.getOwnershipRange()[0]
        diagonal = full.getDiagonal()
        scale = diagonal.sum() / diagonal.getSize()
        diagonal.destroy()
        self._reduced.zeroRowsColumns((self._held + first).astype(PETSc.IntType), diag=scale)
        self._ksp.setOperators(self._reduced)
        self._renew(self.direct or not self._rate or self._excess > SET_UP_WORTH)

    def _renew(self, new: bool) -> None:
        """Make a new preconditioner at the next solve, or keep the coarse grids there are."""
        self._ksp.getPC().setReusePreconditioner(not new)
        self._old = not new
        if new:
            self.setups += 1
            self._rate = self._excess = 0.0

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> None:
        """Solve for x; entries of b at held unknowns must be zero. Collective.

        Raises:
            LinearFailure: If the system is singular or the iteration fails.
        """
        self.solves += 1
        reason = self._try(b, x, rtol)
        if self._slow(reason) and self._old:
            self._renew(True)
            reason = reason if reason > 0 else self._try(b, x, rtol)
        elif self._slow(reason) and self._may_fall_back():
            self._fall_back()
            reason = reason if reason > 0 else self._try(b, x, rtol)
        if reason <= 0 and self._may_fall_back():
            self._fall_back()
            reason = self._try(b, x, rtol)
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
        assert self._reduced is not None
        image = b.duplicate()
        self._reduced.mult(x, image)
        image.axpy(-1.0, b)
        left = image.norm() / b.norm()
        image.destroy()
        return float(left)

    def _try(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> int:
        """Solve, and tell PETSc's reason for having ended."""
        if not self.direct:
            self._ksp.setTolerances(rtol=rtol)
        self._set_up()
        self._iterate(b, x)
        iterations = self._ksp.getIterationNumber()
        self.iterations += iterations
        if not self._rate:
            self._rate = iterations / -np.log10(rtol)
        self._excess += iterations + self._rate * np.log10(rtol)
        return int(self._ksp.getConvergedReason())

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
        self._configure(DIRECT)
        if self._reduced is not None:
            self._ksp.setOperators(self._reduced)
            self.setups += 1


_REASONS = {
    value: name.lower().replace("_", " ")
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if isinstance(value, int)
}


def near_null_space(problem: Problem, A: PETSc.Mat) -> PETSc.NullSpace:
    """The rigid motions that closed contact leaves free, in the contact basis, orthonormal.

    Supports and obstacles do not count: they hold nodes, not the operator inside the bodies.

    For one body these are its 6 (3 in 2D) rigid motions; two bodies on a plane have 9: the common
    ones, and the in-plane motions of one body alone, which a frictionless interface lets slide.
    """
    V, bodies, basis = problem.V, problem.bodies, problem.basis
    owned, gdim = V.dofmap.index_map.size_local, bodies.gdim
    moving = problem.pairs.guest_body != RIGID
    motions = null_space(contact_gram(V, bodies, problem.pairs, moving))
    if motions.shape[1] > MOST_MODES:
        motions = np.tile(np.eye(bodies.num_modes), (bodies.count, 1))
    x = V.tabulate_dof_coordinates()[:owned]
    shares = motions.reshape(bodies.count, bodies.num_modes, -1)[bodies.of_node[:owned]]
    nodal = np.einsum("nim,nmk->nik", bodies.rigid_modes(x), shares).reshape(owned * gdim, -1)
    u, y = A.createVecs()
    for k in range(nodal.shape[1]):
        u.array[:] = nodal[:, k]
        basis.M.mult(u, y)
        nodal[:, k] = y.array
    nodal[basis.index] = 0
    gram = problem.comm.allreduce(nodal.T @ nodal)
    orthonormal = np.linalg.solve(np.linalg.cholesky(gram), nodal.T)
    vectors = []
    for row in orthonormal:
        vector = A.createVecRight()
        vector.array[:] = row
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=problem.comm)
