"""Formulate a limit load as a static and a kinematic problem, in units with values near 1.

At points with weights w, the problems are

    max λ               with  Σ w σ:ε(v) + r·[v] = λ L(v) + L₀(v),   ‖dev σ‖ ≤ γ − αp,   r ≥ 0,
    min Σ γ z₀ − L₀(v)  with  L(v) = 1,   αz₀ = w tr ε(v),   z₀ ≥ w‖dev ε(v)‖,   [v] ≤ 0,

in the coordinates of each point's cone (:mod:`standard_cones`). For yield sets whose centre is not
zero stress, s + γt replaces dev σ. L₀ is the work of the constant loads, [v] the jump at contact
pairs and obstacles, r the contact force and p the mean stress. If α = 0, bodies preserve their
volume; otherwise they dilate, tr ε(v) ≥ α‖dev ε(v)‖. In elastic bodies ‖dev σ‖ is not bounded, and
ε(v) = 0. Contact gaps do not affect the limit load, because unlimited motion closes or opens every
gap (E. Christiansen, Handbook of Numerical Analysis IV, 1996).

A :class:`discretisation.Discretisation` defines the velocities v: displacements of finite elements
(:mod:`discrete_limit`), or the multipliers of the equilibrium of piecewise linear stresses
(:mod:`static_program`).

The flow of viscous bodies under the same loads determines the units
(:func:`interior_steps.choose_units`). The unit of stress is the strength of the points at which
this flow dissipates. For example, a weak layer in a stack flows alone, and a weak column next to a
strong column flows together with the strong column. The program then treats far stronger bodies as
elastic. Both bounds remain bounds: the program scales the final stress into the true yield sets,
and computes the dissipation of a velocity with the true yield radii. If the stress in the strong
bodies lies in their yield sets, treating them as elastic does not change the result. If the stress
lies outside, the next search also treats the weakest of the strong bodies as plastic
(:meth:`ConicProgram.stronger`).

The flow also shows which part of the loads drives it. Mean stresses (where α = 0) and the stresses
of bodies that do not yield are unbounded. The program subtracts the loads that these stresses
balance. If A⁺σ are the forces of stresses σ, then L' = L − A⁺σ₀ does the same work as L on any
velocity that preserves volumes and the shape of elastic bodies. The stress σ' is in equilibrium
with λL' if and only if σ' + λσ₀ is in equilibrium with λL.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import (
    PROXIMAL,
    Block,
    Borne,
    Moduli,
    Places,
    Rates,
)
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, Discretisation
from perfplast_fenicsx.limit_analysis.conic.half_spaces import Pairs
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import (
    Cones,
    Cylinders,
    powers,
    yield_ratios,
)

Stress: TypeAlias = tuple[Floats, Floats]
"""Mean stress and deviator at the points, shapes (count,) and (count, m)."""

SOFTEST = 1e-10
"""Least modulus of points.

Without this limit, weak points that flow next to strong, load-carrying points would have a modulus
of almost zero. With bulk moduli of 1e5, K would then be singular in double precision.
"""

CONTRAST = 1e4
"""Largest strength of points that may flow, relative to the strength of the points that carry the
loads. The ratio of the moduli in a step is the square of this number. With a larger contrast,
rounding in double precision would spoil the equilibrium of the weak points.
"""


RESERVES = (1e-5, 1e-3, 1e-2)
"""Shares of the strengths that are kept in reserve for rounding if there are constant loads or
points without cohesion. The first share is the initial share, unless a tenth of the tolerance is
smaller. The second is the largest share if the excess over the yield set is not known; the third is
the largest share if this excess is known.
"""

UNLIMITED = (
    "nothing limits the loads, up to rounding: mean stresses, bodies that do not yield and"
    " contact pressures balance the loads at any load factor"
)


@dataclass(frozen=True)
class Start:
    """The start of a search.

    Attributes:
        scale: Yield radius (stress) of the bodies that carry the loads; None if the viscous flow
            determines this radius.
        pushed: Whether contact carries most of the loads. In this case the flow with soft contact
            springs gives no information.
        reserve: Share of the strengths that is kept in reserve if there are constant loads or
            points without cohesion.
    """

    scale: float | None = None
    pushed: bool = False
    reserve: float = RESERVES[0]

    @classmethod
    def within(cls, rtol: float) -> "Start":
        """Return the first start of a search with a relative tolerance."""
        return cls(reserve=min(RESERVES[0], rtol / 10))

    def with_more_in_reserve(self, over: float | None = None) -> "Start | None":
        """Return the next start, with a larger reserve; None if the reserve would change the bound.

        Args:
            over: Relative excess of the stress over the yield set; None if it is unknown.
        """
        most = RESERVES[1] if over is None else RESERVES[2]
        if self.reserve >= most:
            return None
        more = 10 * self.reserve
        if over is not None:
            # The next excess is expected to be at most one and a half times the last.
            more = max(3 * self.reserve, self.reserve + 1.5 * over)
        return replace(self, reserve=min(more, most))


PRESSED = 10.0
"""Ratio of the frictional strength under the constant loads to the cohesion, above which the
frictional strength replaces the cohesion as the size of a point's strength."""


