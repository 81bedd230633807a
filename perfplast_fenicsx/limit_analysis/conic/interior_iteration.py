"""Primal-dual interior point iteration for limit loads.

A step takes one factorisation of a stiffness: with the scaling of Nesterov and Todd the stress of a
point changes by H⁻¹ times a strain, and H⁻¹ is a multiple of the identity less something of rank
one, or, where semidefinite matrices bound principal stresses, any modulus. Steps are Mehrotra's, a
predictor and a corrector, and then Gondzio's (:mod:`centrality`), all with the same factors.
Stresses that nothing bounds, mean ones and those of elastic bodies, follow the proximal point
method, which does not change where the iteration ends.
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import PROXIMAL, ConicProgram
from perfplast_fenicsx.limit_analysis.conic.conic_unknowns import Unknowns
from perfplast_fenicsx.limit_analysis.conic.newton_directions import NewtonDirections, Workspace
from perfplast_fenicsx.limit_analysis.statements.bound import measure_of

AT_REST = 1e-4
"""Strain rates, relative to those of a flow that meets resistance, that are next to none."""


class InteriorIteration:
    """The iterate, and steps of it.

    Attributes:
        program: The program that was solved.
        now: The iterate.
        velocity: Its velocity v.
    """

    def __init__(self, program: ConicProgram) -> None:
        """Start in the middle of the yield sets, at rest. Collective.

        The first step's K is that by which the program's units were chosen, and its factors are
        used: nothing else may have been factorised since.
        """
        self.program = program
        self._begun = False
        self._comm, self._jumps = program.comm, program.jumps
        self.velocity, self._work = program.create_vector(), Workspace(program)
        shape = (program.strains.count, program.strains.size)
        stress, pressure = np.zeros(shape, order="F"), program.start()
        S = program.members((pressure, stress))
        Z = np.zeros_like(S)
        Z[:, 0] = program.strengths[program.round] / program.viscosities
        root = np.sqrt(program.springs)
        self._newton: NewtonDirections | None = None
        of_blocks = program.blocks.start()
        self.now = Unknowns(0.0, 0.0, pressure, stress, S, Z, *of_blocks, root, 1 / root)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self.velocity.destroy()
        self._work.destroy()

    def gap(self) -> float:
        """By how much static and kinematic load differ once all else is right. Collective."""
        return self.program.total(self.now.products())

    def unbalanced(self) -> float:
        """Largest force that nothing balances, relative to the largest of the loads. Collective."""
        largest = PETSc.NormType.NORM_INFINITY
        loads = max(abs(self.now.load), 1.0) * self.program.load.norm(largest)
        loads += self.program.dead.norm(largest)
        return float(self.balance().norm(largest) / loads)

    def row_units(self) -> Floats | float:
        """Force in each row of this rank that is as bad as any other if nothing balances it."""
        return 1.0

    def unbalanced_work(self) -> float:
        """Return the work of the forces that nothing balances on the velocity. Collective.

        It is what they change the load by, to first order, as the velocity is that of collapse with
        L(v) = 1.
        """
        return float(self.balance().dot(self.velocity))

    def size(self) -> float:
        """Return the measure of differences of bounds (:func:`bound.measure_of`). Collective."""
        load = self.now.load
        return measure_of(load + self.program.dead_work(self.velocity), load, self.program.loose)

    def missing_work(self) -> float:
        """|1 − L(v)|, and the work of loads of any factor. Collective."""
        missing = abs(1 - self.program.work(self.velocity))
        if not self.program.has_free:
            return missing
        return max(missing, abs(float(self.program.free.dot(self.velocity))))

    def balance(self) -> PETSc.Vec:
        """Σ w σ:ε(v) + r·[v] less the work of the loads for all v, to become zero. Collective."""
        program, now, left = self.program, self.now, self._work.balance
        program.internal_forces(now.pressure, now.deviator, left)
        left.axpy(-now.load, program.load)
        left.axpy(-1.0, program.dead)
        if program.has_free:
            left.axpy(-now.aside, program.free)
        left.array[self._jumps] += now.forces
        return left

    def inadmissible(self) -> float:
        """Volume change of v in plastic bodies and strain in elastic ones, relative to ‖ε(v)‖.

        Beside dead loads, which alone may hold bodies, these may part as rigid ones: strain rates
        that are rounding count as :data:`AT_REST` then. Collective.
        """
        wrong, rate = self.rates()
        rate = max(rate, AT_REST) if self.program.has_dead else rate
        return wrong / rate if rate > 0 else 0.0

    def rates(self) -> tuple[float, float]:
        """See :meth:`ConicProgram.rates`. Collective."""
        return self.program.rates(self.velocity)

    def equilibrate(self) -> None:
        """Add the stress and contact forces that balance what is left. Collective.

        Those are of the last step's K. Cones may be left by them, by as little as is to balance.
        Where K is singular but for rounding, as of bodies that part, they may leave more than there
        was; nothing is added then.
        """
        if self._newton is None:
            return
        before, left = self.now, self.unbalanced()
        self.now = self._newton.balanced(before)
        if not self.unbalanced() < left:
            self.now = before

    @np.errstate(over="ignore", invalid="ignore")  # a direction without end is not taken
    def step(self, onwards: bool = True) -> float:
        """Make a step. Collective.

        Args:
            onwards: Towards the limit load; else towards the middle of the cones where it is, which
                is all that is left to make the velocity right. Strains of elastic bodies are then
                made rounding at once, by a δ that is the square of the usual one.

        Returns:
            Its length, at most 1; 0 where no direction was found.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        self._newton = None  # its factors go with what is factorised next
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
        # Corrections of a direction, each a solution with the factors that there are. It should be
        # longer by the gain, as a share of a whole step; it is taken if it is by what is worth it.
        most_corrections, gain, worth = 3, 0.3, 0.02
        for _ in range(most_corrections):
            if not longest < 1:
                break
            reach = min(1.0, longest + gain)
            aim += newton.products_after(reach, chosen.unknowns).missing(centre)
            other = newton.towards(aim)
            further = self._longest(other.unknowns)
            if not further > longest + worth:
                break
            chosen, longest = other, further
        shortened = 0.95  # share of the way to the boundary that a step goes
        length = min(1.0, shortened * longest)
        if not np.isfinite(chosen.unknowns.load):
            return 0.0
        self.velocity.array[:] += length * chosen.velocity
        self.now = self.now.plus(length, chosen.unknowns)
        return length

    def _longest(self, change: Unknowns) -> float:
        return float(self._comm.allreduce(self.now.longest(change), MPI.MIN))
