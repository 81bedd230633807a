"""A limit load as a static and a kinematic problem, in units that make numbers about 1.

On points with weights w,

    max λ            with  Σ w σ:ε(v) + r·[v] = λ L(v) for all v,   ‖dev σ‖ ≤ γ,   r ≥ 0,
    min Σ w γ‖dev ε(v)‖   with  L(v) = 1,   tr ε(v) = 0,   [v] ≤ 0,

where [v] are the jumps of contact pairs and obstacles and r their forces. In elastic bodies ‖dev σ‖
is not bounded, and ε(v) = 0. The gaps of contact play no part: a body that moves without end has
closed or opened them (E. Christiansen, Handbook of Numerical Analysis IV, 1996).

What the velocities v are is told by a :class:`Discretisation`: displacements of finite elements
(:mod:`limit_program`), or the multipliers of the equilibrium of piecewise linear stresses
(:mod:`static_program`).
"""

from dataclasses import dataclass
from typing import Protocol, TypeAlias

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints

PROXIMAL = 1e-5
"""δ: stresses that nothing bounds change by 1/δ times a strain. With 1e-4 linear elements that
nearly lock take three times the steps; with less K is worse conditioned."""


CONTRAST = 1e4
"""Bodies so many times as strong as those that bear the loads do not flow."""

SIMILAR = 10.0
"""Strengths of such ratios are measured in one unit."""

MOSTLY = 0.1

NO_FLOW = 1e-20

MOST_CARRIED = 40

Stress: TypeAlias = tuple[Floats, Floats]
"""Pressure and deviator at the points, shapes (count,) and (count, m)."""

MOST_VISCOUS = 1e4
"""Strong bodies are so viscous at first, at most."""


NONE = np.zeros(0, dtype=np.int32)


class SingularStiffness(RuntimeError):
    """A factorisation that has failed, on every rank alike."""


class Strains(Protocol):
    """ε(v) at the points of this rank, split into trace and deviator, and its transpose.

    Attributes:
        count: Points of this rank.
        size: Components m of a deviator; its norm is that of the tensor.
        gdim: Dimension in which the trace is taken, and pressure acts.
        weights: Volume that a point stands for, shape (count,).
        radii: Yield radius γ (stress), ∞ in elastic bodies, shape (count,).
    """

    count: int
    size: int
    gdim: int
    weights: Floats
    radii: Floats

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of ε(v), shapes (count,) and (count, m). Collective."""
        ...

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) for all v. Collective."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


class Stiffness(Protocol):
    """K with ⟨κ tr ε δ + a dev ε − (N:ε) N, ε⟩ and c s² for the jump s of each contact pair."""

    @property
    def factorisations(self) -> int:
        """So far."""
        ...

    @property
    def solves(self) -> int:
        """Systems solved so far."""
        ...

    def assemble(self, bulk: Floats, a: Floats, normal: Floats, held: Ints = NONE) -> None:
        """Bring K to moduli at the points, with unknowns that stay zero. Collective."""
        ...

    def jump_diagonal(self) -> Floats:
        """Diagonal entries of the jumps of this rank's pairs. Collective."""
        ...

    def add_at_jumps(self, springs: Floats) -> None:
        """Add c to the diagonal, shape (num_pairs,) on each rank. Collective."""
        ...

    def factorise(self) -> None:
        """Factorise. Collective.

        Raises:
            SingularStiffness: If that fails.
        """
        ...

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


@dataclass(frozen=True, eq=False)
class Discretisation:
    """What a limit load is looked for with.

    Attributes:
        comm: The ranks.
        strains: Of velocities.
        stiffness: Assembled for the same velocities.
        load: L as a vector, in the user's units.
        jumps: Local (owned) entries of velocities that are jumps [v] of contact pairs.
    """

    comm: MPI.Intracomm
    strains: Strains
    stiffness: Stiffness
    load: PETSc.Vec
    jumps: Ints


