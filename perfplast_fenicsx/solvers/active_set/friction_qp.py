"""Solve the contact QP of one Newton step with friction.

minimise ½ δᵀAδ + rᵀδ + Σ c‖s + δ_t‖  subject to  δ_s ≤ room

Each linearisation of friction gives a contact QP. In this QP, tangential jumps are held at sticking
points; slipping points have forces and springs. If the linearisations do not converge, a dense
program determines the solution. In 3D, or with many points, the splitting below approaches the
solution instead, and the linearisations then continue from its result.

The linearisation refers to the friction law ‖μ‖ ≤ c, μ = c s/‖s‖, and determines which points stick
and which slip. This law is equivalent to μ = c z/max(c, ‖z‖) with z = μ + k s for any stiffness k >
0. If ‖z‖ ≤ c, the point sticks, s = 0. Otherwise Newton's method for this equation (S. Hüeber, G.
Stadler, B. I. Wohlmuth, SIAM J. Sci. Comput. 30 (2008), 572) requires

    μ = c ẑ + c k/(‖z‖ − c) (I − ẑẑᵀ) s,   ẑ = z/‖z‖,

which is a force, and springs perpendicular to it. No tangential direction is preferred.

The splitting introduces a separate slip q that follows the jumps s of u, as the separate strains e
of ALG2 follow ε(u). With the multiplier μ of s = q, and the penalty r k at a point with the
stiffness k:

1. u minimises the energy with ½ r k ‖s − q + μ/(r k)‖² added,
2.  q = shrink(s + μ/(r k)) by c/(r k),
3. μ ← μ + r k (s − q), which lies in the ball ‖μ‖ ≤ c.

No point is held or released, so the method converges to the solution, though possibly slowly,
however many points are undecided. The splitting is the friction method of ALG2, and the fallback of
Newton's methods if their linearisations cycle.

In plane meshes with few pairs and points, a dense program determines which pairs are closed and
which points slip: minimise ½ zᵀSz − gᵀz over z ≥ 0.

Relative to the state in which all pairs are closed and all points stick, z contains the openings of
pairs and the slips of points in both directions. S is their stiffness, and g is the energy gained
per unit of each, minus the bound c for a slip. This solution is exact even if successive
linearisations cycle, as for a pin that rolls in its hole.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import Friction, norms, shrunk
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import (
    TOLERANCE,
    ContactProgram,
    ContactStep,
    openings,
)
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    Held,
    QuadraticModel,
)
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator

DRAG = 1e-8
"""Stiffness, relative to the stiffness of the bodies, of springs that resist changes of slip in a
step. The springs hold a body that slips everywhere. Their forces vanish as the steps tend to
zero."""


@dataclass(frozen=True)
class Slip:
    """The state of the points of friction hosted by this rank: stick, or slip in a direction.

    Attributes:
        sticks: Whether the jump of each point is zero, shape (num_places,).
        along: ẑ at slipping points, zero at sticking points, shape (num_places, gdim − 1).
        across: Stiffness of the springs perpendicular to ẑ (force/length), shape (num_places,).
    """

    sticks: npt.NDArray[np.bool_]
    along: Floats
    across: Floats


def stuck(shape: tuple[int, ...]) -> Slip:
    """Return the linearisation of friction in which no point slips.

    Args:
        shape: Shape of the jumps.
    """
    return Slip(np.ones(shape[0], dtype=np.bool_), np.zeros(shape), np.zeros(shape[0]))


def slipping(jumps: Floats, bound: Floats, slips: npt.NDArray[np.bool_]) -> Slip:
    """Return the linearisation of friction at given jumps.

    Args:
        jumps: Jumps s, shape (num_places, gdim − 1).
        bound: Bounds c, shape (num_places,).
        slips: Whether each point with a nonzero jump slips; points without friction slip too.
    """
    sizes = norms(jumps)
    along = np.divide(jumps, sizes[:, None], out=np.zeros_like(jumps), where=slips[:, None])
    across = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
    return Slip(~slips & (bound > 0), along, across)


def judge(slip: Slip, bound: Floats, stiffness: Floats, forces: Floats, jumps: Floats) -> Slip:
    """Return the linearisation at the forces and jumps that follow from the last linearisation.

    A point that slips in the wrong direction first becomes a sticking point. Without this rule, the
    slip of a body that slips at all its points would reverse at each step.

    Args:
        slip: The last linearisation.
        bound: Bounds c, shape (num_places,).
        stiffness: Stiffness k > 0, shape (num_places,).
        forces: Forces μ, shape (num_places, gdim − 1).
        jumps: Jumps s, same shape.
    """
    z = forces + stiffness[:, None] * jumps
    sizes = norms(z)
    turned = ~slip.sticks & (np.einsum("ni,ni->n", slip.along, jumps) <= 0)
    sticks = ((sizes <= bound) | turned) & (bound > 0)
    slips = ~sticks & (sizes > 0)
    along = np.zeros_like(z)
    np.divide(z, sizes[:, None], out=along, where=slips[:, None])
    across = np.zeros_like(bound)
    beyond = slips & (sizes > bound)
    np.divide(bound * stiffness, sizes - bound, out=across, where=beyond)
    return Slip(sticks, along, across)


def distance(bound: Floats, stiffness: Floats, forces: Floats, jumps: Floats) -> Floats:
    """Return ‖μ − c z/max(c, ‖z‖)‖, zero if the friction law holds, shape (num_places,)."""
    return norms(forces - shrunk(forces + stiffness[:, None] * jumps, bound))


def springs(slip: Slip, stiffness: Floats, drag: float = DRAG) -> Floats:
    """Return spring stiffnesses, shape (num_places, gdim − 1, gdim − 1), 0 at sticking points."""
    along = np.einsum("ni,nj->nij", slip.along, slip.along)
    every = np.eye(along.shape[1])
    dragged = np.where(slip.sticks, 0.0, drag * stiffness)
    return slip.across[:, None, None] * (every - along) + dragged[:, None, None] * every


def forces_of(slip: Slip, bound: Floats, jumps: Floats) -> Floats:
    """Return the linearised forces μ at the jumps, same shape; 0 at sticking points."""
    off = jumps - np.einsum("ni,ni->n", slip.along, jumps)[:, None] * slip.along
    slips = ~slip.sticks
    finite = np.where(slips, bound, 0.0)
    return finite[:, None] * slip.along + slip.across[:, None] * off


class FrictionSplitting:
    """The slip q and the multiplier μ at the points of friction hosted by this rank."""

    def __init__(self, problem: Problem, operator: ContactOperator, stiffness: Floats) -> None:
        """Add the springs to an operator. Collective.

        Args:
            problem: Problem with friction.
            operator: Operator of the bodies without springs.
            stiffness: Stiffness k, shape (num_places,).
        """
        self._problem, self._k, friction = problem, stiffness, problem.friction
        each = self._k[:, None, None] * np.eye(friction.index.shape[1])
        operator.add_springs((friction.index, each))
        self._q, self._mu = np.zeros(friction.index.shape), np.zeros(friction.index.shape)

    def begin(self, jumps: Floats) -> None:
        """Start from the slip ``jumps`` and the friction forces that belong to this slip."""
        sizes, bound = norms(jumps), self._problem.friction.bound
        self._q = jumps.copy()
        slips = (sizes > 0) & np.isfinite(bound)
        share = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
        self._mu = share[:, None] * jumps

    def slip(self) -> Slip:
        """Return the linearisation at μ + k q, the last trial force if its step had r = 1."""
        z = self._mu + self._k[:, None] * self._q
        nothing = stuck(z.shape)
        return judge(nothing, self._problem.friction.bound, self._k, z, np.zeros_like(z))

    def add_gradient(self, jumps: Floats, r: float, gradient: PETSc.Vec) -> None:
        """Add (μ + r k (s − q))/r to a gradient in jump unknowns."""
        force = self._mu / r + self._k[:, None] * (jumps - self._q)
        self._problem.friction.add(force, gradient.array)

    def follow(self, jumps: Floats, r: float) -> Floats:
        """Perform steps 2 and 3, and return the squared residuals. Collective.

        Returns:
            Squares of the primal and the dual residual, Σ k‖s − q‖² and Σ k‖Δq‖².
        """
        stiffness, before = r * self._k[:, None], self._q
        trial = self._mu + stiffness * jumps
        self._mu = shrunk(trial, self._problem.friction.bound)
        self._q = (trial - self._mu) / stiffness
        squares = [self._k @ norms(v) ** 2 for v in (jumps - self._q, self._q - before)]
        return np.asarray(self._problem.comm.allreduce(np.array(squares)), dtype=np.float64)


def condensable(program: EqualityProgram, friction: Friction) -> bool:
    """Return whether slip has only two directions, and pairs and points are few. Collective."""
    most_unknowns = 300  # largest number of condensed pairs and points
    few = program.comm.allreduce(len(program.index) + len(friction.index)) <= most_unknowns
    return few and friction.index.shape[1] == 1


def condense_friction(
    program: EqualityProgram, model: QuadraticModel, friction: Friction, jumps: Floats
) -> tuple[Slip, PairFlags, int]:
    """Solve the contact QP with friction for all pairs and points at once. Collective.

    The function solves one linear system for each pair and each point, with one set-up.

    Args:
        program: Equality-constrained QPs of the operator without springs.
        model: The function to be minimised; ``jumps`` is the current gap of each pair.
        friction: Friction data.
        jumps: Tangential jumps at δ = 0, shape (num_places, 1).

    Returns:
        The linearisation and the closed pairs of the solution, and the number of solved systems.

    Raises:
        LinearFailure: If a linear system cannot be solved.
    """
    there, closed = friction.index[:, 0] >= 0, np.ones(len(program.index), dtype=np.bool_)
    places, given = friction.index[there, 0], -jumps[there, 0]
    unknowns = np.concatenate([program.index, places])
    last = program.comm.scan(len(unknowns))
    count, mine = program.comm.allreduce(len(unknowns)), slice(last - len(unknowns), last)
    delta, gradient, nothing = (model.r.duplicate() for _ in range(3))
    columns = np.zeros((count, count + 1))
    model = replace(model, rtol=TOLERANCE, given=Held(places, given))
    try:
        for number in range(count + 1):
            column = model
            if number < count:
                unit = np.zeros(len(unknowns))
                if mine.start <= number < mine.stop:
                    unit[number - mine.start] = 1.0
                pairs, values = np.split(unit, [len(program.index)])
                work = None if model.work is None else 0.0
                held = Held(places, values)
                column = QuadraticModel(nothing, pairs, work, TOLERANCE, held)
            solution = program.minimise(column, closed, delta)
            program.gradient(solution, gradient)
            columns[mine, number] = gradient.array_r[unknowns]
    finally:
        for vector in (delta, gradient, nothing):
            vector.destroy()
    bound, kind = np.zeros((2, count))
    bound[mine] = np.concatenate([np.zeros(len(program.index)), friction.bound[there]])
    kind[mine] = np.repeat([0.0, 1.0], [len(program.index), len(places)])
    columns, bound, kind = (program.comm.allreduce(array) for array in (columns, bound, kind))
    move = moves_of(columns[:, :count], columns[:, count], bound, kind > 0)[mine]
    opens, slips = np.split(move, [len(program.index)])
    sign = np.zeros(len(there))
    sign[there] = np.sign(slips)
    sticks = (sign == 0) & (friction.bound > 0)
    slip = Slip(sticks, sign[:, None], np.zeros(len(there)))
    return slip, opens == 0, count + 1


def moves_of(S: Floats, G: Floats, bound: Floats, is_place: np.ndarray) -> Floats:
    """Return scaled openings of pairs (negative) and slips of points, shape (n,).

    Only the signs of the result matter.

    Args:
        S: Force on each unknown for a unit jump of each unknown, shape (n, n).
        G: Gradient with all pairs closed and all points sticking.
        bound: Bounds c of the points.
        is_place: Whether each entry is a point of friction.
    """
    pairs, places = np.flatnonzero(~is_place), np.flatnonzero(is_place & np.isfinite(bound))
    which = np.concatenate([pairs, places, places])
    sign = np.repeat([-1.0, 1.0, -1.0], [len(pairs), len(places), len(places)])
    forces = -sign * G[which] - bound[which]
    z = openings(sign[:, None] * S[np.ix_(which, which)] * sign, forces)
    moves = np.zeros(len(G))
    np.add.at(moves, which, sign * z)
    return moves


@dataclass(frozen=True)
class FrictionStep:
    """Solution of one contact QP with friction.

    Attributes:
        step: Solution of the last linearisation; not settled if the next linearisation differs.
        slip: The next linearisation.
        turns: Whether any point changes between stick and slip in the next linearisation.
    """

    step: ContactStep
    slip: Slip
    turns: bool


@dataclass(frozen=True)
class FrictionModel:
    """The data of a contact QP with friction.

    Attributes:
        r: Gradient at δ = 0 without friction.
        room: Current gap of each pair hosted by this rank, shape (num_pairs,).
        jumps: Tangential jumps s at δ = 0, shape (num_places, gdim − 1).
        rtol: Relative tolerance of the linear solves.
        work: Required ℓᵀδ with the loads ℓ; None if it is not prescribed.
        first: Largest force at the start of the level.
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
        """Start a level with the initial drag, the relative spring stiffness at slipping points."""
        self._drag = DRAG

    def set_operator(self, A: ContactOperator) -> None:
        """Set a new operator A in the jump basis, or the same operator with new values.

        Collective.
        """
        self._operator = A
        if self._stiffness is None:
            self._stiffness = self._problem.friction.gather(A.diagonal()).max(axis=1)

    def solve(
        self, asked: FrictionModel, active: PairFlags, slip: Slip, most_sets: int | None = None
    ) -> FrictionStep:
        """Solve the contact QP with friction. Collective.

        Args:
            asked: The data of the QP.
            active: Initial active set.
            slip: Initial linearisation.
            most_sets: Largest number of active sets in a single linearisation; None to continue
                until linearisation and active set are correct.

        Raises:
            LinearFailure: If a linear system cannot be solved.
        """
        found = self._linearise(asked, active, slip, most_sets)
        condenses = condensable(self._program.equality, self._problem.friction)
        # Numbers of splitting steps, for each time that points alternate between stick and slip.
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
        """Solve successive linearisations until they converge, or only one of them. Collective."""
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
        """Reduce the drag for the next step if little else resisted this step. Collective."""
        assert self._operator is not None and self._stiffness is not None
        self._r.set(0)
        self._operator.mult_add(delta, self._r, self._image)
        resisted = self._image.dot(delta)
        along = np.einsum("ni,ni->n", slip.along, change)
        dragged = float(self._problem.comm.allreduce(self._stiffness @ along**2)) * self._drag
        # The drag is too strong if its fraction of the resistance to a step is in this range. Below
        # the range it hardly matters; above it nothing else resists, and less drag would let a body
        # move too far.
        low, high = 0.1, 0.9
        if low * resisted < dragged < high * resisted:
            # Factor by which the drag is reduced, and its lower limit relative to the stiffness of
            # the bodies, at which solutions of linear systems still have some correct digits.
            looser, least_drag = 0.1, 1e-11
            self._drag = max(looser * self._drag, least_drag)

    def _condense(self, asked: FrictionModel) -> tuple[Slip, PairFlags, int]:
        """Solve for pairs and points only; see :func:`condense_friction`. Collective."""
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
        """Perform splitting steps from the last solution. Collective.

        Returns:
            The resulting linearisation and active set, and the number of solved systems.
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
        """Return which jumps are held, same shape as :attr:`Friction.index`."""
        return slip.sticks[:, None] & (self._problem.friction.index >= 0)
