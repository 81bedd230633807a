"""Newton's directions of the interior point method from one iterate, with the factors of one K."""

from dataclasses import dataclass, replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.centrality import Products
from perfplast_fenicsx.limit_analysis.conic.conic_program import PROXIMAL, ConicProgram
from perfplast_fenicsx.limit_analysis.conic.conic_unknowns import Unknowns
from perfplast_fenicsx.limit_analysis.conic.dilating_points import DilatingPoints
from perfplast_fenicsx.limit_analysis.conic.discretisation import Moduli, SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.principal_points import PrincipalPoints
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import Scaling, product, quotient


class Workspace:
    """Velocities that steps work with, made once.

    Attributes:
        balance: Forces that nothing balances.
        right: Of a linear system.
        change: Change of the velocity.
        motions: Under a unit of the loads whose factors are unknown.
    """

    def __init__(self, program: ConicProgram) -> None:
        """Make room. Collective."""
        make = program.create_vector
        self.balance, self.right, self.change = make(), make(), make()
        self.motions = [make() for _ in range(2 if program.has_free else 1)]

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for vector in (self.balance, self.right, self.change, *self.motions):
            vector.destroy()


@dataclass(frozen=True, eq=False)
class Direction:
    """Changes of the unknowns, and of the velocity's entries on this rank."""

    unknowns: Unknowns
    velocity: Floats


