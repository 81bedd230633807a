"""Choose the units of a search, and run its steps until the limit load is known."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import PROXIMAL
from perfplast_fenicsx.limit_analysis.conic.conic_program import (
    CONTRAST,
    ConicProgram,
    Start,
    Stress,
)
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, Unknowns

MOST_STEPS = 60

NO_LOAD = 1e-7
"""Loads and strain rates below this share of their values in the viscous flow count as zero."""

CARRIES_NONE = (
    "no stress can carry the loads: the loads move bodies away from supports without resistance"
)
"""Reason for a load factor of zero."""


class StopSearch(Exception):
    """Raised by a monitor on every rank to end the steps and keep the results.

    Attributes:
        found: Results of the search so far; None before the first result.
        adapted: Results on the previous meshes of an adaptive search; None in other searches.
        safety: Proven factors so far in a search for a factor of safety; None in other searches.
    """

    found: object = None
    adapted: object = None
    safety: object = None


class Verdict(StrEnum):
    """The outcome of a search for a limit load."""

    FOUND = "found"
    UNBOUNDED = "unbounded"
    NO_RESISTANCE = "no resistance"
    STALLED = "stalled"


@dataclass(frozen=True)
class InteriorStep:
    """One step of the interior point method.

    Attributes:
        number: Number of the step, from 1.
        load: Load factor λ of the stress, a lower bound once the forces are in balance.
        gap: Kinematic load minus static load for an admissible velocity, relative to the power of
            all loads.
        unbalanced: Largest unbalanced force, relative to the largest load.
        inadmissible: Inadmissible part of ε(v) (:meth:`ConicProgram.rates`), relative to ‖ε(v)‖.
        length: Length of the step, at most 1.
        seconds: Wall time since the start of the search.
    """

    number: int
    load: float
    gap: float
    unbalanced: float
    inadmissible: float
    length: float
    seconds: float


Monitor: TypeAlias = Callable[[InteriorStep], None]
"""Called on every rank after each step."""


def carries_none(program: ConicProgram, most: float, rate: float) -> bool:
    """Return whether the load factor is zero because the bodies move without resistance.

    Args:
        program: The program with the loads.
        most: Upper bound on the power of the loads.
        rate: Root mean square of the strain rates.
    """
    small = most <= NO_LOAD * program.degree and rate <= NO_LOAD
    return small and not program.has_dead


def iterate(
    iteration: InteriorIteration,
    rtol: float,
    steps: list[InteriorStep],
    monitor: Monitor | None,
    share: float = 1.0,
    least: float = 0.0,
) -> tuple[Verdict, str]:
    """Perform steps until the limit load is known; return the outcome and its reason. Collective.

    To first order, unbalanced forces r change λ by r·v, where v is the mechanism with L(v) = 1. The
    caller removes these residuals afterwards, because with residuals λ is not a bound. For the
    arguments, see :class:`conic_solver.ConicSolver`.
    """
    program, velocity, began = iteration.program, iteration.velocity, time.perf_counter()
    good: tuple[Unknowns, Floats] | None = None  # last balanced iterate and its velocity's entries
    # Multiple of the viscous flow's load above which a load without a mechanism is unbounded.
    unbounded = 50.0
    far = unbounded * (program.degree + program.dead_to_live())
    far = max(far, least / program.load_unit)
    # Largest unbalanced force and missing work that the caller can remove afterwards.
    least_residual = 1e-5
    # Largest unbalanced force, relative to the largest load, if unbalanced forces do almost no
    # work. For a body force on fine cells, the largest load is far below the rounding of the
    # internal forces. A velocity whose inadmissible part exceeds this number is far from a
    # mechanism.
    almost = 1e-3
    stuck = 1e-6  # length of a step that counts as zero
    while len(steps) < MOST_STEPS:
        try:
            length = iteration.step()
        except SingularStiffness as failure:
            return Verdict.STALLED, str(failure)
        if length < stuck:
            return Verdict.STALLED, "the steps became too short"
        load, gap, size = iteration.now.load, iteration.gap(), iteration.size()
        unbalanced = iteration.unbalanced()
        missing = np.abs(program.missing_works(velocity)).max()
        wrong, rate = program.rates(velocity)
        inadmissible = wrong / rate if rate > 0 else 0.0
        step = InteriorStep(
            number=len(steps) + 1,
            load=load * program.load_unit,
            gap=gap / size if size else np.inf,
            unbalanced=unbalanced,
            inadmissible=inadmissible,
            length=length,
            seconds=time.perf_counter() - began,
        )
        steps.append(step)
        if monitor is not None:
            monitor(step)
        if load > far and unbalanced <= almost < inadmissible:
            return Verdict.UNBOUNDED, (
                f"admissible stresses carry the loads beyond ζ = {far * program.load_unit:.3g}, so "
                "the loads seem to have no limit"
            )
        at_rest = rate <= NO_LOAD  # bodies move rigidly, and strain rates are rounding errors
        tolerated = share * rtol * size
        idle = unbalanced <= almost and abs(iteration.balance().dot(velocity)) <= tolerated
        balanced = missing <= least_residual and unbalanced <= least_residual
        if good is not None and not balanced:  # rounding errors of a nearly singular K
            iteration.now, velocity.array[:] = good
            return Verdict.FOUND, f"the steps have converged to {rtol:g}"
        settled = missing <= least_residual and (unbalanced <= least_residual or idle)
        if not settled or (inadmissible > almost and not at_rest):
            continue
        if carries_none(program, size + gap, rate):
            return Verdict.NO_RESISTANCE, CARRIES_NONE
        if gap <= tolerated:
            return Verdict.FOUND, f"the steps have converged to {rtol:g}"
        if balanced and gap <= rtol * size:
            good = iteration.kept()
    return Verdict.STALLED, f"the bounds have not met in {MOST_STEPS} steps"


def next_start(
    start: Start, program: ConicProgram, now: Unknowns | None, verdict: Verdict, rtol: float
) -> Start | None:
    """Return the start of the next search; None if no further search is needed or possible.

    Collective.

    Args:
        start: Start of the last search.
        program: Program of the last search.
        now: Final iterate; None if the search has not begun.
        verdict: Outcome of the search.
        rtol: Allowed relative excess of the stress over the yield set.
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


