"""Implement the primal-dual interior point iteration for limit loads.

Each step factorises one stiffness. The stress at a point changes by moduli times a strain rate;
each kind of cone defines its moduli (:mod:`cone`). A step consists of Mehrotra's predictor and
corrector and of Gondzio's corrections (:class:`cone.Products`), all with the same factors. The
proximal point method determines the change of unbounded stresses (mean stresses, and all stresses
in elastic bodies). This method does not change the limit of the iteration.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import (
    PROXIMAL,
    Block,
    Borne,
    Members,
    Products,
)
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.statements.load_factor import measure_of
from perfplast_fenicsx.solvers.linear.conjugate_residuals import ConjugateResiduals

AT_REST = 1e-4
"""Strain rate, relative to the rates of a flow that dissipates, that counts as nearly zero."""

MOST_ROUNDS = 4
"""Largest number of rounds in which :func:`rebalance` restores equilibrium. After each round, the
function sets tensile contact forces to zero."""


@dataclass(frozen=True)
class Unknowns:
    """Static and kinematic unknowns of this rank, or their changes, in the program's units.

    Attributes:
        load: Load factor λ.
        aside: Factor of the free loads, 0 without such loads.
        borne: Stress at the points, and forces of the pairs.
        members: Members of the program's blocks; the contact pairs are the last block.
    """

    load: float
    aside: float
    borne: Borne
    members: tuple[Members, ...]

    @property
    def stress(self) -> tuple[Floats, Floats]:
        """Return the mean stress and the deviator, in the coordinates of the cones."""
        return self.borne.pressure, self.borne.deviator

    @property
    def forces(self) -> Floats:
        """Return the forces r of contact pairs, shape (num_pairs,)."""
        return self.borne.forces

    @property
    def rooms(self) -> Floats:
        """Return the slacks −[v] of contact pairs, shape (num_pairs,)."""
        return self.members[-1].kinematic

    def plus(self, t: float, change: "Unknowns") -> "Unknowns":
        """Return the unknowns plus t times a change."""
        both = zip(self.members, change.members, strict=True)
        return Unknowns(
            self.load + t * change.load,
            self.aside + t * change.aside,
            self.borne.plus(t, change.borne),
            tuple(members.plus(t, by) for members, by in both),
        )

    def bearing(self, borne: Borne, blocks: Sequence[Block]) -> "Unknowns":
        """Return the unknowns with the stress and forces ``borne``, and their static members."""
        both = zip(blocks, self.members, strict=True)
        members = (replace(it, static=block.static(borne, it.own)) for block, it in both)
        return replace(self, borne=borne, members=tuple(members))


@dataclass(frozen=True, eq=False)
class Direction:
    """A change of the unknowns, and of the entries of the velocity on this rank."""

    unknowns: Unknowns
    velocity: Floats


class Workspace:
    """Vectors that all steps use as work space.

    Attributes:
        balance: Unbalanced forces.
        right: Right-hand side of a linear system.
        change: Change of the velocity.
        motions: The motion under a unit factor of each load with an unknown factor.
    """

    def __init__(self, program: ConicProgram) -> None:
        """Create the vectors. Collective."""
        make = program.create_vector
        self.balance, self.right, self.change = make(), make(), make()
        self.motions = [make() for _ in program.loads]

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        for vector in (self.balance, self.right, self.change, *self.motions):
            vector.destroy()


class NewtonDirections:
    """Newton directions from one iterate, for given changes of the products of members.

    All directions use the factors of one K.
    """

    def __init__(
        self,
        program: ConicProgram,
        now: Unknowns,
        velocity: PETSc.Vec,
        work: Workspace,
        factorised: bool,
        proximal: float = PROXIMAL,
    ) -> None:
        """Assemble and factorise K, and compute the data that all directions share. Collective.

        Args:
            program: The program to solve.
            now: The current iterate.
            velocity: Velocity of the iterate.
            work: Work vectors; ``work.balance`` holds the unbalanced forces of the iterate.
            factorised: Whether the stiffness already holds the factors of K.
            proximal: Proximal parameter δ.
        """
        self._program, self._work = program, work
        self._blocks = program.blocks
        self._free = program.weights / proximal
        self._rates = program.rates_of(velocity)
        both = zip(self._blocks, now.members, strict=True)
        self._scaled = [block.scaled(members, self._rates) for block, members in both]
        if not factorised:
            moduli = program.moduli(1 / proximal)
            for scaled in self._scaled:
                moduli = scaled.stiffen(moduli)
            program.assemble(moduli)
            program.stiffness.factorise()
        for load, motion in zip(program.loads, work.motions, strict=True):
            program.stiffness.solve(load, motion)
        self._works = np.column_stack([program.works(motion) for motion in work.motions])
        self._missing = program.missing_works(velocity)

    def products(self, change: Unknowns | None = None) -> Products:
        """Return the products of the unknowns' members, or of a change of the unknowns."""
        if change is None:
            return Products(self._blocks, [scaled.products() for scaled in self._scaled])
        both = zip(self._scaled, change.members, strict=True)
        return Products(self._blocks, [scaled.products(members) for scaled, members in both])

    def towards(self, change: Products) -> Direction:
        """Return the direction that to first order changes the products by ``change``.

        Collective.

        Raises:
            SingularStiffness: If the loads do no work on any flow.
        """
        program, work, jumps = self._program, self._work, self._program.jumps
        aims = [it.aim(part) for it, part in zip(self._scaled, change.parts, strict=True)]
        before = self._proximal(self._rates.trace, self._rates.deviator)
        for scaled, aim in zip(self._scaled, aims, strict=True):
            scaled.bear(aim, before)
        program.internal_forces(before.pressure, before.deviator, work.right)
        work.right.axpy(1.0, work.balance)
        work.right.array[jumps] += before.forces
        work.right.scale(-1.0)
        program.stiffness.solve(work.right, work.change)
        try:
            factors = np.linalg.solve(self._works, self._missing - program.works(work.change))
        except np.linalg.LinAlgError as failure:
            raise SingularStiffness("the loads do no work on any flow") from failure
        for factor, motion in zip(factors, work.motions, strict=True):
            work.change.axpy(float(factor), motion)

        rates = program.rates_of(work.change)
        borne = self._proximal(
            self._rates.trace + rates.trace, self._rates.deviator + rates.deviator
        )
        both = zip(self._scaled, aims, strict=True)
        members = tuple(scaled.follow(aim, rates, borne) for scaled, aim in both)
        unknowns = Unknowns(float(factors[0]), float(factors[1:].sum()), borne, members)
        return Direction(unknowns, work.change.array_r.copy())

    def _proximal(self, trace: Floats, deviator: Floats) -> Borne:
        """Return the stress of the proximal point method; blocks overwrite it at their points."""
        none = np.zeros(len(self._program.jumps))
        return Borne(self._free * trace, self._free[:, None] * deviator, none)

    def balanced(self, now: Unknowns) -> Unknowns:
        """Return the unknowns with a correction that removes the unbalanced forces. Collective.

        Contact forces that are tensile after the correction are set to zero.

        Args:
            now: The unknowns. The vector ``balance`` of the workspace contains their unbalanced
                forces.
        """
        program, change = self._program, self._work.change
        program.stiffness.solve(self._work.balance, change)
        rates = program.rates_of(change)
        less = self._proximal(rates.trace, rates.deviator)
        owns = [scaled.resist(rates, less) for scaled in self._scaled]
        borne = now.borne.plus(-1.0, less)
        borne = replace(borne, forces=np.maximum(borne.forces, 0.0))
        both = zip(now.members, owns, strict=True)
        members = tuple(replace(it, own=it.own - own) for it, own in both)
        return replace(now, members=members).bearing(borne, self._blocks)