class NewtonDirections:
    """Directions for given changes of the products of cones and pairs.

    Attributes:
        scaling: Scaling of the cones.
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
        """Assemble and factorise K, and find what is the same for all directions. Collective.

        Args:
            program: The program that was solved.
            now: The current iterate.
            velocity: Its velocity.
            work: Vectors to work with; ``balance`` is what nothing balances there.
            factorised: Whether the last factors are those of K.
            proximal: δ.
        """
        self._program, self._now, self._work = program, now, work
        self._contact = now.forces / now.rooms
        self.scaling = Scaling(now.S, now.Z)
        self._a, self._normal = self.scaling.moduli()
        self._proximal = proximal
        self._free = program.weights / proximal
        self._trace, self._deviator = strain = program.strains.of(velocity)
        self._dilating = DilatingPoints(program, now, *strain) if program.dilates else None
        some = program.blocks.cones.count > 0
        self._principal = PrincipalPoints(program, now, *strain) if some else None
        if not factorised:
            self._factorise()
        self._find_of_loads(velocity)
        self._rates = program.weights[program.round, None]
        self._off = now.Z[:, 1:] + self._rates * self._deviator[program.round]
        self._off_jumps = velocity.array_r[program.jumps] + now.rooms

    def _find_of_loads(self, velocity: PETSc.Vec) -> None:
        """Motions under unit loads, their works, and the works that are missing. Collective."""
        program, work = self._program, self._work
        self._loads = [program.load, program.free] if program.has_free else [program.load]
        self._motions = work.motions[: len(self._loads)]
        for load, motion in zip(self._loads, self._motions, strict=True):
            program.stiffness.solve(load, motion)
        self._works = np.array([[float(a.dot(b)) for b in self._motions] for a in self._loads])
        self._missing = np.array([1.0, 0.0][: len(self._loads)]) - self._of_all(velocity)

    def _of_all(self, velocity: PETSc.Vec) -> Floats:
        """Return works of the loads with unknown factors. Collective."""
        return np.array([float(load.dot(velocity)) for load in self._loads])

    def _factorise(self) -> None:
        program = self._program
        soft = np.full_like(self._free, 1 / self._proximal)
        a, normal = (
            program.at_points(self._a, 1 / self._proximal),
            program.at_points(self._normal, 0.0),
        )
        moduli = Moduli(soft, a, normal)
        if self._dilating is not None:
            moduli = self._dilating.moduli(moduli)
        if self._principal is not None:
            moduli = self._principal.moduli(moduli)
        program.assemble(moduli)
        program.stiffness.add_at_jumps(self._contact)
        program.stiffness.factorise()

    def _moduli(self, x: Floats) -> Floats:
        """H⁻¹ x at the round points."""
        along = np.einsum("ni,ni->n", self._normal, x)
        return self._a[:, None] * x - along[:, None] * self._normal

    def products(self, change: Unknowns | None = None) -> Products:
        """Return products of the unknowns, or of a change of them."""
        now, principal = change or self._now, self._principal
        matrices = now.X
        if change is None:
            cones = product(self.scaling.point, self.scaling.point)
        else:
            cones = product(self.scaling.invert(change.S), self.scaling.apply(change.Z))
        if principal is not None:
            matrices = principal.products if change is None else principal.scaled(change)
        return Products(cones, matrices, now.forces * now.rooms)

    def products_after(self, t: float, change: Unknowns) -> Products:
        """Return products of the unknowns after t times a change."""
        return self.products(self._now.plus(t, change))

    def towards(self, change: Products) -> Direction:
        """Return the direction in which the products change so, to first order. Collective."""
        now, program, work = self._now, self._program, self._work
        round_, free, jumps = program.round, self._free, program.jumps
        aim, pairs = quotient(self.scaling.point, change.cones), change.pairs
        unscaled = self.scaling.invert(aim)[:, 1:]
        pressure, stress = free * self._trace, free[:, None] * self._deviator
        stress[round_] = self._moduli(unscaled + self._off)
        if (dilating := self._dilating) is not None:
            dilating.put(dilating.members(-dilating.off, aim), pressure, stress)
        if (principal := self._principal) is not None:
            matrices = principal.aim(change.matrices)
            principal.put(principal.stresses(matrices), pressure, stress)
        program.internal_forces(pressure, stress, work.right)
        work.right.axpy(1.0, work.balance)
        work.right.array[jumps] += (pairs + now.forces * self._off_jumps) / now.rooms
        work.right.scale(-1.0)
        program.stiffness.solve(work.right, work.change)
        try:
            factors = np.linalg.solve(self._works, self._missing - self._of_all(work.change))
        except np.linalg.LinAlgError as failure:
            raise SingularStiffness("the loads do no work on any flow") from failure
        for factor, motion in zip(factors, self._motions, strict=True):
            work.change.axpy(float(factor), motion)

        trace, deviator = program.strains.of(work.change)
        dZ = -self._off - self._rates * deviator[round_]
        pressure = free * (self._trace + trace)
        stress = free[:, None] * (self._deviator + deviator)
        stress[round_] = self._moduli(unscaled - dZ)
        S, Z = np.zeros_like(now.S), np.zeros_like(now.Z)
        S[:, 1:] = stress[round_]
        Z[:, 0] = self.scaling.invert(aim - self.scaling.invert(S))[:, 0]
        Z[:, 1:] = dZ
        if dilating is not None:
            more = dilating.rates(trace, deviator) - dilating.off
            S[dilating.among] = members = dilating.members(more, aim)
            Z[dilating.among] = more
            dilating.put(members, pressure, stress)
        t, X, Y = now.t, now.X, now.Y  # of no point
        if principal is not None:
            dy = principal.stresses(matrices, trace, deviator)
            principal.put(dy, pressure, stress)
            t, X = dy[:, 0], program.blocks.changes(dy[:, 0], pressure, stress)
            Y = principal.multipliers(X, matrices, trace, deviator)
        rooms = -self._off_jumps - work.change.array_r[jumps]
        forces = (pairs - now.forces * rooms) / now.rooms
        load, aside = float(factors[0]), float(factors[1:].sum())
        unknowns = Unknowns(load, aside, pressure, stress, S, Z, t, X, Y, forces, rooms)
        return Direction(unknowns, work.change.array_r.copy())

    def balanced(self, now: Unknowns) -> Unknowns:
        """Return unknowns with what the balance in the workspace calls for. Collective.

        Args:
            now: The unknowns.
        """
        program, change = self._program, self._work.change
        program.stiffness.solve(self._work.balance, change)
        trace, deviator = program.strains.of(change)
        pressure, stress = self._free * trace, self._free[:, None] * deviator
        stress[program.round] = self._moduli(self._rates * deviator[program.round])
        if (dilating := self._dilating) is not None:
            dilating.put(dilating.members(dilating.rates(trace, deviator)), pressure, stress)
        t = now.t
        if (principal := self._principal) is not None:
            dy = principal.stresses(None, trace, deviator)
            principal.put(dy, pressure, stress)
            t = t - dy[:, 0]
        changed = now.pressure - pressure, now.deviator - stress
        forces = now.forces - self._contact * change.array_r[program.jumps]
        return replace(
            now,
            pressure=changed[0],
            deviator=changed[1],
            S=program.members(changed),
            t=t,
            X=program.blocks.members(t, *changed),
            forces=np.maximum(forces, 0.0),
        )
