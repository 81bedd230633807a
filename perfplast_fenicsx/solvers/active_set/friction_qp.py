"""Solve the contact QP of one Newton step with friction.

    minimise ½ δᵀAδ + rᵀδ + Σ c‖s + δ_t‖  subject to  δ_s ≤ room

Each linearisation of friction (:mod:`slip`) leaves a contact QP, in which tangential jumps are held
at sticking places and have forces and springs at slipping ones. If the linearisations do not
converge, a dense program decides (:mod:`condensed_friction`). In space and with many places,
splitting (:mod:`friction_splitting`) approaches the solution instead. The linearisations then
continue from there.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.condensed_friction import (
    condensable,
    condense_friction,
)
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactProgram, ContactStep
from perfplast_fenicsx.solvers.active_set.equality_qp import Held, QuadraticModel
from perfplast_fenicsx.solvers.active_set.friction_splitting import FrictionSplitting
from perfplast_fenicsx.solvers.active_set.slip import (
    DRAG,
    Slip,
    distance,
    forces_of,
    judge,
    springs,
)
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


@dataclass(frozen=True)
class FrictionStep:
    """Solution of one contact QP with friction.

    Attributes:
        step: Solution of the last linearisation; not settled if the next one differs.
        slip: The next linearisation.
        turns: Whether some places change between stick and slip in the next linearisation.
    """

    step: ContactStep
    slip: Slip
    turns: bool


@dataclass(frozen=True)
class FrictionModel:
    """The data of a contact QP with friction.

    Attributes:
        r: Gradient at δ = 0 of all but friction.
        room: How far each pair hosted here may still close, shape (num_pairs,).
        jumps: Tangential jumps s at δ = 0, shape (num_places, gdim − 1).
        rtol: Relative tolerance of the linear solves.
        work: ℓᵀδ if it is prescribed, where ℓ are the loads.
        first: Largest force where the level began.
    """

    r: PETSc.Vec
    room: Floats
    jumps: Floats
    rtol: float
    work: float | None = None
    first: float = 0.0


class FrictionProgram:
    """A solver of the contact QPs of a problem with friction."""

    def __init__(self, problem: Problem, program: ContactProgram) -> None:
        """Store the data that all steps share. Collective."""
        self._problem, self._program = problem, program
        self._r = problem.create_vector()
        self._stiffness: Floats | None = None
        self._operator: ContactOperator | None = None
        self._image = problem.create_vector()
        self._drag = DRAG

    def begin(self) -> None:
        """Begin a level with the full drag."""
        self._drag = DRAG

    def set_operator(self, A: ContactOperator) -> None:
        """Take a new operator A in the jump basis, or the same one with new values. Collective."""
        self._operator = A
        if self._stiffness is None:
            self._stiffness = self._problem.friction.gather(A.diagonal()).max(axis=1)

    def solve(
        self, asked: FrictionModel, active: PairFlags, slip: Slip, most_sets: int | None = None
    ) -> FrictionStep:
        """Solve the contact QP with friction. Collective.

        Args:
            asked: The data.
            active: Active set to begin with.
            slip: Linearisation to begin with.
            most_sets: Solve with one linearisation, and no more sets of held pairs; None to go on
                until both are right.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        found = self._linearise(asked, active, slip, most_sets)
        condenses = condensable(self._program.equality, self._problem.friction)
        # Number of splitting steps each time that places alternate between stick and slip.
        splittings = (20, 80, 320)
        ways = () if most_sets is not None else (0,) if condenses else splittings
        for steps in ways:
            if found.step.settled or not found.turns:
                break
            begun = found.step.iterations
            if condenses:
                slip, active, iterations = self._condense(asked)
            else:
                slip, active, iterations = self._split(asked, found.step, steps)
            found = self._linearise(asked, active, slip, most_sets)
            iterations += begun + found.step.iterations
            found = replace(found, step=replace(found.step, iterations=iterations))
        return found

    def _linearise(
        self, asked: FrictionModel, active: PairFlags, slip: Slip, most_sets: int | None
    ) -> FrictionStep:
        """Solve successive linearisations until they converge, or only one. Collective."""
        assert self._operator is not None and self._stiffness is not None
        friction, k, comm, jumps = (
            self._problem.friction,
            self._stiffness,
            self._problem.comm,
            asked.jumps,
        )
        iterations = 0
        most_linearisations = 20
        # Distance from the friction law, relative to the largest force, that counts as zero.
        least_distance = 1e-9
        for _ in range(most_linearisations):
            asked.r.copy(self._r)
            friction.add(forces_of(slip, friction.bound, jumps), self._r.array)
            self._operator.add_springs((friction.index, springs(slip, k, self._drag)))
            self._program.set_operator(self._operator)
            held = Held(friction.unknowns(slip.sticks), -jumps[self._there(slip)])
            step = self._program.solve(
                self._r, asked.room, active, asked.rtol, most_sets, asked.work, held, asked.first
            )
            iterations += step.iterations
            after = jumps + friction.jumps(step.delta)
            forces = forces_of(slip, friction.bound, after)
            forces[self._there(slip)] = step.held_forces
            following = judge(slip, friction.bound, k, forces, after)
            off = distance(friction.bound, k, forces, after)
            finite = np.where(np.isfinite(friction.bound), friction.bound, 0.0)
            largest = np.maximum(finite, norms(forces))
            worst = np.array([off.max(initial=0), largest.max(initial=0)])
            comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
            changes = comm.allreduce(int((following.sticks != slip.sticks).sum()))
            settled = changes == 0 and worst[0] <= least_distance * worst[1]
            last, slip, active = slip, following, step.active
            if settled or most_sets is not None:
                break
        settled = settled and step.settled
        self._loosen(last, after - jumps, step.delta)
        return FrictionStep(
            replace(step, settled=settled, iterations=iterations), slip, changes > 0
        )

    def _loosen(self, slip: Slip, change: Floats, delta: PETSc.Vec) -> None:
        """Reduce the drag in the next step if little else resisted this step. Collective."""
        assert self._operator is not None and self._stiffness is not None
        self._r.set(0)
        self._operator.mult_add(delta, self._r, self._image)
        resisted = self._image.dot(delta)
        along = np.einsum("ni,ni->n", slip.along, change)
        dragged = float(self._problem.comm.allreduce(self._stiffness @ along**2)) * self._drag
        # Range of the drag's share in the resistance to a step in which it is too strong. Below the
        # range it hardly matters; above it nothing else resists, and less drag would let a body
        # move too far.
        low, high = 0.1, 0.9
        if low * resisted < dragged < high * resisted:
            # Factor by which drag is weakened, and its lower limit relative to the bodies'
            # stiffness, at which linear systems still have some digits.
            looser, least_drag = 0.1, 1e-11
            self._drag = max(looser * self._drag, least_drag)

    def _condense(self, asked: FrictionModel) -> tuple[Slip, PairFlags, int]:
        """Solve for pairs and places alone; see :func:`condense_friction`. Collective."""
        assert self._operator is not None
        self._operator.add_springs(None)
        self._program.set_operator(self._operator)
        asked.r.copy(self._r)
        model = QuadraticModel(self._r, asked.room, asked.work, asked.rtol, first=asked.first)
        friction = self._problem.friction
        return condense_friction(self._program.equality, model, friction, asked.jumps)

    def _split(
        self, asked: FrictionModel, last: ContactStep, steps: int
    ) -> tuple[Slip, PairFlags, int]:
        """Take steps of splitting from the last solution. Collective.

        Returns:
            The resulting linearisation and active set; and the number of solved systems.
        """
        assert self._operator is not None and self._stiffness is not None
        friction, active, iterations = self._problem.friction, last.active, 0
        splitting = FrictionSplitting(self._problem, self._operator, self._stiffness)
        self._program.set_operator(self._operator)
        splitting.begin(asked.jumps + friction.jumps(last.delta))
        for _ in range(steps):
            asked.r.copy(self._r)
            splitting.add_gradient(asked.jumps, 1.0, self._r)
            step = self._program.solve(
                self._r, asked.room, active, asked.rtol, None, asked.work, first=asked.first
            )
            splitting.follow(asked.jumps + friction.jumps(step.delta), 1.0)
            active, iterations = step.active, iterations + step.iterations
        return splitting.slip(), active, iterations

    def _there(self, slip: Slip) -> np.ndarray:
        """Return the held jumps, shape of ``index``."""
        return slip.sticks[:, None] & (self._problem.friction.index >= 0)