NO_STRAIN = 1e-4
"""Share of the work of constant loads below which the dissipation of a flow is negligible. Loads on
both sides of a contact can drive a flow that opens the contact while the bodies move rigidly. Only
the constant loads then limit the load factor."""


def choose_units(program: ConicProgram, start: Start) -> bool:
    """Choose units in which the limit load is about the program's ``degree``. Collective.

    Afterwards, the stiffness contains the factors of the flow's K.

    Args:
        program: The program whose units are chosen, in its initial state.
        start: The start of the search.

    Returns:
        Whether the loads have a limit.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    flow = program.create_vector()
    # Ratio of contact springs to the stiffness of bodies at which contact carries nearly its full
    # share of the loads.
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
        forces: Floats = np.zeros(len(program.jumps))
        if program.has_dead:
            forces = _divide_dead(program, program.springs if springs is None else springs)
        power = _dissipation(program, flow)
        if power <= NO_STRAIN * abs(program.dead_work(flow)):
            power = abs(program.dead_work(flow))
        unit = power / program.work(flow) / max(program.degree, 1)
        # The initial forces are √springs. The springs are therefore set to the squares of the
        # forces at the limit load.
        if start.pushed:
            pushes = program.degree * unit * pushes
            forces = np.maximum(forces, pushes)
        _, largest = program.range(forces - np.sqrt(program.springs))
        if start.pushed or largest > 0:
            program.springs = np.maximum(program.springs, forces**2)
            _flow(program, flow, program.springs)
    finally:
        flow.destroy()
    program.multiply(unit)
    return True


def _flow(program: ConicProgram, flow: PETSc.Vec, springs: Floats | None = None) -> None:
    """Solve for the viscous flow under the loads, with springs at contact. Collective.

    Args:
        program: The bodies and their loads.
        flow: Vector that the function sets to the flow.
        springs: Contact springs; by default the springs of the program, after the function has
            adapted them to the stiffness of the bodies.
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
    """Set the unit of stress to the mean strength of the points at which the flow dissipates.

    If all strengths are similar, the function does not change the unit. It also keeps a unit near
    this mean if the largest strength is at most :data:`CONTRAST` times the mean. Collective.

    Returns:
        Whether the units have changed.
    """
    plastic = program.plastic
    radii = program.strengths[plastic] * program.stress_unit
    least, largest = program.range(radii)
    similar = 10.0  # largest ratio of strengths that are measured in one unit
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


