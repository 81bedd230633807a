"""Solve the contact QP of one Newton step by Total FETI, in its dual form on torn bodies.

minimise ½ δᵀKδ + rᵀδ subject to B_E δ = 0, B_I δ ≤ room and, if requested, ℓᵀδ = work

Supports are rows too, so the kernel of each piece's stiffness consists of its rigid motions (Z.
Dostál, D. Horák, R. Kučera, Commun. Numer. Meth. Engng 22 (2006), 1155). Contact is the bound λ_I ≥
0 on the multipliers, so the same factors serve for any closed pairs.

First the dual is solved on the face of the previous step: closed pairs are equalities, and open
pairs are omitted. Pairs whose error exceeds the residual of the jumps are then opened or closed,
and the dual is solved again. If this cycles or frees a body, SMALBE-M and MPRGP find the face.

:class:`TornProgram` solves one dual program: it holds the active rows and bounds, and computes δ
from the multipliers. With F = B K⁺Bᵀ, d = B K⁺f − c, G = RᵀBᵀ and e = Rᵀf, the program

    minimise ½ λᵀFλ − dᵀλ  where  Gλ = e,  λ ≥ lower

is solved for the difference x between λ and forces that balance every piece, so Gx = 0. The
gradient Fλ − d is the jump of the rows, apart from rigid motions Rα of the pieces; α are the
multipliers of Gλ = e.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactStep
from perfplast_fenicsx.solvers.active_set.equality_qp import NOTHING_HELD, ROUNDING, Held
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure, LinearSolver
from perfplast_fenicsx.solvers.tfeti.dual_operator import DualOperator
from perfplast_fenicsx.solvers.tfeti.gluing import TornBodies, make_gluing
from perfplast_fenicsx.solvers.tfeti.preconditioners import DirichletPreconditioner
from perfplast_fenicsx.solvers.tfeti.smalbe import DualProgram, Operator, Smalbe
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains, TornStiffness


class TornProgram:
    """The dual of one contact QP while it is solved. All methods are collective.

    Attributes:
        smalbe: The iteration.
        jumps: Scale of the jumps, to which the tolerance of jumps refers.
        forces: Scale of the multipliers that close these jumps.
    """

    def __init__(
        self,
        dual: DualOperator,
        precondition: Operator,
        f: Floats,
        c: Floats,
        lower: Floats,
        start: Floats,
    ) -> None:
        """Start from given multipliers.

        Args:
            dual: F for the active rows.
            precondition: Function that approximates the inverse of F.
            f: Forces on torn unknowns.
            c: Required values of the rows, or their upper bounds.
            lower: Bounds of λ.
            start: Initial λ.
        """
        coarse, K, comm = dual.coarse, dual.stiffness, dual.comm
        self._dual, self._f, self._lower = dual, f, lower
        self._d = dual.rows(K.solve(f)) - c
        missing = coarse.lift(coarse.solve(coarse.resultants(f) - coarse.balance(start)))
        self._shift = start + missing
        moved = dual.multiply(self._shift)
        P = coarse.project
        program = DualProgram(
            comm=comm,
            multiply=lambda x: P(dual.multiply(x)),
            project=P,
            precondition=precondition,
            norm=dual.norm,
            b=P(self._d - moved),
            lower=lower - self._shift,
        )
        length = program.length
        self.jumps = length(program.b)
        self.forces = max(length(missing), self.jumps / dual.norm if dual.norm > 0 else 0.0)
        # Relative residual of forces and jumps that counts as a rounding error.
        rounding = 1e-14
        self._least_jumps = rounding * (length(self._d) + length(moved))
        self._least_forces = rounding * length(self._shift)
        self.smalbe = Smalbe(program, np.zeros(dual.size))

    def run(self, rtol: float, most: int) -> bool:
        """Iterate until jumps and unbalanced forces are small.

        Args:
            rtol: Tolerance relative to ``jumps`` and ``forces``; rounding errors are accepted.
            most: Largest number of products with F.

        Returns:
            Whether jumps and unbalanced forces are small.
        """
        jumps = max(rtol * self.jumps, self._least_jumps)
        forces = max(rtol * self.forces, self._least_forces)
        return self.smalbe.run(jumps, forces, most)

    def at_rounding(self, rtol: float) -> bool:
        """Return whether a smaller tolerance would be below rounding errors."""
        return rtol * self.jumps <= self._least_jumps and rtol * self.forces <= self._least_forces

    def multipliers(self) -> Floats:
        """Return λ, exactly within its bounds."""
        bounded = self.smalbe.x <= self._lower - self._shift
        return np.where(bounded, self._lower, np.maximum(self._shift + self.smalbe.x, self._lower))

    def displacement(self, multipliers: Floats) -> Floats:
        """Return δ on torn unknowns."""
        coarse, K, dual = self._dual.coarse, self._dual.stiffness, self._dual
        gradient = dual.multiply(multipliers) - self._d
        amplitudes = coarse.solve(coarse.balance(gradient - self.smalbe.multiplier))
        return K.solve(self._f - dual.forces(multipliers)) + coarse.motion(amplitudes)


@dataclass(frozen=True)
class Asked:
    """The data of a contact QP.

    Attributes:
        r: Gradient at δ = 0, in the jump basis.
        f: The forces −r on torn unknowns.
        room: Current gap of each pair, shape (num_pairs,).
        work: Required ℓᵀδ, scaled like the border; None if it is not prescribed.
        accuracy: Largest allowed norm of unbalanced nodal forces.
        noise: Contact forces up to this size do not affect the active set.
        rtol: Relative tolerance.
    """

    r: PETSc.Vec
    f: Floats
    room: Floats
    work: float | None
    accuracy: float
    noise: float
    rtol: float


MOST_EXCHANGES, MOST_SEARCHES = 20, 8
"""Largest number of faces that opening and closing wrong pairs may try, and that SMALBE-M may then
find."""

FIRST, SHARPER = 1e-3, 1e-2
"""Initial relative tolerance for finding faces, and the factor by which every further face reduces
it."""


MOVES = "a body can move as a rigid body because no closed pair holds it; it may lose all contact"


class TfetiProgram:
    """A solver of the contact QPs of a problem; see :class:`contact_solver.ContactSolver`.

    Attributes:
        multipliers: λ of the last solution, for rows of unit length; shape (num_rows,).
    """

    def __init__(self, problem: Problem, pieces: Subdomains, linear: LinearSolver) -> None:
        """Create the gluing matrix, the dual operator and the preconditioner. Collective.

        Args:
            problem: The bodies.
            pieces: The pieces of the bodies.
            linear: Linear solver, which counts the linear solves.
        """
        self._problem, self._linear, self._comm = problem, linear, problem.comm
        gluing = make_gluing(problem, pieces)
        self._length = gluing.length
        self._dual = DualOperator(self._comm, pieces, gluing, problem.free.count)
        self._bodies = TornBodies(problem, gluing)
        self._faces = DirichletPreconditioner(self._dual, gluing, problem.bodies.gdim)
        self._index = problem.basis.index
        self._delta, self._r, self._rest, self._loads = (problem.create_vector() for _ in range(4))
        problem.basis.T.multTranspose(problem.loads.live, self._loads)
        self.multipliers: Floats = np.zeros(self._dual.size)
        self._border: Floats = np.zeros(0)
        self._unit = 1.0
        self._programs = 0

    def set_operator(self, A: TornStiffness) -> None:
        """Set a new stiffness, or the same stiffness with new values. Collective.

        Raises:
            LinearFailure: If the stiffness is singular beyond rigid motions.
        """
        A.factorise()
        self._linear.setups += 1
        self._dual.set_stiffness(A)
        self._faces.set_stiffness(A)

    def solve(
        self,
        r: PETSc.Vec,
        room: Floats,
        active: PairFlags,
        rtol: float,
        most_sets: int | None = None,
        work: float | None = None,
        given: Held = NOTHING_HELD,
        first: float = 0.0,
    ) -> ContactStep:
        """Solve the contact QP. Collective.

        Args:
            r: Gradient at δ = 0, in the jump basis.
            room: Current gap of each pair hosted by this rank, shape (num_pairs,).
            active: Initial closed pairs.
            rtol: Relative tolerance.
            most_sets: Not used: the closed pairs are always exact.
            work: Required ℓᵀδ with the loads ℓ; None if it is not prescribed.
            given: Not used, because there is no friction.
            first: Largest force at the start of the level.

        Raises:
            LinearFailure: If the dual cannot be solved.
        """
        asked = self._ask(r, room, active, rtol, work, first)
        self._programs += 1
        self._forget()
        closed, searches = active, 0
        search: TornProgram | None = None
        seen: list[PairFlags] = []
        while True:
            seen.append(closed)
            last = searches == MOST_SEARCHES
            wrong = self._on_face(asked, closed, given=last)
            settled = wrong is not None and not self._comm.allreduce(int(wrong.sum()))
            if settled or last:
                break
            if not searches and wrong is not None and self._new(closed ^ wrong, seen):
                closed = closed ^ wrong
                continue
            search = search or self._search(asked)
            self._in_force(np.ones_like(active), asked)
            self._run(search, FIRST * SHARPER**searches)
            searches += 1
            closed = search.multipliers()[self._dual.contact] > 0
        if wrong is None:
            raise LinearFailure(MOVES)
        return self._step(asked, closed, settled, len(seen))

    def counts(self) -> tuple[int, int, int]:
        """Return the number of contact QPs so far, and zeros: SNES-VI solves none of them."""
        return self._programs, 0, 0

    def _new(self, closed: PairFlags, seen: list[PairFlags]) -> bool:
        """Return whether the face ``closed`` is new and few faces were tried. Collective."""
        again = np.array([(earlier == closed).all() for earlier in seen], dtype=np.int32)
        self._comm.Allreduce(MPI.IN_PLACE, again, MPI.MIN)
        return len(seen) < MOST_EXCHANGES and not again.any()

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """Return δ with Kδ = load, where the held pairs keep their jumps and all others are free.

        Collective.

        Args:
            load: Load in nodal unknowns.
            held: Pairs that keep their jumps, shape (num_pairs,).
            rtol: Relative tolerance.
            given: Not used, because there is no friction.

        Returns:
            δ in the jump basis; valid until the next solve.

        Raises:
            LinearFailure: If the dual cannot be solved.
        """
        self._problem.basis.T.multTranspose(load, self._r)
        self._r.scale(-1)
        asked = self._ask(self._r, np.zeros(len(held)), held, rtol, None, 0.0)
        self._forget(np.zeros(len(held)))
        if self._on_face(asked, held, given=True) is None:
            raise LinearFailure(MOVES)
        self._delta.array[self._index[held]] = 0
        return self._delta

    def _ask(
        self,
        r: PETSc.Vec,
        room: Floats,
        active: PairFlags,
        rtol: float,
        work: float | None,
        first: float,
    ) -> Asked:
        """Return the data of a QP, and set the border if work is prescribed. Collective."""
        if work is not None:
            row = self._bodies.shares(self._problem.loads.live)
            self._unit = float(np.sqrt(self._comm.allreduce(float(row @ row))))
            self._border = np.asarray(row / self._unit, dtype=np.float64)
            work = work / self._unit
        self._delta.set(0)
        self._delta.array[self._index[active]] = room[active]
        self._bodies.gradient(self._dual.stiffness, self._delta, r, self._rest)
        self._rest.array[self._index[active]] = 0
        largest = self._rest.norm(PETSc.NormType.NORM_INFINITY)
        force = max(first, r.norm(PETSc.NormType.NORM_INFINITY))
        accuracy = max(rtol * self._rest.norm(), ROUNDING * force)
        noise = max(rtol * largest, ROUNDING * force)
        return Asked(r, self._bodies.forces(r), room, work, accuracy, noise, rtol)

    def _forget(self, contact: Floats | None = None) -> None:
        """Reset λ to its contact forces, or to ``contact``, without the last gluing forces."""
        kept = self.multipliers[self._dual.contact] if contact is None else contact
        self.multipliers = np.zeros(self._dual.size)
        self.multipliers[self._dual.contact] = kept

    def _in_force(self, pairs: PairFlags, asked: Asked) -> None:
        self._dual.put_in_force(pairs, None if asked.work is None else self._border)

    def _program(self, asked: Asked, pairs: PairFlags, lower: Floats, start: Floats) -> TornProgram:
        """Return the dual with the rows of the given active pairs. Collective."""
        c = np.zeros(self._dual.size)
        c[self._dual.contact] = np.where(pairs, asked.room / self._length, 0.0)
        if self._comm.rank == 0:
            c[-1] = asked.work or 0.0
        return TornProgram(self._dual, self._faces.apply, asked.f, c, lower, start)

    def _search(self, asked: Asked) -> TornProgram:
        """Return the dual with all rows and their bounds. Collective."""
        every = np.ones(len(asked.room), dtype=np.bool_)
        self._in_force(every, asked)
        self._dual.measure()
        lower = np.full(self._dual.size, -np.inf)
        lower[self._dual.contact] = 0.0
        return self._program(asked, every, lower, np.maximum(self.multipliers, lower))

    def _run(self, program: TornProgram, rtol: float) -> None:
        """Solve a dual program until its tolerance is met. Collective.

        Raises:
            LinearFailure: If the dual cannot be solved.
        """
        before = program.smalbe.products
        # Number of products with F after which a dual counts as unsolvable.
        most_products = 3000
        solved = program.run(rtol, most_products)
        self._linear.iterations += program.smalbe.products - before
        if not solved:
            raise LinearFailure(
                f"the contact program could not be solved (T-FETI: after"
                f" {program.smalbe.products} products with the dual operator,"
                f" {program.smalbe.off:.2g} of the balance of subdomains is missing); perhaps"
                " loads pull bodies apart, or bodies flow plastically everywhere"
            )

    def _on_face(self, asked: Asked, closed: PairFlags, given: bool = False) -> PairFlags | None:
        """Solve for δ with the given pairs closed and the other pairs without force. Collective.

        Args:
            asked: The contact QP.
            closed: Closed pairs.
            given: Whether the closed pairs are fixed; if not, δ is inaccurate when some pairs are
                wrong.

        Returns:
            Pairs in the wrong state; None if a body moves freely.
        """
        self._linear.solves += 1
        try:
            self._in_force(closed, asked)
        except LinearFailure:
            return None
        start = self.multipliers.copy()
        start[self._dual.contact] *= closed
        program = self._program(asked, closed, np.full(self._dual.size, -np.inf), start)
        rtol = asked.rtol if given else max(asked.rtol, FIRST)
        # Fraction of the allowed unbalanced force at which the next solve aims, and lower limit of
        # the factor by which the tolerance changes.
        better, best = 0.3, 1e-3
        while True:
            self._run(program, rtol)
            self.multipliers = program.multipliers()
            self._bodies.glue(program.displacement(self.multipliers), self._delta)
            left = self._left(asked, closed)
            if left <= asked.accuracy or program.at_rounding(rtol):
                return self._wrong(asked, closed, 0.0)
            if not given:
                wrong = self._wrong(asked, closed, rtol)
                if self._comm.allreduce(int(wrong.sum())):
                    return wrong
            rtol *= max(better * asked.accuracy / left, best)

    def _wrong(self, asked: Asked, closed: PairFlags, margin: float) -> PairFlags:
        """Return which pairs are wrong by more than ``margin`` of the largest force or jump.

        Collective.
        """
        forces = self.multipliers[self._dual.contact] / self._length
        largest = self._comm.allreduce(float(np.abs(forces).max(initial=0)), MPI.MAX)
        excess = self._delta.array_r[self._index] - asked.room
        least = max(ROUNDING, asked.rtol, margin) * self._delta.norm(PETSc.NormType.NORM_INFINITY)
        noise = max(asked.noise, margin * largest)
        return np.asarray(np.where(closed, forces < -noise, excess > least))

    def _left(self, asked: Asked, closed: PairFlags) -> float:
        """Return the norm of the nodal forces that remain unbalanced at δ. Collective."""
        self._delta.array[self._index[closed]] = asked.room[closed]
        self._bodies.gradient(self._dual.stiffness, self._delta, asked.r, self._rest)
        if asked.work is not None:
            self._rest.axpy(-self._share(), self._loads)
        self._rest.array[self._index[closed]] = 0
        return float(self._rest.norm())

    def _share(self) -> float:
        """Return the multiplier of the work equality, which is a change of ζ. Collective."""
        last = float(self.multipliers[-1]) if self._comm.rank == 0 else 0.0
        return -self._comm.bcast(last) / self._unit

    def _step(self, asked: Asked, closed: PairFlags, settled: bool, faces: int) -> ContactStep:
        """Return the step on the last face; penetrating pairs are set to their bounds.

        Collective.
        """
        contact = self._dual.contact
        self.multipliers[contact] = np.maximum(self.multipliers[contact], 0.0)
        jumps = np.where(closed, asked.room, self._delta.array_r[self._index])
        self._delta.array[self._index] = np.minimum(jumps, asked.room)
        share = 0.0 if asked.work is None else self._share()
        return ContactStep(self._delta, closed, settled, faces, share, np.zeros(0))
