"""The contact QP of one Newton step by Total FETI: its dual, on bodies cut into pieces.

    minimise ½ δᵀKδ − fᵀδ  subject to  B_E δ = 0,  B_I δ ≤ room  and, where asked,  ℓᵀδ = work

Supports are rows too, so that the stiffness of each piece has its rigid motions R as its kernel
(Z. Dostál, D. Horák, R. Kučera, Commun. Numer. Meth. Engng 22 (2006), 1155). With F = B K⁺Bᵀ,
d = B K⁺f − c, G = RᵀBᵀ and e = Rᵀf the dual is

    minimise ½ λᵀFλ − dᵀλ  where  Gλ = e,  λ_I ≥ 0

and contact is a bound on multipliers: no set of closed pairs is factorised. λ_I are the contact
forces behind the step, so that the next one starts from them.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactStep
from perfplast_fenicsx.solvers.active_set.equality_qp import NOTHING_HELD, Held
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.tfeti.dual_operator import DualOperator
from perfplast_fenicsx.solvers.tfeti.gluing import make_gluing
from perfplast_fenicsx.solvers.tfeti.smalbe import DualProgram, DualSolution, solve_dual
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains
from perfplast_fenicsx.solvers.tfeti.torn_stiffness import TornStiffness

MOST_PRODUCTS = 3000
"""A dual that has not been solved with so many products with F never will be."""

ROUNDING = 1e-13
"""What is left of forces and jumps, relative to their terms, that is rounding."""

SHARPER = 0.1
"""Dual residuals in shares of the tolerance of a step: jumps count for more in forces."""


class TfetiProgram:
    """Solver of the contact QPs of a problem; see :class:`contact_solver.ContactSolver`.

    Attributes:
        solution: Of the last dual.
    """

    def __init__(self, problem: Problem, pieces: Subdomains, linear: LinearSolver) -> None:
        """Glue the pieces. Collective.

        Args:
            problem: The bodies.
            pieces: What they are cut into.
            linear: Counts what is solved.
        """
        self._problem, self._linear, self._comm = problem, linear, problem.comm
        self._gluing = make_gluing(problem, pieces)
        self._dual = DualOperator(self._comm, pieces, self._gluing)
        self._delta, self._nodal = problem.create_vector(), problem.create_vector()
        self._torn = self._gluing.B.createVecRight()
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self._multipliers = np.zeros(self._dual.size)
        self.solution: DualSolution | None = None

    def set_operator(self, A: TornStiffness) -> None:
        """Take a new stiffness, or the same with new values. Collective.

        Raises:
            LinearFailure: If it is singular beyond rigid motions.
        """
        A.factorise()
        self._linear.setups += 1
        self._dual.set_stiffness(A)

    def solve(
        self,
        r: PETSc.Vec,
        room: Floats,
        active: PairFlags,
        rtol: float,
        exact: bool = True,
        work: float | None = None,
        given: Held = NOTHING_HELD,
        first: float = 0.0,
    ) -> ContactStep:
        """Solve the contact QP. Collective.

        Args:
            r: Gradient at δ = 0, in the jump basis.
            room: How far each pair hosted here may still close, shape (num_pairs,).
            active: Of no use here.
            rtol: Relative tolerance.
            exact: The same; which pairs are closed is always right.
            work: ℓᵀδ if it is prescribed, where ℓ are the loads.
            given: Nothing, as there is no friction here.
            first: Of no use here.

        Raises:
            LinearFailure: If the dual cannot be solved.
        """
        every = np.ones(len(room), dtype=np.bool_)
        border, length = (None, 1.0) if work is None else self._work_row()
        self._dual.put_in_force(every, border)
        lower = np.full(self._dual.size, -np.inf)
        lower[self._dual.contact] = 0.0
        c = self._limits(room, 0.0 if work is None else work / length)
        multipliers = self._minimise(r, c, lower, rtol)
        jumps, forces = room, multipliers[self._dual.contact]
        delta = self._delta.array_r[self._problem.basis.index]
        closed: PairFlags = forces > 0
        self._delta.array[self._problem.basis.index] = np.where(
            closed, jumps, np.minimum(delta, jumps)
        )
        share = self._comm.bcast(float(multipliers[-1]) if self._comm.rank == 0 else 0.0)
        return ContactStep(self._delta, closed, True, 1, -share / length, np.zeros(0))

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """δ with Kδ = load where these pairs keep their jumps and all others are free. Collective.

        Args:
            load: In nodal unknowns.
            held: Shape (num_pairs,).
            rtol: Relative tolerance.
            given: Nothing, as there is no friction here.

        Returns:
            In the jump basis; valid until the next solve.

        Raises:
            LinearFailure: If the dual cannot be solved.
        """
        self._dual.put_in_force(held, None)
        self._multipliers[:] = 0
        self._problem.basis.T.multTranspose(load, self._delta)
        self._delta.scale(-1)
        lower = np.full(self._dual.size, -np.inf)
        self._minimise(self._delta, self._limits(np.zeros(len(held)), 0.0), lower, rtol)
        self._multipliers[:] = 0
        self._delta.array[self._problem.basis.index[held]] = 0
        return self._delta

    def _limits(self, room: Floats, work: float) -> Floats:
        """c of all rows."""
        c = np.zeros(self._dual.size)
        c[self._dual.contact] = room / self._gluing.length
        if self._comm.rank == 0:
            c[-1] = work
        return c

    def _work_row(self) -> tuple[Floats, float]:
        """ℓ on torn unknowns, and by what it was divided. Collective."""
        self._problem.loads.live.copy(self._nodal)
        row = self._spread()
        length = float(np.sqrt(self._comm.allreduce(float(row @ row))))
        return row / length, length

    def _spread(self) -> Floats:
        """Nodal forces, in equal shares on the copies of free nodes. Collective."""
        self._nodal.array[self._fixed] = 0
        self._gluing.mean.multTranspose(self._nodal, self._torn)
        forces: Floats = self._torn.array_r.copy()
        return forces

    def _minimise(self, r: PETSc.Vec, c: Floats, lower: Floats, rtol: float) -> Floats:
        """Solve for δ; returns λ. Collective."""
        dual, coarse, K = self._dual, self._dual.coarse, self._dual.stiffness
        P, basis = coarse.project, self._problem.basis
        basis.M.multTranspose(r, self._nodal)
        self._nodal.scale(-1)
        f = self._spread()
        before = self._multipliers
        if self._comm.rank == 0:
            before[-1] = 0
        d = dual.rows(K.solve(f)) - c
        missing = coarse.lift(coarse.solve(coarse.resultants(f) - coarse.balance(before)))
        shift = before + missing
        moved = dual.multiply(shift)
        program = DualProgram(
            comm=self._comm,
            multiply=lambda x: P(dual.multiply(x)),
            project=P,
            precondition=dual.lumped,
            norm=dual.norm,
            b=P(d - moved),
            lower=lower - shift,
        )
        size, length = program.length(program.b), program.length
        jumps = max(SHARPER * rtol * size, ROUNDING * (length(d) + length(moved)))
        forces = SHARPER * rtol * max(length(missing), size / max(dual.norm, 1e-300))
        forces = max(forces, ROUNDING * length(shift))
        found = solve_dual(program, np.zeros(dual.size), jumps, forces, MOST_PRODUCTS)
        self.solution = found
        self._linear.solves += 1
        self._linear.iterations += found.products
        if not found.solved:
            raise LinearFailure(
                f"the contact program could not be solved (T-FETI: {found.products} products with"
                f" the dual operator leave {found.off:.2g} of the balance of subdomains), as where"
                " loads pull bodies off each other or everything flows plastically"
            )
        multipliers = np.maximum(shift + found.x, np.where(np.isfinite(lower), lower, -np.inf))
        multipliers = np.where(found.x <= program.lower, lower, multipliers)
        gradient = dual.multiply(multipliers) - d
        amplitudes = coarse.solve(coarse.balance(gradient - found.multiplier))
        u = K.solve(f - dual.forces(multipliers)) + coarse.motion(amplitudes)
        self._torn.array[:] = u
        self._gluing.mean.mult(self._torn, self._nodal)
        self._nodal.array[self._fixed] = 0
        basis.M.mult(self._nodal, self._delta)
        self._multipliers = multipliers
        return multipliers
