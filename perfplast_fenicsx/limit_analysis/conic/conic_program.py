"""Pose a limit load as a static and a kinematic problem, in units that make numbers about 1.

On points with weights w,

    max λ               with  Σ w σ:ε(v) + r·[v] = λ L(v) + L₀(v),   ‖dev σ‖ ≤ γ − αp,   r ≥ 0,
    min Σ γ z₀ − L₀(v)  with  L(v) = 1,   αz₀ = w tr ε(v),   z₀ ≥ w‖dev ε(v)‖,   [v] ≤ 0,

in the coordinates of each point's cone (:mod:`standard_cones`). For sets about a stress other than
zero, s + γt replaces dev σ. L₀ are the permanent loads, [v] the jumps of contact pairs and
obstacles, r their forces and p the mean stress. If α = 0, bodies preserve their volume; otherwise
they dilate, tr ε(v) ≥ α‖dev ε(v)‖. In elastic bodies ‖dev σ‖ is not bounded, and ε(v) = 0. The gaps
of contact do not matter: unlimited motion has closed or opened all of them (E. Christiansen,
Handbook of Numerical Analysis IV, 1996).

A :class:`discretisation.Discretisation` defines the velocities v: displacements of finite elements
(:mod:`discrete_limit`), or the multipliers of the equilibrium of piecewise linear stresses
(:mod:`static_program`).

Units come from the flow of viscous bodies under the same loads (:func:`choose_units`). This flow
shows which strength matters: the one of the points where it dissipates. For example, a weak layer
in a stack flows alone, and a weak column next to a strong one flows together with it. Bodies that
are far stronger are then treated as elastic. Both bounds remain bounds: the final stress is scaled
into the true yield sets, and the dissipation of a velocity is computed with the true yield radii.
The restriction affects only the search, and not its result if the stress is within yield in the
strong bodies too. Otherwise the weakest of them become plastic as well
(:meth:`ConicProgram.stronger`).

The flow also shows which part of the loads drives it at all. Mean stresses, and stresses of bodies
that do not yield, have no bounds; the loads that they balance are subtracted. If A⁺σ are the forces
of stresses σ, then L' = L − A⁺σ₀ does the same work as L on any velocity that preserves volumes and
the shape of elastic bodies. The stress σ' is in equilibrium with λL' if σ' + λσ₀ is with λL.
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
"""Pressure and deviator at the points, shapes (count,) and (count, m)."""

SOFTEST = 1e-10
"""Least modulus of points.