class ConicProgram:
    """The static and the kinematic problem of one discretisation.

    Attributes:
        comm: The ranks.
        strains: Strain rates at the points.
        stiffness: Stiffness K, which can be assembled with any moduli.
        load: L without the part that ``carried`` balances.
        dead: L₀ without the part that ``carried_dead`` balances.
        free: Loads with a free factor, which may help to balance the other loads. These loads do no
            work on v.
        loads: ``load`` and, if there are loads with a free factor, ``free``.
        has_dead: Whether there are constant loads L₀.
        jumps: Indices of the owned entries of velocities that are jumps of contact pairs;
            ``num_pairs`` on all ranks together.
        plastic: Flags of the points of this rank that can yield, shape (count,); the program treats
            other points as elastic.
        weights: Weights w with mean 1, shape (count,).
        sizes: Sizes of strengths (stress), shape (count,): γ; α times a mean stress where γ = 0, or
            where constant loads make this product much larger; ∞ in elastic bodies.
        loose: Whether any point of any rank has no cohesion.
        keeps: Whether scaling cannot bring a stress into the yield sets, because there are constant
            loads or points without cohesion.
        strengths: Sizes of the strengths of plastic points, about 1 in the bodies that carry the
            loads, and 0 at points that are not plastic, shape (count,).
        dilates: Whether any plastic point of any rank dilates.
        strongest: Upper limit of ``sizes`` (stress) at plastic points, ∞ without a limit.
        springs: Stiffness of contact that suits the stiffness of the bodies, shape (num_pairs,).
        degree: Sum of the degrees of the blocks of all ranks.
        stress_unit: Unit of σ.
        load_unit: Unit of λ; ``force_unit`` is the unit of r.
        carried: Unbounded stress (mean stresses, and stresses at points that are not plastic) that
            balances a part of L; ``carried_dead`` balances a part of L₀. None if there is no such
            part.
    """

    def __init__(self, on: Discretisation, reserve: float) -> None:
        """Store a discretisation, take ownership of its PETSc objects, and set first units.

        Collective.

        Args:
            on: The discretisation.
            reserve: Share of the strengths that is kept in reserve for rounding, if scaling cannot
                bring a stress into the yield sets.
        """
        self._reserve, self._of_slopes = reserve, on.proves_stress
        self.comm, self.strains, self.stiffness = on.comm, on.strains, on.stiffness
        strains, self.jumps = on.strains, on.jumps
        self._loose = strains.radii == 0
        finite = strains.radii[np.isfinite(strains.radii) & ~self._loose]
        mine = [strains.count, strains.weights.sum(), len(finite), (1 / finite).sum()]
        forces = [np.abs(of.array_r).sum() for of in (on.dead, on.load)]
        points, volume, cones, weaknesses, pairs, loose, dead, live = self.comm.allreduce(
            np.array([*mine, len(on.jumps), self._loose.sum(), *forces])
        )
        self.num_pairs = int(pairs)
        self._mean_weight = volume / points
        self.weights = strains.weights / self._mean_weight
        self.load, self.dead, self.free = on.load, on.dead, on.free
        self.has_dead = float(on.dead.norm()) > 0
        self.loads = [on.load, on.free] if float(on.free.norm()) > 0 else [on.load]
        self.loose, self.sizes = bool(loose), strains.radii
        self.keeps = self.has_dead or self.loose
        mean = (dead or live) / volume ** (1 - 1 / strains.gdim)
        mean = mean if dead or not cones else cones / weaknesses
        by_pressure = np.where(np.isfinite(strains.radii), strains.slopes * mean, 0.0)
        pressed = self.has_dead & (by_pressure > PRESSED * strains.radii)
        if loose or self.comm.allreduce(bool(pressed.any()), MPI.LOR):
            self.sizes = np.where(self._loose | pressed, by_pressure, strains.radii)
            finite = self.sizes[np.isfinite(self.sizes)]
            cones, weaknesses = self.comm.allreduce(np.array([len(finite), (1 / finite).sum()]))
        self.load_unit = self.stress_unit = self.force_unit = 1.0
        self.springs: Floats = np.zeros(len(on.jumps))
        self.carried: Stress | None = None
        self.carried_dead: Stress | None = None
        self.measure(cones / weaknesses if cones else 1.0)  # weak bodies dominate the mean

    def measure(self, unit: float, strongest: float = np.inf) -> None:
        """Set the unit of stress and the points that can yield, and scale the loads. Collective.

        Args:
            unit: Unit of stress.
            strongest: Upper limit of ``sizes`` (stress) at points that can yield; stronger points
                are elastic.
        """
        self.strongest = strongest
        self.plastic = np.isfinite(self.sizes) & (self.sizes <= strongest)
        left = 1 - self._reserve if self.keeps else 1.0
        self.strengths = left / unit * np.where(self.plastic, self.sizes, 0.0)
        self._of_points = self._blocks_of_points(unit, left)
        mine = sum(block.degree for block in self._of_points)
        dilating = np.count_nonzero(self.strains.slopes[self.plastic])
        many, some = self.comm.allreduce(np.array([mine, dilating]))
        self.degree, self.dilates = self.num_pairs + int(many), bool(some)
        before, self.force_unit = self.force_unit, unit * self._mean_weight
        self.stress_unit = unit
        for load in (self.load, self.dead, self.free):
            load.scale(before / self.force_unit)

    def _blocks_of_points(self, unit: float, left: float) -> list[Block]:
        """Return the blocks of points that can yield, one for each kind of cone.

        Args:
            unit: Unit of stress.
            left: Share of the strengths that the reserve leaves.
        """
        strains, found = self.strains, list[Block]()
        sets = [it.those(self.plastic[it.at]) for it in strains.sets]
        rest = self.plastic.copy()
        for it in sets:
            rest[it.at] = False
        slopes = strains.slopes * np.where(self._loose & self._of_slopes, left, 1.0)
        radii = left / unit * np.where(self.plastic, strains.radii, 0.0)
        for kind, there in ((Cylinders, slopes == 0), (Cones, slopes > 0)):
            at = np.flatnonzero(rest & there)
            if len(at):
                here: Places = slice(None) if len(at) == len(rest) else at
                tilts = None if strains.tilts is None else strains.tilts[here]
                strengths, weights = self.strengths[here], self.weights[here]
                found.append(kind(here, radii[here], strengths, weights, slopes[here], tilts))
        for it in sets:
            if len(it.at):
                found.append(it.block(unit / left, self.weights[it.at]))
        return found

    @property
    def blocks(self) -> Sequence[Block]:
        """Return the blocks of this rank, one for each kind of cone, contact pairs last."""
        return (*self._of_points, Pairs(self.springs))

    def multiply(self, unit: float) -> None:
        """Multiply L by ``unit``, and thereby divide the unknown load factor by ``unit``."""
        self.load_unit *= unit
        self.load.scale(unit)
        if self.carried is not None:
            self.carried = (unit * self.carried[0], unit * self.carried[1])

    def stronger(self) -> float | None:
        """Return the smallest entry of ``sizes`` above ``strongest``; None without such an entry.

        Collective. The entry may be on any rank; entries of elastic bodies do not count.
        """
        mine = float(self.sizes[self.sizes > self.strongest].min(initial=np.inf))
        least = float(self.comm.allreduce(mine, MPI.MIN))
        return least if np.isfinite(least) else None

    def range(self, values: Floats) -> tuple[float, float]:
        """Return the smallest of the values, and the largest of the values and 0. Collective."""
        least, largest = float(values.min(initial=np.inf)), float(values.max(initial=0.0))
        return self.comm.allreduce(least, MPI.MIN), self.comm.allreduce(largest, MPI.MAX)

    def overstress(self, stress: Stress) -> float:
        """Return the largest yield ratio of a stress over all points, including elastic points.

        Collective.

        Args:
            stress: Stress in units of ``stress_unit``.
        """
        ratios = yield_ratios(self.strains, *(self.stress_unit * part for part in stress))
        return float(self.comm.allreduce(ratios.max(initial=0.0), MPI.MAX))

    def nothing_borne(self) -> Borne:
        """Return zero stress and zero forces."""
        count, size = self.strains.count, self.strains.size
        return Borne(np.zeros(count), np.zeros((count, size), order="F"), np.zeros(len(self.jumps)))

    def rates_of(self, velocity: PETSc.Vec) -> Rates:
        """Return the strain rates and the jumps of a velocity. Collective."""
        return Rates(*self.strains.of(velocity), velocity.array_r[self.jumps])

    def whole(self, stress: Stress, load: float) -> Stress:
        """Return the stress that balances all loads, from a stress for the reduced loads."""
        for share, carried in ((load, self.carried), (1.0, self.carried_dead)):
            if carried is not None:
                stress = stress[0] + share * carried[0], stress[1] + share * carried[1]
        return stress

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        for thing in (self.strains, self.stiffness, self.load, self.dead, self.free):
            thing.destroy()

    def dead_to_live(self) -> float:
        """Return the ratio of the largest force in L₀ to the largest force in L. Collective."""
        largest = PETSc.NormType.NORM_INFINITY
        return float(self.dead.norm(largest) / self.load.norm(largest)) if self.has_dead else 0.0

    def create_vector(self) -> PETSc.Vec:
        """Return a zero velocity. Collective."""
        vector = self.load.duplicate()
        vector.set(0)
        return vector

    def viscous_stress(self, velocity: PETSc.Vec) -> Stress:
        """Return the viscous stress of the flow that determines the units. Collective."""
        trace, deviator = self.strains.of(velocity)
        moduli = self.flow_moduli()
        return self.weights * moduli.bulk * trace, (self.weights * moduli.a)[:, None] * deviator

    def flow_moduli(self) -> Moduli:
        """Return the moduli of the flow that determines the units, and of the first step."""
        found = self.moduli(1 / PROXIMAL)
        for block in self._of_points:
            block.flow(found)
        return found

    def moduli(self, uniform: float) -> Moduli:
        """Return moduli with κ = a = ``uniform`` at all points, and N = 0."""
        shape = self.strains.count, self.strains.size
        bulk, a = np.full(shape[0], uniform), np.full(shape[0], uniform)
        return Moduli(bulk, a, np.zeros(shape, order="F"))

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K from w² times the moduli, plus springs; see :class:`discretisation.Stiffness`.

        The method raises coefficients a below :data:`SOFTEST` to this value. The directions are
        then slightly less exact, and later directions correct the remaining unbalanced forces.
        """
        scale = self.weights / self._mean_weight
        scaled = Moduli(
            scale * moduli.bulk,
            scale * np.maximum(moduli.a, SOFTEST),
            np.sqrt(scale)[:, None] * moduli.normal,
            moduli.along,
        )
        if moduli.whole is not None:
            at, roots = moduli.whole
            scaled = scaled.with_whole(at, np.sqrt(scale[at])[:, None, None] * roots)
        self.stiffness.assemble(scaled, held)
        if moduli.springs is not None:
            self.stiffness.add_at_jumps(moduli.springs)

    def internal_forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w (p δ + s):ε(v) for all v. Collective."""
        self.strains.forces(pressure / self._mean_weight, deviator / self._mean_weight, out)

    def work(self, velocity: PETSc.Vec) -> float:
        """Return L(v). Collective."""
        return float(self.load.dot(velocity))

    def works(self, velocity: PETSc.Vec) -> Floats:
        """Return the works of the loads with unknown factors, shape (1,) or (2,). Collective."""
        return np.array([float(load.dot(velocity)) for load in self.loads])

    def missing_works(self, velocity: PETSc.Vec) -> Floats:
        """Return the required works (1 for L, 0 for free loads) minus :meth:`works`. Collective."""
        return np.array([1.0, 0.0])[: len(self.loads)] - self.works(velocity)

    def dead_work(self, velocity: PETSc.Vec) -> float:
        """Return L₀(v). Collective."""
        return float(self.dead.dot(velocity)) if self.has_dead else 0.0

    def dissipation(self, velocity: PETSc.Vec) -> float:
        """Return the dissipation of a velocity, in the program's units. Collective.

        The dissipation is Σ w γ(‖dev ε(v)‖ − t·dev ε(v)), and Σ w (γ/α) tr ε(v) where bodies
        dilate; yield sets of other kinds add their support functions. The sum is over all points
        with a finite yield radius. The velocity must be admissible.
        """
        power = powers(self.strains, *self.strains.of(velocity))
        return self.total(float(self.weights @ power)) / self.stress_unit

    def rates(self, velocity: PETSc.Vec) -> tuple[float, float]:
        """Return the root mean squares of the inadmissible part of ε(v) and of ε(v). Collective.

        In bodies that dilate, the inadmissible part is the amount by which tr ε(v) is too small. In
        the program's units, the second value is about 1 for a flow that dissipates.
        """
        trace, deviator = self.strains.of(velocity)
        squares = np.einsum("ni,ni->n", deviator, deviator)
        volume = trace**2 / self.strains.gdim
        wrong = volume + np.where(self.plastic, 0.0, squares)
        if self.dilates:
            slopes = self.strains.slopes
            short = np.maximum(slopes * np.sqrt(squares) - trace, 0.0)
            for it in self.strains.sets:
                short[it.at] = it.lacking(trace, deviator)
            wrong = np.where(self.plastic & (slopes > 0), short**2, wrong)
        values = np.column_stack([wrong, volume + squares, np.ones_like(wrong)])
        part, whole, size = self.comm.allreduce(self.weights @ values)
        return float(np.sqrt(part / size)), float(np.sqrt(whole / size))

    def total(self, value: float) -> float:
        """Return the sum of ``value`` over all ranks. Collective."""
        return float(self.comm.allreduce(value))
