"""Compute bounds of the discrete limit load from any iterate: the numbers that are printed.

A stress in equilibrium with λL and contact forces, and nowhere above yield, gives a lower bound. A
velocity that preserves the volume of plastic bodies and the shape of elastic ones, without
penetration, gives an upper bound. This module fulfils these conditions up to rounding.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import PROXIMAL, Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, rebalance
from perfplast_fenicsx.limit_analysis.statements.load_factor import measure_of
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.conjugate_residuals import ConjugateResiduals

IN_BALANCE = 1e-8
"""Largest unbalanced force, relative to the largest load, that counts as zero."""


EXACT = 1e-10
"""Volume change (and strain of elastic bodies), relative to ‖ε(v)‖, that counts as zero."""


MOST_ITERATIONS, USUAL = 400, 20
"""Largest and usual number of iterations of the projection. Each iteration takes a solve with the
same factors. A mesh that nearly locks takes more than usual, as long as each iteration leaves less
than :data:`PROGRESS` of the inadmissible part.
"""

PROGRESS = 0.999
"""Share of the inadmissible part that an iteration beyond the usual number may leave."""


@dataclass(frozen=True)
class StaticLoad:
    """Factor λ of a stress in equilibrium; scaled into the yield set if λL are the only loads.

    Attributes:
        value: The bound; None if equilibrium was not reached, or if the stress exceeds yield with
            permanent loads.
        unbalanced: Largest unbalanced force, relative to the largest of the loads.
    """

    value: float | None
    unbalanced: float


@dataclass(frozen=True)
class KinematicLoad:
    """Dissipation of a mechanism with L(v) = 1, less the work of permanent loads.

    Attributes:
        value: The bound; None if no admissible mechanism was reached.
        size: Size that differences of bounds are relative to; 0 without a bound.
        inadmissible: Remaining volume change and strain of elastic bodies, relative to ‖ε(v)‖.
        entering: Largest penetration rate, relative to the largest velocity.
    """

    value: float | None
    size: float
    inadmissible: float
    entering: float


def static_load(iteration: InteriorIteration) -> StaticLoad:
    """Bring the iterate's stress into balance and scale it into the yield set. Collective.

    If the last step's factors do not balance it, factors of uniform moduli do, which takes one more
    factorisation.
    """
    # Unbalanced force, relative to the largest load, that needs no correction.
    balanced = 1e-12
    most_corrections = 3
    unbalanced = iteration.unbalanced()
    for _ in range(most_corrections):
        if unbalanced <= balanced:
            break
        before = unbalanced
        iteration.equilibrate()
        unbalanced = iteration.unbalanced()
        if not unbalanced < before:
            break
    # more than that is balanced with other factors, whose K is far from singular
    left_by_factors = 1e-10
    if not unbalanced <= left_by_factors:
        rebalance(iteration)
    program, now = iteration.program, iteration.now
    ratio = program.overstress(program.whole(now.stress, now.load))
    unbalanced = iteration.unbalanced()
    if not unbalanced <= IN_BALANCE:
        return StaticLoad(None, unbalanced)
    if program.keeps and ratio > 1:
        return StaticLoad(None, unbalanced)
    return StaticLoad(now.load / max(1.0, ratio) * program.load_unit, unbalanced)


def kinematic_load(iteration: InteriorIteration) -> KinematicLoad:
    """Make the iterate's velocity admissible, or that of an earlier iterate. Collective.

    Where bodies dilate, K of later iterates is closer to a singular one. So an earlier iterate that
    was close enough may have a mechanism where the last one has none. The iteration's velocity
    becomes the admissible one.
    """
    found = _admissible_load(iteration)
    earlier = iteration.earlier if iteration.program.dilates else None
    if found.value is not None or earlier is None:
        return found
    last = iteration.kept()
    iteration.put(*earlier)
    other = _admissible_load(iteration)
    if other.value is not None:
        return other
    iteration.put(*last)
    return found


def _admissible_load(iteration: InteriorIteration) -> KinematicLoad:
    """Make the iterate's velocity admissible, with one or a few factorisations. Collective.

    Pairs that push are held first, then pairs that penetrate.
    """
    program, now, v = iteration.program, iteration.now, iteration.velocity
    jumps, inadmissible, entering = program.jumps, np.inf, np.inf
    largest = v.norm(PETSc.NormType.NORM_INFINITY)
    closed = (now.forces > program.springs * now.rooms) | (now.rooms < ROUNDING * largest)
    if program.dilates:  # final iterates are inside all cones, and remain there
        closed[:] = False
    most_holdings = 5  # rounds in which pairs are held; the hardest known case took two
    for _ in range(most_holdings):
        try:
            inadmissible = _project(iteration, jumps[closed])
        except SingularStiffness:
            return KinematicLoad(None, 0.0, np.inf, np.inf)
        largest = v.norm(PETSc.NormType.NORM_INFINITY) or 1.0
        enters = v.array_r[jumps] / largest
        entering = program.comm.allreduce(float(enters.max(initial=0)), MPI.MAX)
        if inadmissible > EXACT or entering <= ROUNDING:
            break
        closed |= enters > 0
    if program.dilates and entering <= ROUNDING:  # no pair was held, and penetration is rounding
        v.array[jumps] = np.minimum(v.array_r[jumps], 0.0)
        inadmissible, entering = iteration.inadmissible(), 0.0
    work, dissipation = program.work(v), program.dissipation(v)
    if not (inadmissible <= EXACT and entering <= ROUNDING and work > ROUNDING):
        return KinematicLoad(None, 0.0, inadmissible, entering)
    v.scale(1 / work)
    dissipated = dissipation / work * program.load_unit
    value = dissipated - program.dead_work(v) * program.load_unit
    size = measure_of(dissipated, value, program.loose)
    return KinematicLoad(value, size, inadmissible, entering)


def _project(iteration: InteriorIteration, held: npt.NDArray[np.int32]) -> float:
    """Replace the velocity by the nearest one that preserves volumes and shapes. Collective.

    It is nearest in the norm of the last viscosities; the method of multipliers computes it. If
    bodies dilate, see :func:`_centred`.

    Args:
        iteration: The iteration with the velocity.
        held: Unknowns that become zero.

    Returns:
        The remaining inadmissible part, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, now, v = iteration.program, iteration.now, iteration.velocity
    if program.dilates:
        return _centred(iteration)
    strains = program.strains
    # Iterations continue down to this inadmissible part as long as they converge quickly. Strict
    # bounds and their checkers accept about `EXACT`.
    better = 1e-12
    v.array[held] = 0
    # In the projection, regions that flow less than the mean are at most this many times stiffer.
    stiffer = 1e3
    rates, viscosity = program.rates_of(v), np.ones(strains.count)
    for block, members in zip(program.blocks, now.members, strict=True):
        block.viscosities(members, rates, stiffer, viscosity)
    stiffest = 1e9  # weight of volume changes in the projection
    none = np.zeros((len(viscosity), strains.size))
    stiff = np.where(program.plastic, viscosity, stiffest)
    program.assemble(Moduli(np.full_like(stiff, stiffest), stiff, none), held)
    program.stiffness.factorise()

    before = v.copy()
    forces, correction = program.create_vector(), program.create_vector()
    pressure, stress = np.zeros_like(viscosity), none
    inadmissible = np.inf
    quick = 0.8  # an iteration is quick if it leaves less than this share of the inadmissible part
    for number in range(MOST_ITERATIONS):
        trace, deviator = strains.of(v)
        elastic = np.where(program.plastic[:, None], 0.0, deviator)
        last, inadmissible = inadmissible, iteration.inadmissible()
        enough = inadmissible <= (EXACT if number >= USUAL else better)
        slow = number >= USUAL and not inadmissible < PROGRESS * last
        if enough or slow or (inadmissible <= EXACT and not inadmissible < quick * last):
            break
        pressure = pressure - stiffest * program.weights * trace
        stress = stress - stiffest * program.weights[:, None] * elastic
        program.internal_forces(pressure, stress, forces)
        forces.array[held] = 0
        program.stiffness.solve(forces, correction)
        v.waxpy(1.0, correction, before)
    for vector in (before, forces, correction):
        vector.destroy()
    return inadmissible