class ConicProgram:
    """Both problems of one discretisation.

    Attributes:
        comm: The ranks.
        strains: Strain rates at the points.
        stiffness: K, to be assembled with any moduli.
        load: L.
        jumps: Local (owned) entries of velocities that are jumps of contact pairs.
        num_pairs: Contact pairs on all ranks together.
        plastic: Which points of this rank have a yield stress, shape (count,).
        weights: w, 1 in the mean, shape (count,).
        radii: γ of the plastic points, 1 in the harmonic mean.
        viscosities: γ over a rate that suits the point.
        springs: Stiffness of contact that suits that of the bodies, shape (num_pairs,).
        degree: Plastic points and pairs of all ranks.
        stress_unit: What 1 is of σ.
        load_unit: What 1 is of λ.
        force_unit: What 1 is of r.
    """

    def __init__(self, on: Discretisation, scale: float | None = None) -> None:
        """Take a discretisation over, its PETSc objects too. Collective.

        Args:
            on: The discretisation.
            scale: Yield radius (stress) of those that bear the loads; chosen by a viscous flow
                where none is given.
        """
        self.comm, self.strains, self.stiffness = on.comm, on.strains, on.stiffness
        strains, self.jumps = on.strains, on.jumps
        finite = strains.radii[np.isfinite(strains.radii)]
        mine = [strains.count, strains.weights.sum(), len(finite), (1 / finite).sum()]
        points, volume, cones, weaknesses, pairs = self.comm.allreduce(
            np.array([*mine, len(on.jumps)])
        )
        self.num_pairs = int(pairs)
        self._mean_weight = volume / points
        self.weights = strains.weights / self._mean_weight
        self.load = on.load
        self.load_unit = self.stress_unit = self.force_unit = 1.0
        self.springs: Floats = np.zeros(len(on.jumps))
        self.carried: Stress | None = None
        self._scale = scale
        if scale is None:
            self._measure(cones / weaknesses if cones else 1.0, np.inf)  # weak bodies count
        else:
            self._measure(scale, CONTRAST * scale)

    def _measure(self, unit: float, strongest: float) -> None:
        """Let yield what is weak enough, and measure stresses in a unit. Collective."""
        radii = self.strains.radii
        self.strongest = strongest
        self.plastic = np.isfinite(radii) & (radii <= strongest)
        self.radii = radii[self.plastic] / unit
        self.viscosities = np.minimum(self.radii**2, MOST_VISCOUS)
        self.degree = self.num_pairs + int(self.comm.allreduce(len(self.radii)))
        before, self.force_unit = self.force_unit, unit * self._mean_weight
        self.stress_unit = unit
        self.load.scale(before / self.force_unit)

    def stronger(self) -> float | None:
        """Least yield radius that nothing has in mind here; None if there is none. Collective."""
        radii = self.strains.radii
        mine = float(radii[radii > self.strongest].min(initial=np.inf))
        least = float(self.comm.allreduce(mine, MPI.MIN))
        return least if np.isfinite(least) else None

    def overstress(self, deviator: Floats) -> float:
        """Largest ‖dev σ‖/γ of all points, those that do not flow here too. Collective.

        Args:
            deviator: In units of ``stress_unit``.
        """
        sizes = np.linalg.norm(deviator, axis=1) * self.stress_unit
        return float(self.comm.allreduce((sizes / self.strains.radii).max(initial=0.0), MPI.MAX))

    def whole(self, stress: Stress, load: float) -> Stress:
        """A stress with what the free ones carry of a load factor, in units of the program."""
        if self.carried is None:
            return stress
        return tuple(a + load * b for a, b in zip(stress, self.carried, strict=True))

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for thing in (self.strains, self.stiffness, self.load):
            thing.destroy()

    def create_vector(self) -> PETSc.Vec:
        """A velocity of zeros. Collective."""
        vector = self.load.duplicate()
        vector.set(0)
        return vector

    def choose_units(self) -> None:
        """Make the limit load about as large as there are points and pairs. Collective.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        flow = self.load.duplicate()
        self._flow(flow)
        if self._scale is None and self._measure_by(flow):
            self._flow(flow)
        self._carry(flow)
        unit = self.dissipation(flow) / self.work(flow) / max(self.degree, 1)
        flow.destroy()
        self.load_unit *= unit
        self.load.scale(unit)
        if self.carried is not None:
            self.carried = tuple(unit * part for part in self.carried)

    def _flow(self, flow: PETSc.Vec) -> None:
        """Find the flow of viscous bodies that the loads drive. Collective."""
        viscosity = self.at_points(self.viscosities, 1 / PROXIMAL)
        none: Floats = np.zeros((len(viscosity), self.strains.size))
        if self.num_pairs:
            self.assemble(np.ones_like(viscosity), viscosity, none)
            self.springs = self.stiffness.jump_diagonal()
        self.assemble(np.full_like(viscosity, 1 / PROXIMAL), viscosity, none)
        self.stiffness.add_at_jumps(self.springs)
        self.stiffness.factorise()
        self.stiffness.solve(self.load, flow)

    def _measure_by(self, flow: PETSc.Vec) -> bool:
        """Choose the strength that matters: the mean of those where the flow dissipates. Collective.

        Returns:
            Whether it is another one than before.
        """
        radii = self.radii * self.stress_unit
        largest = self.comm.allreduce(float(radii.max(initial=0)), MPI.MAX)
        least = self.comm.allreduce(float(radii.min(initial=np.inf)), MPI.MIN)
        if not largest > SIMILAR * least:
            return False
        _, stress = self.viscous_stress(flow)
        _, deviator = self.strains.of(flow)
        power = self.weights * np.einsum("ni,ni->n", stress, deviator)
        power = power[self.plastic]
        mean = np.exp(self.total(float(power @ np.log(radii))) / self.total(float(power.sum())))
        if mean / SIMILAR < self.stress_unit < mean * SIMILAR and largest <= CONTRAST * mean:
            return False
        self._measure(mean, CONTRAST * mean)
        return True

    def _carry(self, flow: PETSc.Vec) -> None:
        """Leave of the loads what drives a flow beside what stresses carry that nothing bounds.

        Such are pressures, and stresses of bodies that do not yield: all round pressed bodies carry
        almost all by them. Collective.
        """
        given = left = None
        first, carried = self.work(flow), None
        for _ in range(MOST_CARRIED):
            trace, deviator = self.strains.of(flow)
            pressure = self.weights / PROXIMAL * trace
            stress = np.where(self.plastic, 0.0, self.weights / PROXIMAL)[:, None] * deviator
            free = self.weights @ (pressure * trace + np.einsum("ni,ni->n", stress, deviator))
            power = self.work(flow)
            if not self.total(float(free)) > MOSTLY * power or power < NO_FLOW * first:
                break
            if given is None:
                given, left = self.load.copy(), self.create_vector()
                carried = (np.zeros_like(pressure), np.zeros_like(stress))
            carried = (carried[0] + pressure, carried[1] + stress)
            self.internal_forces(*carried, left)
            self.load.waxpy(-1.0, left, given)
            self.stiffness.solve(self.load, flow)
            print("carry", self.total(float(free))/power, power/first)
        self.carried = carried
        for vector in (given, left):
            if vector is not None:
                vector.destroy()

    def viscous_stress(self, velocity: PETSc.Vec) -> Stress:
        """Pressure and deviator of the flow that units are chosen by. Collective."""
        trace, deviator = self.strains.of(velocity)
        viscosity = self.at_points(self.viscosities, 1 / PROXIMAL) * self.weights
        return self.weights / PROXIMAL * trace, viscosity[:, None] * deviator

    def at_points(self, plastic: Floats, elastic: float) -> Floats:
        """Values at all points from those at the plastic ones."""
        values: Floats
        values = np.full((self.strains.count, *plastic.shape[1:]), elastic)
        values[self.plastic] = plastic
        return values

    def assemble(self, bulk: Floats, a: Floats, normal: Floats, held: Ints = NONE) -> None:
        """Assemble Σ w² (κ tr ε δ + a dev ε − (N:ε) N):ε; see :class:`Stiffness`."""
        scale = self.weights / self._mean_weight
        self.stiffness.assemble(scale * bulk, scale * a, np.sqrt(scale)[:, None] * normal, held)

    def internal_forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w (p δ + s):ε(v) for all v. Collective."""
        self.strains.forces(pressure / self._mean_weight, deviator / self._mean_weight, out)

    def work(self, velocity: PETSc.Vec) -> float:
        """L(v). Collective."""
        return float(self.load.dot(velocity))

    def dissipation(self, velocity: PETSc.Vec) -> float:
        """Σ w γ‖dev ε(v)‖ over plastic points. Collective."""
        _, deviator = self.strains.of(velocity)
        rates = np.linalg.norm(deviator[self.plastic], axis=1)
        return self.total(float((self.weights[self.plastic] * self.radii) @ rates))

    def total(self, value: float) -> float:
        """Sum over all ranks. Collective."""
        return float(self.comm.allreduce(value))