def _divide_dead(program: ConicProgram, springs: Floats) -> Floats:
    """Subtract the part of the constant loads that unbounded stresses balance. Collective.

    The function uses the present factors of K. If no flow remains, unbounded stresses balance all
    constant loads.

    Bodies that preserve volume may touch under pressures of 100 times their strength. A search for
    such bodies that starts with smaller forces takes steps of 1e-3 and stalls. The function
    therefore also computes contact forces at which unbounded stresses balance most of the constant
    loads. For these forces, the growing loads act with the factor, at least zero, that gives the
    least flow.

    Args:
        program: The bodies and their loads.
        springs: Springs of contact that the factors contain.

    Returns:
        The forces at the jumps, not negative; zeros without contact.
    """
    dead, flow, both = program.create_vector(), program.create_vector(), program.dead.copy()
    forces: Floats = np.zeros(len(program.jumps))
    try:
        program.stiffness.solve(program.dead, dead)
        if program.num_pairs:
            program.stiffness.solve(program.load, flow)
            factor = max(-program.work(dead) / program.work(flow), 0.0)
            both.axpy(factor, program.load)
            flow.aypx(factor, dead)
            _, forces, _ = _divide(program, both, flow, springs)
        program.carried_dead, _, _ = _divide(program, program.dead, dead, None)
    finally:
        for vector in (dead, flow, both):
            vector.destroy()
    return forces


def _divide(
    program: ConicProgram, load: PETSc.Vec, flow: PETSc.Vec, springs: Floats | None
) -> tuple[Stress | None, Floats, bool]:
    """Subtract the part of loads that unbounded stresses balance, if this part is large.

    Collective.

    The method is Uzawa's iteration with the factors of the flow's K. The part that contact carries
    remains in the loads, because contact forces must not be tensile. On return, ``flow`` is the
    flow under the remaining loads.

    Args:
        program: The program with the loads.
        load: The loads; the function subtracts the balanced part from this vector.
        flow: Flow under the loads; the function updates it.
        springs: Contact springs, whose forces the function also computes; None if contact forces
            are not needed.

    Returns:
        The unbounded stress, None if no part was subtracted; the contact forces, zeros if they are
        not computed; whether a flow remains.
    """
    given, left, rest = load.copy(), program.create_vector(), load.copy()
    carried: Stress | None = None
    pressure: Floats = np.zeros(program.strains.count)
    stress: Floats = np.zeros((len(pressure), program.strains.size))
    pushes: Floats = np.zeros(len(program.jumps))
    bulk, first = program.weights / PROXIMAL, float(load.dot(flow))
    bounded = program.plastic & (program.strains.slopes > 0)
    # The function subtracts a part of the loads if unbounded stresses have at least this share of
    # the power. The share is 1e-5 for a load that dissipation resists, and 1 for a load that drives
    # no dissipation.
    mostly = 0.1
    # Share of the initial power below which no flow remains: the square of the rounding error of
    # balanced loads, divided by the proximal modulus.
    no_flow = 1e-16
    most_divisions = 20  # two to four divisions of the loads were usually needed
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