def _centred(iteration: InteriorIteration) -> float:
    """Make the velocity admissible where bodies dilate; others may preserve volume. Collective.

    Steps towards the centre of the cones increase the volume of dilating bodies enough. They leave
    volume changes of the other bodies that are small but above rounding, since the stiffness is
    nearly singular. The factors of the last step remove these changes. Its moduli are the scaling
    of the cones, so that the change of each cone is small compared with its margin.

    Returns:
        The remaining inadmissible part, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, v = iteration.program, iteration.velocity
    keeps = ~(program.plastic & (program.strains.slopes > 0))
    both = bool(program.comm.allreduce(bool(keeps.any()), MPI.LOR))
    # Inadmissible part that may remain without cohesion, and where volumes are kept too. Strict
    # bounds and their checkers accept about `EXACT`.
    better = 1e-12
    most_centrings = 3
    left = iteration.inadmissible()
    for _ in range(most_centrings):
        if left <= (better if program.loose or both else EXACT):
            return left
        iteration.step(onwards=False)
        left = iteration.inadmissible()
    if not both:
        return left

    weights, roots = program.weights, np.sqrt(program.weights)[:, None]
    stiff = weights / PROXIMAL**2  # as in the last step

    def changes(velocity: PETSc.Vec) -> Floats:
        trace, deviator = program.strains.of(velocity)
        kept = np.where(keeps, trace, 0.0), np.where(program.plastic[:, None], 0.0, deviator)
        return roots * np.column_stack(kept)

    forces, correction, best = v.duplicate(), v.duplicate(), v.copy()
    directions = ConjugateResiduals(program.total)
    least, since = np.inf, 0
    most_corrections, patience, worth = 50, 8, 0.5  # 10 to 30 corrections were seen
    try:
        while directions.count <= most_corrections:
            wrong = changes(v)
            size = np.sqrt(program.total(float((wrong**2).sum())))
            since = 0 if size < worth * least else since + 1
            if size < least:
                least = size
                v.copy(best)
            if size == 0 or since == patience:
                break
            pushes = -(stiff[:, None] / roots) * wrong
            program.internal_forces(pushes[:, 0].copy(), pushes[:, 1:].copy(), forces)
            program.stiffness.solve(forces, correction)
            effect = -changes(correction).ravel()
            step = directions.step(correction.array_r, effect, wrong.ravel())
            if step is None:
                break
            v.array[:] += step
    finally:
        best.copy(v)
        for vector in (forces, correction, best):
            vector.destroy()
    return iteration.inadmissible()
