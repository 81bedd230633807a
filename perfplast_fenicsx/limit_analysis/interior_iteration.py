"""Primal-dual interior point iteration for limit loads.

A step takes one factorisation of a stiffness: with the scaling of Nesterov and Todd the stress of a
point changes by H⁻¹ times a strain, and H⁻¹ is a multiple of the identity less something of rank
one. Steps are Mehrotra's, a predictor and a corrector, and then Gondzio's (:mod:`centrality`), all
with the same factors. Stresses that nothing bounds, mean ones and those of elastic bodies, follow
the proximal point method, which does not change where the iteration ends.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.centrality import Products
from perfplast_fenicsx.limit_analysis.conic_program import PROXIMAL, ConicProgram
from perfplast_fenicsx.limit_analysis.conic_unknowns import Unknowns
from perfplast_fenicsx.limit_analysis.dilating_points import DilatingPoints
from perfplast_fenicsx.limit_analysis.discretisation import Moduli
from perfplast_fenicsx.limit_analysis.second_order_cones import Scaling, product, quotient

SHORTENED = 0.98
"""Share of the way to the boundary that a step goes."""

MOST_CORRECTIONS = 3
"""Of a direction, each a solution with the factors that there are."""

FURTHER = 0.3
"""By so much a corrected direction should be longer, as a share of a whole step."""

WORTH = 0.02
"""By so much it must be longer to be taken."""


class InteriorIteration:
    """The iterate, and steps of it.

    Attributes:
        program: What is solved.
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
        self._vectors = tuple(program.create_vector() for _ in range(6))
        self.velocity, self._balance, self._of_load, self._of_rest, self._right, self._change = (
            self._vectors
        )
        stress = np.zeros((program.strains.count, program.strains.size))
        S = program.members((stress[:, 0], stress))
        Z = np.zeros_like(S)
        Z[:, 0] = program.radii / program.viscosities
        root = np.sqrt(program.springs)
        self._newton: _Newton | None = None
        self.now = Unknowns(0.0, stress[:, 0].copy(), stress, S, Z, root, 1 / root)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for vector in self._vectors:
            vector.destroy()

    def gap(self) -> float:
        """By how much static and kinematic load differ once all else is right. Collective."""
        return self.program.total(self.now.products())

    def unbalanced(self) -> float:
        """Largest force that nothing balances, relative to the largest of the loads. Collective."""
        largest = PETSc.NormType.NORM_INFINITY
        loads = max(abs(self.now.load), 1.0) * self.program.load.norm(largest)
        return float(self.balance().norm(largest) / loads)

    def row_units(self) -> Floats | float:
        """Force in each row of this rank that is as bad as any other if nothing balances it."""
        return 1.0

    def unbalanced_work(self) -> float:
        """Work of the forces that nothing balances on the velocity. Collective.

        It is what they change the load by, to first order, as the velocity is that of collapse with
        L(v) = 1.
        """
        return float(self.balance().dot(self.velocity))

    def missing_work(self) -> float:
        """|1 − L(v)|. Collective."""
        return abs(1 - self.program.work(self.velocity))

    def balance(self) -> PETSc.Vec:
        """Σ w σ:ε(v) + r·[v] − λ L(v) for all v, which should be zero. Collective."""
        self.program.internal_forces(self.now.pressure, self.now.deviator, self._balance)
        self._balance.axpy(-self.now.load, self.program.load)
        self._balance.array[self._jumps] += self.now.forces
        return self._balance

    def inadmissible(self) -> float:
        """Volume change of v in plastic bodies and strain in elastic ones, relative to ‖ε(v)‖.

        Collective.
        """
        wrong, rate = self.rates()
        return wrong / rate if rate > 0 else 0.0

    def rates(self) -> tuple[float, float]:
        """See :meth:`ConicProgram.rates`. Collective."""
        return self.program.rates(self.velocity)

    def equilibrate(self) -> None:
        """Add the stress and contact forces that balance what is left. Collective.

        Those are of the last step's K. Cones may be left by them, by as little as is to balance.
        """
        if self._newton is not None:
            self.balance()
            self.now = self._newton.balanced()

    @np.errstate(over="ignore", invalid="ignore")  # a direction without end is not taken
    def step(self, onwards: bool = True) -> float:
        """Make a step. Collective.

        Args:
            onwards: Towards the limit load; else towards the middle of the cones where it is, which
                is all that is left to make the velocity right.

        Returns:
            Its length, at most 1; 0 where no direction was found.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        self._newton = None  # its factors go with what is factorised next
        self._newton = newton = _Newton(self, factorised=not self._begun)
        self._begun = True
        here, mu = newton.products(), self.gap() / self.program.degree
        centre, aim = mu, -here.raised(-mu)
        if onwards:
            affine = newton.towards(-here)
            centre *= (1 - min(1.0, self._longest(affine.unknowns))) ** 3
            aim = -(here + newton.products(affine.unknowns)).raised(-centre)
        chosen = newton.towards(aim)
        longest = self._longest(chosen.unknowns)
        for _ in range(MOST_CORRECTIONS):
            if not longest < 1:
                break
            reach = min(1.0, longest + FURTHER)
            aim += newton.products_after(reach, chosen.unknowns).missing(centre)
            other = newton.towards(aim)
            further = self._longest(other.unknowns)
            if not further > longest + WORTH:
                break
            chosen, longest = other, further
        length = min(1.0, SHORTENED * longest)
        if not np.isfinite(chosen.unknowns.load):
            return 0.0
        self.velocity.array[:] += length * chosen.velocity
        self.now = self.now.plus(length, chosen.unknowns)
        return length

    def _longest(self, change: Unknowns) -> float:
        return float(self._comm.allreduce(self.now.longest(change), MPI.MIN))


@dataclass(frozen=True, eq=False)
class _Direction:
    """Changes of the unknowns, and of the velocity's entries on this rank."""

    unknowns: Unknowns
    velocity: Floats


