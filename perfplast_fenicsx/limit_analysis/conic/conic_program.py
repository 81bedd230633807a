"""A limit load as a static and a kinematic problem, in units that make numbers about 1.

On points with weights w,

    max λ               with  Σ w σ:ε(v) + r·[v] = λ L(v) + L₀(v),   ‖dev σ‖ ≤ γ − αp,   r ≥ 0,
    min Σ γ z₀ − L₀(v)  with  L(v) = 1,   αz₀ = w tr ε(v),   z₀ ≥ w‖dev ε(v)‖,   [v] ≤ 0,

in the coordinates of each point's cone (:mod:`standard_cones`; of sets about another stress than
zero with s + γt in the place of dev σ). L₀ is of the loads that stay as they are, [v] are the jumps
of contact pairs and obstacles, r their forces and p the mean stress. Where α = 0 bodies keep their
volume; else they dilate, tr ε(v) ≥ α‖dev ε(v)‖. In elastic bodies ‖dev σ‖ is not bounded, and
ε(v) = 0. The gaps of contact play no part: a body that moves without end has closed or opened them
(E. Christiansen, Handbook of Numerical Analysis IV, 1996).

A :class:`discretisation.Discretisation` defines the velocities v: displacements of finite elements
(:mod:`limit_program`), or the multipliers of the equilibrium of piecewise linear stresses
(:mod:`static_program`).

Units come from the flow of viscous bodies under the same loads (:func:`choose_units`). The flow
shows the strength that matters: that of the points in which it dissipates. A weak layer in a stack
flows alone, a weak column beside a strong one with it. Bodies that are far stronger are as
elastic ones then. Both bounds stay bounds: a stress is scaled into the true yield sets in the end,
and what a velocity dissipates is counted with the true yield radii. Only the search is restricted,
and not wrongly where the stress found is within yield in the strong bodies too. Otherwise they are
the next ones that matter (:meth:`ConicProgram.stronger`).

And it shows which part of the loads drives a flow at all. Mean stresses, and those of bodies that
do not yield, have no bounds; what they balance is taken off the loads. With A⁺σ the forces of
stresses σ, L' = L − A⁺σ₀ does the same work as L on any velocity that keeps volumes and the shape
of what does not yield, and σ' is in equilibrium with λL' where σ' + λσ₀ is with λL.
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
"""Modulus of points that have none left: of weak ones that flow beside strong ones, which bear the
loads. Without it K is singular in double precision beside bulk moduli of 1e5."""

CONTRAST = 1e4
"""Ratio of strengths above that of those that bear the loads, of points that do not flow: the
moduli of a step would have a range of its square, and in double precision nothing is left of the
balance of the weak ones."""


RESERVES = (1e-5, 1e-3, 1e-2)
"""Shares of the strengths that beside dead loads are kept for what rounding leaves of a stress: at
first, or a tenth of the tolerance that bounds are sought with, and at most where it has left yield
by more, where it is not known and where it is known by how much."""

UNLIMITED = (
    "nothing limits the loads, to rounding: mean stresses, bodies that do not yield and contact"
    " that pushes carry them at any factor"
)


@dataclass(frozen=True)
class Start:
    """The start of a search.

    Attributes:
        scale: Yield radius (stress) of those that bear the loads; None if the flow is to determine
            it.
        pushed: Whether contact carries most of the loads, so that a flow with soft springs in its
            place says nothing.
        reserve: Share of the strengths that is kept beside dead loads.
    """

    scale: float | None = None
    pushed: bool = False
    reserve: float = RESERVES[0]

    @classmethod
    def within(cls, rtol: float) -> "Start":
        """Return the first one of a search with a tolerance, relative."""
        return cls(reserve=min(RESERVES[0], rtol / 10))

    def with_more_in_reserve(self, over: float | None = None) -> "Start | None":
        """Return the next one with more in reserve; None if that would change the bound.

        Args:
            over: By how much the stress has left yield, relative, if that is known.
        """
        most = RESERVES[1] if over is None else RESERVES[2]
        if self.reserve >= most:
            return None
        more = 10 * self.reserve
        if over is not None:
            # What was missing is missing again, or half as much more.
            more = max(3 * self.reserve, self.reserve + 1.5 * over)
        return replace(self, reserve=min(more, most))


PRESSED = 10.0
"""Ratio of the strength that friction gives under constant loads to the cohesion, above which
friction determines the size of a strength."""


class ConicProgram:
    """Both problems of one discretisation.

    Attributes:
        comm: The ranks.
        strains: Strain rates at the points.
        stiffness: K, to be assembled with any moduli.
        load: L, less what ``carried`` balances.
        dead: L₀, less what ``carried_dead`` does.
        free: Loads of any factor, which may help to carry the others: they do no work on v.
        has_free: Whether there are any.
        has_dead: Whether there is any L₀.
        jumps: Local (owned) entries of velocities that are jumps of contact pairs, ``num_pairs`` on
            all ranks together.
        plastic: Which points of this rank can yield, shape (count,): others are as elastic ones.
        weights: w, 1 in the mean, shape (count,).
        sizes: Sizes of strengths (stress), shape (count,): γ, or α times a mean stress of the
            constant loads where that is much more; ∞ where nothing yields.
        loose: Whether any point of any rank has no cohesion.
        keeps: Whether no stress can be scaled into yield: beside constant loads, without cohesion.
        strengths: Sizes of those that can yield, about 1 where bodies bear the loads, and 0 of
            others, shape (count,).
        dilates: Whether any plastic point of any rank does.
        strongest: Largest γ (stress) of the plastic points.
        springs: Stiffness of contact that suits that of the bodies, shape (num_pairs,).
        degree: Of the blocks of all ranks.
        stress_unit: What 1 is of σ.
        load_unit: What 1 is of λ, ``force_unit`` of r.
        carried: Stress that nothing bounds, of pressures and of points that are not plastic, which
            balances a part of L, ``carried_dead`` of L₀; None of no part.
    """

    def __init__(self, on: Discretisation, reserve: float) -> None:
        """Take a discretisation over, its PETSc objects too. Collective.

        Args:
            on: The discretisation.
            reserve: Share of the strengths that is kept for what rounding leaves of a stress, where
                one that is above yield cannot be scaled into it.
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
        self.measure(cones / weaknesses if cones else 1.0)  # that of weak bodies counts

    def measure(self, unit: float, strongest: float = np.inf) -> None:
        """Measure stresses in a unit, and let yield what is weak enough. Collective.

        Args:
            unit: Unit of stress.
            strongest: Points of larger yield radii (stress) are as elastic ones.
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
        """Points that can yield, by the kind of their cones.

        Args:
            unit: Of stress.
            left: Share of the strengths that is left of them.
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
        """Points and pairs of this rank by the kind of their cones, the pairs last."""
        return (*self._of_points, Pairs(self.springs))

    def multiply(self, unit: float) -> None:
        """Multiply the loads, and so divide the load factor that is sought."""
        self.load_unit *= unit
        self.load.scale(unit)
        if self.carried is not None:
            self.carried = (unit * self.carried[0], unit * self.carried[1])

    def stronger(self) -> float | None:
        """Least yield radius (stress) of points that cannot yield, or None. Collective."""
        mine = float(self.sizes[self.sizes > self.strongest].min(initial=np.inf))
        least = float(self.comm.allreduce(mine, MPI.MIN))
        return least if np.isfinite(least) else None

    def range(self, values: Floats) -> tuple[float, float]:
        """Least and largest of all ranks' values. Collective."""
        least, largest = float(values.min(initial=np.inf)), float(values.max(initial=0.0))
        return self.comm.allreduce(least, MPI.MIN), self.comm.allreduce(largest, MPI.MAX)

    def overstress(self, stress: Stress) -> float:
        """By how much stresses exceed yield at most, in points that do not flow too. Collective.

        Args:
            stress: In units of ``stress_unit``.
        """
        ratios = yield_ratios(self.strains, *(self.stress_unit * part for part in stress))
        return float(self.comm.allreduce(ratios.max(initial=0.0), MPI.MAX))

    def nothing_borne(self) -> Borne:
        """No stress and no forces."""
        count, size = self.strains.count, self.strains.size
        return Borne(np.zeros(count), np.zeros((count, size), order="F"), np.zeros(len(self.jumps)))

    def rates_of(self, velocity: PETSc.Vec) -> Rates:
        """Strain rates and jumps of a velocity. Collective."""
        return Rates(*self.strains.of(velocity), velocity.array_r[self.jumps])

    def whole(self, stress: Stress, load: float) -> Stress:
        """Return a stress that balances all loads, of one that balances what of them is sought."""
        for share, carried in ((load, self.carried), (1.0, self.carried_dead)):
            if carried is not None:
                stress = stress[0] + share * carried[0], stress[1] + share * carried[1]
        return stress

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
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
        """Pressure and deviator of the flow that units are chosen by. Collective."""
        trace, deviator = self.strains.of(velocity)
        moduli = self.flow_moduli()
        return self.weights * moduli.bulk * trace, (self.weights * moduli.a)[:, None] * deviator

    def flow_moduli(self) -> Moduli:
        """Those of the flow that units are chosen by, and of the first step."""
        found = self.moduli(1 / PROXIMAL)
        for block in self._of_points:
            block.flow(found)
        return found

    def moduli(self, uniform: float) -> Moduli:
        """Moduli that are the same at all points."""
        shape = self.strains.count, self.strains.size
        bulk, a = np.full(shape[0], uniform), np.full(shape[0], uniform)
        return Moduli(bulk, a, np.zeros(shape, order="F"))

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble Σ w² times the moduli, and springs; see :class:`discretisation.Stiffness`.

        No a counts as less than :data:`SOFTEST`: directions are a little less exact then, and the
        balance that they leave is made up for by the next ones.
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
        """L(v). Collective."""
        return float(self.load.dot(velocity))

    def dead_work(self, velocity: PETSc.Vec) -> float:
        """L₀(v). Collective."""
        return float(self.dead.dot(velocity)) if self.has_dead else 0.0

    def dissipation(self, velocity: PETSc.Vec) -> float:
        """Σ w γ(‖dev ε(v)‖ − t·dev ε(v)), and (γ/α) tr ε(v) where bodies dilate. Collective.

        Over all points that have a yield radius, of a velocity that is admissible.
        """
        power = powers(self.strains, *self.strains.of(velocity))
        return self.total(float(self.weights @ power)) / self.stress_unit

    def rates(self, velocity: PETSc.Vec) -> tuple[float, float]:
        """Return root mean squares of the inadmissible part of ε(v), and of ε(v). Collective.

        Of bodies that dilate it is what their volume grows too little by. In these units the latter
        is about 1 of a flow that meets resistance.
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
        """Sum over all ranks. Collective."""
        return float(self.comm.allreduce(value))


def choose_units(program: ConicProgram, start: Start) -> bool:
    """Make the limit load about as large as there are points and pairs. Collective.

    The last factors are those of the flow.

    Args:
        program: Whose units they are, as it was made.
        start: What is known.

    Returns:
        Whether something limits the loads.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    flow = program.create_vector()
    # Springs of contact so many times as stiff as bodies leave little of what contact carries.
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
        unit = _dissipation(program, flow) / program.work(flow) / max(program.degree, 1)
        if start.pushed:  # forces begin at the roots of springs: at those of the limit load
            pushes = program.degree * unit * pushes
            program.springs = np.maximum(program.springs, pushes**2)
            _flow(program, flow, program.springs)
    finally:
        flow.destroy()
    program.multiply(unit)
    return True