Weak points that flow next to strong ones, which carry the loads, would have almost none. Without it
K is singular in double precision with bulk moduli of 1e5.
"""

CONTRAST = 1e4
"""Ratio to the strength of the points that bear the loads, above which points do not flow. The
moduli of a step would have a range of its square, and in double precision the balance of the weak
points would be lost.
"""


RESERVES = (1e-5, 1e-3, 1e-2)
"""Shares of the strengths that are kept in reserve for rounding if there are permanent loads: the
initial one (or a tenth of the tolerance), the largest one if the excess over yield is not known,
and the largest one if it is known.
"""

UNLIMITED = (
    "nothing limits the loads, to rounding: mean stresses, bodies that do not yield and contact"
    " that pushes carry them at any factor"
)


@dataclass(frozen=True)
class Start:
    """The start of a search.

    Attributes:
        scale: Yield radius (stress) of the bodies that bear the loads; None if the flow is to
            determine it.
        pushed: Whether contact carries most of the loads, so that a flow with soft springs in its
            place gives no information.
        reserve: Share of the strengths that is kept in reserve if there are permanent loads.
    """

    scale: float | None = None
    pushed: bool = False
    reserve: float = RESERVES[0]

    @classmethod
    def within(cls, rtol: float) -> "Start":
        """Return the first start of a search with a relative tolerance."""
        return cls(reserve=min(RESERVES[0], rtol / 10))

    def with_more_in_reserve(self, over: float | None = None) -> "Start | None":
        """Return the next start with a larger reserve; None if that would change the bound.

        Args:
            over: Relative excess of the stress over yield, if it is known.
        """
        most = RESERVES[1] if over is None else RESERVES[2]
        if self.reserve >= most:
            return None
        more = 10 * self.reserve
        if over is not None:
            # The same excess is expected again, or one and a half times it.
            more = max(3 * self.reserve, self.reserve + 1.5 * over)
        return replace(self, reserve=min(more, most))


NO_STRAIN = 1e-4
"""Share of the work of constant loads below which the dissipation of a flow is negligible. Loads on
both sides of a contact drive a flow that opens it, and bodies move as rigid ones. The constant
loads then limit it."""

PRESSED = 10.0
"""Ratio of the strength that friction gives under constant loads to the cohesion, above which
friction determines the size of a strength."""


class ConicProgram:
    """The static and the kinematic problem of one discretisation.

    Attributes:
        comm: The ranks.
        strains: Strain rates at the points.
        stiffness: K, to be assembled with any moduli.
        load: L, less the part that ``carried`` balances.
        dead: L₀, less the part that ``carried_dead`` balances.
        free: Loads of any factor, which may help to carry the others: they do no work on v.
        has_free: Whether there are any such loads.
        has_dead: Whether there are permanent loads L₀.
        jumps: Local (owned) entries of velocities that are jumps of contact pairs, ``num_pairs`` on
            all ranks together.
        plastic: Flags of the points of this rank that can yield, shape (count,); the other points
            are treated as elastic.
        weights: Weights w with mean 1, shape (count,).
        sizes: Sizes of strengths (stress), shape (count,): γ, or α times a mean stress of the
            permanent loads if that is much larger; ∞ in elastic bodies.
        loose: Whether any point of any rank has no cohesion.
        keeps: Whether stresses cannot be scaled into yield: with permanent loads, or without
            cohesion.
        strengths: Sizes of the strengths of plastic points, about 1 in the bodies that bear the
            loads, and 0 at the other points, shape (count,).
        dilates: Whether any plastic point of any rank dilates.
        strongest: Largest γ (stress) of the plastic points.
        springs: Stiffness of contact that suits the stiffness of the bodies, shape (num_pairs,).
        degree: Degree of the blocks of all ranks.
        stress_unit: Unit of σ.
        load_unit: Unit of λ; ``force_unit`` is the unit of r.
        carried: Unbounded stress (pressures, and stresses of points that are not plastic) that
            balances a part of L; ``carried_dead`` balances a part of L₀. None without such a part.
    """

    def __init__(self, on: Discretisation, reserve: float) -> None:
        """Take over a discretisation and its PETSc objects. Collective.

        Args:
            on: The discretisation.
            reserve: Share of the strengths that is kept for rounding, if a stress above yield
                cannot be scaled into it.
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
        self.has_dead, self.has_free = float(on.dead.norm()) > 0, float(on.free.norm()) > 0
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
        self.measure(cones / weaknesses if cones else 1.0)  # the mean is dominated by weak bodies

    def measure(self, unit: float, strongest: float = np.inf) -> None:
        """Measure stresses in a unit, and let points yield that are weak enough. Collective.

        Args:
            unit: Unit of stress.
            strongest: Points with larger yield radii (stress) are treated as elastic.
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
        """Return blocks of the points that can yield, one for each kind of cone.

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
        for dilate in (False, True):
            at = np.flatnonzero(rest & ((slopes > 0) == dilate))
            if not len(at):
                continue
            here: Places = slice(None) if len(at) == len(rest) else at
            given = here, radii[here], self.strengths[here], self.weights[here]
            if dilate:
                found.append(Cones(*given, slopes[here]))
            else:
                tilts = None if strains.tilts is None else strains.tilts[here]
                found.append(Cylinders(*given, tilts))
        for it in sets:
            if len(it.at):
                strengths, weights = self.strengths[it.at], self.weights[it.at]
                found.append(it.block(unit / left, strengths, weights))
        return found

    @property
    def blocks(self) -> Sequence[Block]:
        """Return the blocks of this rank by the kind of their cones, contact pairs last."""
        return (*self._of_points, Pairs(self.springs))

    def multiply(self, unit: float) -> None:
        """Multiply the loads by a factor, and so divide the unknown load factor by it."""
        self.load_unit *= unit
        self.load.scale(unit)
        if self.carried is not None:
            self.carried = (unit * self.carried[0], unit * self.carried[1])

    def stronger(self) -> float | None:
        """Return the least yield radius (stress) of points that cannot yield, or None.

        Collective.
        """
        mine = float(self.sizes[self.sizes > self.strongest].min(initial=np.inf))
        least = float(self.comm.allreduce(mine, MPI.MIN))
        return least if np.isfinite(least) else None

    def range(self, values: Floats) -> tuple[float, float]:
        """Return the smallest and the largest value of all ranks. Collective."""
        least, largest = float(values.min(initial=np.inf)), float(values.max(initial=0.0))
        return self.comm.allreduce(least, MPI.MIN), self.comm.allreduce(largest, MPI.MAX)

    def overstress(self, stress: Stress) -> float:
        """Return the largest yield ratio of a stress, also at points that do not flow. Collective.

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
        """Return strain rates and jumps of a velocity. Collective."""
        return Rates(*self.strains.of(velocity), velocity.array_r[self.jumps])

    def whole(self, stress: Stress, load: float) -> Stress:
        """Return the stress that balances all loads, given one that balances the reduced loads."""
        for share, carried in ((load, self.carried), (1.0, self.carried_dead)):
            if carried is not None:
                stress = stress[0] + share * carried[0], stress[1] + share * carried[1]
        return stress

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        for thing in (self.strains, self.stiffness, self.load, self.dead, self.free):
            thing.destroy()

    def dead_to_live(self) -> float:
        """Return the ratio of the largest force of L₀ to that of L. Collective."""
        largest = PETSc.NormType.NORM_INFINITY
        return float(self.dead.norm(largest) / self.load.norm(largest)) if self.has_dead else 0.0

    def create_vector(self) -> PETSc.Vec:
        """Return a velocity of zeros. Collective."""
        vector = self.load.duplicate()
        vector.set(0)
        return vector

    def viscous_stress(self, velocity: PETSc.Vec) -> Stress:
        """Return pressure and deviator of the flow that determines units. Collective."""
        trace, deviator = self.strains.of(velocity)
        moduli = self.flow_moduli()
        return self.weights * moduli.bulk * trace, (self.weights * moduli.a)[:, None] * deviator

    def flow_moduli(self) -> Moduli:
        """Return the moduli of the flow that determines units, and of the first step."""
        found = self.moduli(1 / PROXIMAL)
        for block in self._of_points:
            block.flow(found)
        return found

    def moduli(self, uniform: float) -> Moduli:
        """Return moduli that are the same at all points."""
        shape = self.strains.count, self.strains.size
        bulk, a = np.full(shape[0], uniform), np.full(shape[0], uniform)
        return Moduli(bulk, a, np.zeros(shape, order="F"))

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble Σ w² times the moduli, and springs; see :class:`discretisation.Stiffness`.

        Coefficients a below :data:`SOFTEST` are raised to it. Directions are then slightly less
        exact, and later directions correct the balance that they leave.
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

    def dead_work(self, velocity: PETSc.Vec) -> float:
        """Return L₀(v). Collective."""
        return float(self.dead.dot(velocity)) if self.has_dead else 0.0

    def dissipation(self, velocity: PETSc.Vec) -> float:
        """Return Σ w γ(‖dev ε(v)‖ − t·dev ε(v)), and (γ/α) tr ε(v) where bodies dilate. Collective.

        The sum is over all points with a finite yield radius; the velocity must be admissible.
        """
        power = powers(self.strains, *self.strains.of(velocity))
        return self.total(float(self.weights @ power)) / self.stress_unit

    def rates(self, velocity: PETSc.Vec) -> tuple[float, float]:
        """Return root mean squares of the inadmissible part of ε(v), and of ε(v). Collective.

        In bodies that dilate, the inadmissible part is the shortfall of their volume growth. In
        these units the second value is about 1 for a flow that meets resistance.
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
        part, whole = (
            self.total(self.weights @ wrong),
            self.total(self.weights @ (volume + squares)),
        )
        size = self.total(self.weights.sum())
        return float(np.sqrt(part / size)), float(np.sqrt(whole / size))

    def total(self, value: float) -> float:
        """Return the sum over all ranks. Collective."""
        return float(self.comm.allreduce(value))