class _Newton:
    """Newton's directions from one iterate for given changes of the products of cones and pairs.

    Attributes:
        scaling: Of the cones.
    """

    def __init__(self, iteration: InteriorIteration, factorised: bool) -> None:
        """Assemble and factorise K, and find what is the same for all directions. Collective.

        Args:
            iteration: Where it is.
            factorised: Whether the last factors are those of K.
        """
        self._it, program, now = iteration, iteration.program, iteration.now
        self._program, self._now = program, now
        self._contact = now.forces / now.rooms
        self.scaling = Scaling(now.S, now.Z)
        self._a, self._normal = self.scaling.moduli()
        self._free = program.weights / PROXIMAL
        self._trace, self._deviator = strain = program.strains.of(iteration.velocity)
        self._dilating = DilatingPoints(program, now, *strain) if program.dilates else None
        if not factorised:
            self._factorise()
        program.stiffness.solve(program.load, iteration._of_load)
        self._work_of_load = program.work(iteration._of_load)
        self._missing_work = 1 - program.work(iteration.velocity)
        plastic = program.plastic
        self._rates = program.weights[plastic, None]
        self._off = now.Z[:, 1:] + self._rates * self._deviator[plastic]
        self._off_jumps = iteration.velocity.array_r[iteration._jumps] + now.rooms
        iteration.balance()

    def _factorise(self) -> None:
        program = self._program
        soft = np.full_like(self._free, 1 / PROXIMAL)
        a, normal = program.at_points(self._a, 1 / PROXIMAL), program.at_points(self._normal, 0.0)
        moduli = Moduli(soft, a, normal)
        if self._dilating is not None:
            moduli = self._dilating.moduli(moduli)
        program.assemble(moduli)
        program.stiffness.add_at_jumps(self._contact)
        program.stiffness.factorise()

    def _moduli(self, x: Floats) -> Floats:
        """H⁻¹ x at the plastic points."""
        along = np.einsum("ni,ni->n", self._normal, x)
        return self._a[:, None] * x - along[:, None] * self._normal

    def products(self, change: Unknowns | None = None) -> Products:
        """Products of the unknowns, or of a change of them."""
        if change is None:
            point = self.scaling.point
            return Products(product(point, point), self._now.forces * self._now.rooms)
        cones = product(self.scaling.invert(change.S), self.scaling.apply(change.Z))
        return Products(cones, change.forces * change.rooms)

    def products_after(self, t: float, change: Unknowns) -> Products:
        """Products of the unknowns after t times a change."""
        return self.products(self._now.plus(t, change))

    def towards(self, change: Products) -> _Direction:
        """The direction in which the products change so, to first order. Collective."""
        it, now, program = self._it, self._now, self._program
        plastic, free, jumps = program.plastic, self._free, it._jumps
        aim, pairs = quotient(self.scaling.point, change.cones), change.pairs
        unscaled = self.scaling.invert(aim)[:, 1:]
        pressure, stress = free * self._trace, free[:, None] * self._deviator
        stress[plastic] = self._moduli(unscaled + self._off)
        if (dilating := self._dilating) is not None:
            dilating.put(dilating.members(-dilating.off, aim), pressure, stress)
        program.internal_forces(pressure, stress, it._right)
        it._right.axpy(1.0, it._balance)
        it._right.array[jumps] += (pairs + now.forces * self._off_jumps) / now.rooms
        it._right.scale(-1.0)
        program.stiffness.solve(it._right, it._of_rest)
        load = (self._missing_work - program.work(it._of_rest)) / self._work_of_load
        it._change.waxpy(load, it._of_load, it._of_rest)

        trace, deviator = program.strains.of(it._change)
        dZ = -self._off - self._rates * deviator[plastic]
        pressure = free * (self._trace + trace)
        stress = free[:, None] * (self._deviator + deviator)
        stress[plastic] = self._moduli(unscaled - dZ)
        S, Z = np.zeros_like(now.S), np.zeros_like(now.Z)
        S[:, 1:] = stress[plastic]
        Z[:, 0] = self.scaling.invert(aim - self.scaling.invert(S))[:, 0]
        Z[:, 1:] = dZ
        if dilating is not None:
            more = dilating.rates(trace, deviator) - dilating.off
            S[dilating.among] = members = dilating.members(more, aim)
            Z[dilating.among] = more
            dilating.put(members, pressure, stress)
        rooms = -self._off_jumps - it._change.array_r[jumps]
        forces = (pairs - now.forces * rooms) / now.rooms
        unknowns = Unknowns(load, pressure, stress, S, Z, forces, rooms)
        return _Direction(unknowns, it._change.array_r.copy())

    def balanced(self) -> Unknowns:
        """The iteration's unknowns with what its balance calls for. Collective."""
        it, now, program = self._it, self._it.now, self._program
        program.stiffness.solve(it._balance, it._of_rest)
        trace, deviator = program.strains.of(it._of_rest)
        pressure, stress = self._free * trace, self._free[:, None] * deviator
        stress[program.plastic] = self._moduli(self._rates * deviator[program.plastic])
        if (dilating := self._dilating) is not None:
            dilating.put(dilating.members(dilating.rates(trace, deviator)), pressure, stress)
        changed = now.pressure - pressure, now.deviator - stress
        forces = now.forces - self._contact * it._of_rest.array_r[it._jumps]
        return replace(
            now,
            pressure=changed[0],
            deviator=changed[1],
            S=program.members(changed),
            forces=np.maximum(forces, 0.0),
        )