def _flow(program: ConicProgram, flow: PETSc.Vec, springs: Floats | None = None) -> None:
    """Find the flow that the loads drive, with springs at contact. Collective.

    Args:
        program: The bodies and their loads.
        flow: Set to the flow.
        springs: By default, and then the program's, those that suit the bodies.
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
    """Σ w γ‖dev ε(v)‖ over the points that can yield. Collective."""
    _, deviator = program.strains.of(flow)
    rates = np.linalg.norm(deviator, axis=1)
    return program.total(float((program.weights * program.strengths) @ rates))


def _measure_by(program: ConicProgram, flow: PETSc.Vec) -> bool:
    """Measure stresses by the mean strength where the flow dissipates. Collective.

    Returns:
        Whether units are others than before.
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
    """Take off the dead loads what stresses carry that nothing bounds. Collective.

    With the factors that there are. Where no flow is left of them such stresses carry them whole.
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
    """Take off loads what stresses carry that nothing bounds, where that is most. Collective.

    Uzawa's iteration, with the factors of the flow. What contact carries is left in the loads,
    since its forces must not pull; the flow is that of the rest in the end.

    Args:
        program: Whose loads they are.
        load: The loads, of which what is carried is taken off.
        flow: That of the loads.
        springs: Springs of contact, whose forces are looked for as well; None if not.

    Returns:
        What is carried, None of nothing; contact forces, zeros where none are looked for; whether
        any flow is left.
    """
    given, left, rest = load.copy(), program.create_vector(), load.copy()
    carried: Stress | None = None
    pressure: Floats = np.zeros(program.strains.count)
    stress: Floats = np.zeros((len(pressure), program.strains.size))
    pushes: Floats = np.zeros(len(program.jumps))
    bulk, first = program.weights / PROXIMAL, float(load.dot(flow))
    bounded = program.plastic & (program.strains.slopes > 0)
    # Share of the power, of stresses that nothing bounds, from which on the loads are divided: it
    # is 1e-5 of a load that a flow resists, and all of one that no flow does.
    mostly = 0.1
    # Share of the power at first that no flow leaves: the square of what rounding leaves of loads
    # that are balanced, over the proximal modulus.
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