def choose_units(program: ConicProgram, start: Start) -> bool:
    """Scale the limit load to about the number of points and pairs. Collective.

    The stiffness holds the factors of the flow afterwards.

    Args:
        program: The program whose units are chosen, in its initial state.
        start: The start of the search.

    Returns:
        Whether something limits the loads.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    flow = program.create_vector()
    # If springs of contact are this many times as stiff as the bodies, contact carries nearly its
    # full share.
    hard = 1e4
    try:
        if start.scale is not None:
            program.measure(start.scale, CONTRAST * start.scale)
        _flow(program, flow)
        if start.scale is None and _measure_by(program, flow):
            _flow(program, flow)
        springs = None
        if start.pushed:
            springs = hard * program.springs
            _flow(program, flow, springs)
        program.carried, pushes, flows = _divide(program, program.load, flow, springs)
        if not flows:
            return False
        if program.has_dead:
            _divide_dead(program)
        power = _dissipation(program, flow)
        if power <= NO_STRAIN * abs(program.dead_work(flow)):
            power = abs(program.dead_work(flow))
        unit = power / program.work(flow) / max(program.degree, 1)
        # initial forces are the square roots of the springs: those at the limit load
        if start.pushed:
            pushes = program.degree * unit * pushes
            program.springs = np.maximum(program.springs, pushes**2)
            _flow(program, flow, program.springs)
    finally:
        flow.destroy()
    program.multiply(unit)
    return True


def _flow(program: ConicProgram, flow: PETSc.Vec, springs: Floats | None = None) -> None:
    """Solve for the flow that the loads drive, with springs at contact. Collective.

    Args:
        program: The bodies and their loads.
        flow: Set to the flow.
        springs: Springs of contact; by default the program's, which are then set to suit the
            bodies.
    """
    moduli = program.flow_moduli()
    if springs is None and program.num_pairs:
        program.assemble(replace(moduli, bulk=np.ones_like(moduli.bulk)))
        program.springs = program.stiffness.jump_diagonal()
    program.assemble(moduli)
    program.stiffness.add_at_jumps(program.springs if springs is None else springs)
    program.stiffness.factorise()
    program.stiffness.solve(program.load, flow)


def _dissipation(program: ConicProgram, flow: PETSc.Vec) -> float:
    """Return Σ w γ‖dev ε(v)‖ over the points that can yield. Collective."""
    _, deviator = program.strains.of(flow)
    rates = np.linalg.norm(deviator, axis=1)
    return program.total(float((program.weights * program.strengths) @ rates))


def _measure_by(program: ConicProgram, flow: PETSc.Vec) -> bool:
    """Choose as the unit of stress the mean strength where the flow dissipates. Collective.

    Returns:
        Whether the units have changed.
    """
    plastic = program.plastic
    radii = program.strengths[plastic] * program.stress_unit
    least, largest = program.range(radii)
    similar = 10.0  # ratio of strengths that are measured in one unit
    if not largest > similar * least:
        return False
    _, deviator = program.strains.of(flow)
    squares = np.einsum("ni,ni->n", deviator, deviator)[plastic]
    power = program.weights[plastic] ** 2 * program.flow_moduli().a[plastic] * squares
    sums = program.comm.allreduce(np.array([power @ np.log(radii), power.sum()]))
    mean = float(np.exp(sums[0] / sums[1]))
    near = mean / similar < program.stress_unit < mean * similar
    if near and largest <= CONTRAST * mean:
        return False
    program.measure(mean, CONTRAST * mean)
    return True


def _divide_dead(program: ConicProgram) -> None:
    """Subtract from the permanent loads the part that unbounded stresses carry. Collective.

    The present factors are used. If no flow remains, such stresses carry the loads entirely.
    """
    flow = program.create_vector()
    try:
        program.stiffness.solve(program.dead, flow)
        program.carried_dead, _, _ = _divide(program, program.dead, flow, None)
    finally:
        flow.destroy()


def _divide(
    program: ConicProgram, load: PETSc.Vec, flow: PETSc.Vec, springs: Floats | None
) -> tuple[Stress | None, Floats, bool]:
    """Subtract from loads the part that unbounded stresses carry, if it is most of them.

    Collective.

    Uzawa's iteration, with the factors of the flow. The part that contact carries remains in the
    loads, since its forces must not pull. At the end, the flow is that of the remaining loads.

    Args:
        program: The program with the loads.
        load: The loads, from which the carried part is subtracted.
        flow: Flow of the loads.
        springs: Springs of contact whose forces are computed as well; None to compute none.

    Returns:
        The carried stress, None for none; contact forces, zeros if they are not computed; whether
        any flow is left.
    """
    given, left, rest = load.copy(), program.create_vector(), load.copy()
    carried: Stress | None = None
    pressure: Floats = np.zeros(program.strains.count)
    stress: Floats = np.zeros((len(pressure), program.strains.size))
    pushes: Floats = np.zeros(len(program.jumps))
    bulk, first = program.weights / PROXIMAL, float(load.dot(flow))
    bounded = program.plastic & (program.strains.slopes > 0)
    # The loads are divided if unbounded stresses have at least this share of the power. The share
    # is 1e-5 for a load that a flow resists, and 1 for a load that no flow resists.
    mostly = 0.1
    # Share of the initial power that counts as no flow: the square of the rounding of balanced
    # loads, over the proximal modulus.
    no_flow = 1e-16
    most_divisions = 20  # divisions of the loads; two to four were seen
    try:
        for _ in range(most_divisions):
            trace, deviator = program.strains.of(flow)
            of_mean = np.where(bounded, 0.0, bulk * trace)
            of_shape = np.where(program.plastic, 0.0, bulk)[:, None] * deviator
            jumps = flow.array_r[program.jumps]
            more = np.zeros_like(pushes)
            if springs is not None:
                more = np.maximum(springs * jumps, -pushes)
            free = program.weights @ (of_mean * trace + np.einsum("ni,ni->n", of_shape, deviator))
            free = program.total(float(free + np.abs(more) @ np.abs(jumps)))
            power = float(rest.dot(flow))
            if not power > no_flow * first:
                return carried, pushes, False
            if free <= mostly * power:
                break
            pressure, stress, pushes = pressure + of_mean, stress + of_shape, pushes + more
            carried = pressure, stress
            program.internal_forces(pressure, stress, left)
            load.waxpy(-1.0, left, given)
            load.copy(rest)
            rest.array[program.jumps] -= pushes
            program.stiffness.solve(rest, flow)
    finally:
        for vector in (given, left, rest):
            vector.destroy()
    return carried, pushes, True