class InteriorIteration:
    """The iterate of the interior point method, and the steps that change it.

    Attributes:
        program: The program to solve.
        now: The iterate.
        velocity: Velocity v of the iterate.
        earlier: The first iterate that :meth:`kept` returned; None before the first call.
    """

    def __init__(self, program: ConicProgram) -> None:
        """Start at the centre of the yield sets, with zero velocity. Collective.

        The first step uses the factors of the K that determined the program's units. The stiffness
        must not have factorised another K since then.
        """
        self.program = program
        self.earlier: tuple[Unknowns, Floats] | None = None
        self._begun = False
        self.velocity, self._work = program.create_vector(), Workspace(program)
        self._newton: NewtonDirections | None = None
        borne = program.nothing_borne()
        members = tuple(block.start(borne) for block in program.blocks)
        self.now = Unknowns(0.0, 0.0, borne, members)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self.velocity.destroy()
        self._work.destroy()

    def put(self, now: Unknowns, velocity: Floats) -> None:
        """Replace the iterate by another iterate, for example by the solution of another solver.

        Args:
            now: The iterate, its members inside their cones.
            velocity: Entries of the iterate's velocity on this rank.
        """
        self.now, self._newton, self._begun = now, None, True
        self.velocity.array[:] = velocity

    def kept(self) -> tuple[Unknowns, Floats]:
        """Return the iterate and the entries of its velocity.

        The first call also stores both in ``earlier``.
        """
        now = self.now, self.velocity.array_r.copy()
        self.earlier = self.earlier or now
        return now

    def gap(self) -> float:
        """Return the gap between static and kinematic load at a feasible iterate. Collective."""
        return self.program.total(sum(members.inner() for members in self.now.members))

    def unbalanced(self) -> float:
        """Return the largest unbalanced force, relative to the largest load. Collective."""
        largest = PETSc.NormType.NORM_INFINITY
        loads = max(abs(self.now.load), 1.0) * self.program.load.norm(largest)
        loads += self.program.dead.norm(largest)
        return float(self.balance().norm(largest) / loads)

    def row_units(self) -> Floats | float:
        """Return the unit of unbalanced forces in each row of this rank, or one unit for all."""
        return 1.0

    def size(self) -> float:
        """Return the size that divides differences of bounds (:func:`load_factor.measure_of`).

        Collective.
        """
        load = self.now.load
        return measure_of(load + self.program.dead_work(self.velocity), load, self.program.loose)

    def balance(self) -> PETSc.Vec:
        """Return the residual of equilibrium as a vector, zero at the solution. Collective.

        The residual is Σ w σ:ε(v) + r·[v] minus the work of the loads, for all v.
        """
        program, now, left = self.program, self.now, self._work.balance
        program.internal_forces(*now.stress, left)
        left.axpy(-1.0, program.dead)
        for factor, load in zip((now.load, now.aside), program.loads, strict=False):
            left.axpy(-factor, load)
        left.array[program.jumps] += now.forces
        return left

    def inadmissible(self) -> float:
        """Return the inadmissible part of ε(v), relative to ‖ε(v)‖. Collective.

        The inadmissible part is the volume change in plastic bodies and the strain rate in elastic
        bodies. In bodies that dilate, it is the amount by which tr ε(v) is too small.

        Bodies that only constant loads hold together may separate rigidly. With constant loads,
        ‖ε(v)‖ therefore counts as at least :data:`AT_REST`.
        """
        wrong, rate = self.program.rates(self.velocity)
        rate = max(rate, AT_REST) if self.program.has_dead else rate
        return wrong / rate if rate > 0 else 0.0

    def equilibrate(self) -> None:
        """Add the stress and contact forces that balance the unbalanced forces. Collective.

        The function uses the factors of the last step's K. The corrected stress and forces may lie
        outside the cones, by about the size of the correction. If K is nearly singular, for example
        because bodies separate, the residual may grow; the function then keeps the iterate.
        """
        if self._newton is None:
            return
        before, left = self.now, self.unbalanced()
        self.now = self._newton.balanced(before)
        if not self.unbalanced() < left:
            self.now = before

    @np.errstate(over="ignore", invalid="ignore")  # the step rejects an infinite direction
    def step(self, onwards: bool = True) -> float:
        """Perform one step. Collective.

        Args:
            onwards: Whether to step towards the limit load. If False, the step is towards the
                centre of the cones at the present load, and corrects only the velocity. Its
                proximal parameter is δ²; this value reduces the strain rates of elastic bodies to
                rounding in one step.

        Returns:
            The length of the step, at most 1; 0 if no direction was found.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        self._newton = None  # the next factorisation replaces its factors
        self.balance()
        self._newton = newton = NewtonDirections(
            self.program,
            self.now,
            self.velocity,
            self._work,
            factorised=not self._begun,
            proximal=PROXIMAL if onwards else PROXIMAL**2,
        )
        self._begun = True
        here, mu = newton.products(), self.gap() / self.program.degree
        centre, aim = mu, -here.raised(-mu)
        if onwards:
            affine = newton.towards(-here)
            centre *= (1 - min(1.0, self._longest(affine.unknowns))) ** 3
            aim = -(here + newton.products(affine.unknowns)).raised(-centre)
        chosen = newton.towards(aim)
        longest = self._longest(chosen.unknowns)
        # Each correction of a direction needs one solution with the present factors. A correction
        # aims at a step that is longer by ``gain`` (a full step is 1). The method accepts a
        # correction if the step grows by more than ``worth``.
        most_corrections, gain, worth = 3, 0.3, 0.02
        for _ in range(most_corrections):
            if not longest < 1:
                break
            reach = min(1.0, longest + gain)
            aim += newton.products(self.now.plus(reach, chosen.unknowns)).missing(centre)
            other = newton.towards(aim)
            further = self._longest(other.unknowns)
            if not further > longest + worth:
                break
            chosen, longest = other, further
        shortened = 0.95  # share of the distance to the boundary of the cones
        length = min(1.0, shortened * longest)
        if not np.isfinite(chosen.unknowns.load):
            return 0.0
        self.velocity.array[:] += length * chosen.velocity
        self.now = self.now.plus(length, chosen.unknowns)
        return length

    def _longest(self, change: Unknowns) -> float:
        """Return the longest step that keeps all members in their cones. Collective."""
        each = zip(self.program.blocks, self.now.members, change.members, strict=True)
        mine = min(
            min(block.longest(now.static, by.static), block.longest(now.kinematic, by.kinematic))
            for block, now, by in each
        )
        return float(self.program.comm.allreduce(mine, MPI.MIN))


def rebalance(iteration: InteriorIteration) -> None:
    """Restore the equilibrium of an iterate by the least change of its stress. Collective.

    Each round needs one factorisation. Contact forces change in proportion to their size; small
    forces therefore stay positive. A contact force that has to be zero in equilibrium may still be
    tensile, because of residuals of the iteration. The function sets tensile forces to zero and
    restores equilibrium without them. The stress may leave the yield sets. If a factorisation
    fails, or if forces are still tensile after the last round, the function keeps the last iterate
    in equilibrium, or the original iterate.
    """
    program, balanced = iteration.program, iteration.now
    largest = max(program.comm.allgather(float(balanced.forces.max(initial=0))))
    least_change = 1e-6  # spring of a zero contact force, relative to the largest force's spring
    springs = program.springs * (balanced.forces / (largest or 1.0) + least_change)
    try:
        for _ in range(MOST_ROUNDS):
            program.assemble(program.moduli(1.0))
            program.stiffness.add_at_jumps(springs)
            program.stiffness.factorise()
            _balance(iteration, springs)
            balanced = iteration.now
            pulls = balanced.forces < 0
            if not program.comm.allreduce(int(pulls.sum())):
                break
            springs[pulls] = 0.0
            pushes = replace(balanced.borne, forces=np.maximum(balanced.forces, 0.0))
            iteration.now = balanced.bearing(pushes, program.blocks)
    except SingularStiffness:
        pass
    finally:
        iteration.now = balanced


def _balance(iteration: InteriorIteration, springs: Floats) -> None:
    """Correct the stress and the contact forces with the present factors. Collective.

    The method is conjugate residuals with the factors as preconditioner. If edges nearly cross,
    rows of equilibrium are nearly linearly dependent. For a few motions, the ridge of the factors
    (:data:`condensed_stiffness.RIDGE`) then exceeds K, and iterative refinement hardly corrects
    these motions. Conjugate gradients would finally diverge if no stress satisfies equilibrium to
    the last bit. The function keeps the correction with the smallest residual.
    """
    program, units = iteration.program, iteration.row_units()
    direction, product = program.create_vector(), program.create_vector()
    directions = ConjugateResiduals(program.total)
    least, best, since = np.inf, iteration.now, 0
    # Largest unbalanced force, relative to the largest load, that needs no correction.
    balanced = 1e-13
    most_corrections = 20  # usually one or two, plus one for each pair of edges that nearly cross
    worth = 0.5  # a correction succeeds if it reduces the least residual to this share
    patience = 4  # number of consecutive unsuccessful corrections after which the loop ends
    try:
        while directions.count <= most_corrections:
            missing = iteration.unbalanced()
            since = 0 if missing < worth * least else since + 1
            if missing < least:
                least, best = missing, iteration.now
            if not missing > balanced or since == patience:
                break
            left = iteration.balance()
            program.stiffness.solve(left, direction)
            _resistance(iteration, springs, direction, product)
            step = directions.step(direction.array_r, product.array_r / units, left.array_r / units)
            if step is None:
                break
            direction.array[:] = step
            less = _resistance(iteration, springs, direction, product)
            borne = iteration.now.borne.plus(-1.0, less)
            iteration.now = iteration.now.bearing(borne, program.blocks)
    finally:
        iteration.now = best
        for vector in (direction, product):
            vector.destroy()


def _resistance(
    iteration: InteriorIteration, springs: Floats, motion: PETSc.Vec, out: PETSc.Vec
) -> Borne:
    """Return the stress and forces with which bodies and springs resist a motion. Collective.

    Args:
        iteration: The iteration with the program.
        springs: Stiffness of contact.
        motion: The motion of bodies with unit moduli.
        out: Vector that the function sets to the sum of internal and contact forces.
    """
    program = iteration.program
    rates, weights = program.rates_of(motion), program.weights
    stress = weights * rates.trace, weights[:, None] * rates.deviator
    program.internal_forces(*stress, out)
    pushes = springs * rates.jumps
    out.array[program.jumps] += pushes
    return Borne(*stress, pushes)
