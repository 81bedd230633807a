"""Units in which a limit load is about 1, from the flow of viscous bodies under the same loads.

The flow shows the strength that matters: that of the points in which it dissipates. A weak layer in
a stack flows alone, a weak column beside a strong one with it. Bodies that are far stronger are as
elastic ones then. Both bounds stay bounds: a stress is scaled into the true yield sets in the end,
and what a velocity dissipates is counted with the true yield radii. Only the search is restricted,
and not wrongly where the stress found is within yield in the strong bodies too. Otherwise they are
the next ones that matter (:meth:`ConicProgram.stronger`).

And it shows which part of the loads drives a flow at all. Mean stresses, and those of bodies that
do not yield, have no bounds; what they balance is taken off the loads. With A⁺σ the forces of
stresses σ, L' = L − A⁺σ₀ does the same work as L on any velocity that keeps volumes and the shape
of what does not yield, and σ' is in equilibrium with λL' where σ' + λσ₀ is with λL.
"""

from dataclasses import dataclass, replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import PROXIMAL
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram, Stress
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import Unknowns
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict

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


def next_start(
    start: Start, program: ConicProgram, now: Unknowns | None, verdict: Verdict, rtol: float
) -> Start | None:
    """Return the next start if a search has not found what is sought; None to end. Collective.

    Args:
        start: Where it began.
        program: That of the search.
        now: Where it ended; None if it has not begun.
        verdict: What came of it.
        rtol: By how much stress may exceed yield that was found.
    """
    if verdict is Verdict.UNBOUNDED and now is not None and program.num_pairs and not start.pushed:
        return replace(start, pushed=True)
    over = False
    if now is not None:
        whole = program.whole(now.stress, now.load)
        over = program.overstress(whole) > 1 + rtol
    if verdict is Verdict.NO_RESISTANCE or (verdict is Verdict.FOUND and not over):
        return None
    stronger = program.stronger()
    return None if stronger is None else replace(start, scale=stronger, pushed=False)


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
