"""Bounds of the discrete limit load from any iterate: printed values are computed from it.

A stress that is in equilibrium with λL and contact forces, and nowhere above yield, gives a lower
bound; a velocity that keeps the volume of plastic bodies and the shape of elastic ones, and enters
nothing, gives an upper one. Both are made exact here but for rounding.
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
from perfplast_fenicsx.limit_analysis.statements.bound import measure_of
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.conjugate_residuals import ConjugateResiduals

IN_BALANCE = 1e-8
"""Largest force without balance, relative to the largest load, that counts as none."""


EXACT = 1e-10
"""Volume change (and strain of elastic bodies) that counts as none, relative to ‖ε(v)‖."""


MOST_ITERATIONS, USUAL = 400, 20
"""Iterations of the projection: the most, and the usual number. Each takes a solve with the same
factors. A mesh that nearly locks takes more, as long as each leaves less than :data:`PROGRESS` of
what there was."""

PROGRESS = 0.999
"""Share of what is inadmissible that an iteration of the projection may leave, beyond the usual."""


@dataclass(frozen=True)
class StaticLoad:
    """λ of a stress in equilibrium, scaled into the yield set where nothing but λL loads.

    Attributes:
        value: The bound; None where equilibrium was not reached, or yield beside dead loads.
        unbalanced: Largest force that nothing balances, relative to the largest of the loads.
    """

    value: float | None
    unbalanced: float


@dataclass(frozen=True)
class KinematicLoad:
    """Dissipation of a mechanism with L(v) = 1, less the work of dead loads.

    Attributes:
        value: The bound; None where no admissible mechanism was reached.
        size: What its difference to others is measured by; 0 without a bound.
        inadmissible: Volume change and strain of elastic bodies that are left, relative to ‖ε(v)‖.
        entering: Largest entering, relative to the largest velocity.
    """

    value: float | None
    size: float
    inadmissible: float
    entering: float


def static_load(iteration: InteriorIteration) -> StaticLoad:
    """Bring the iterate's stress into balance and scale it into the yield set. Collective.

    Where the last step's factors do not balance it, those of uniform moduli do, with one more
    factorisation.
    """
    # Force without balance, relative to the largest load, that need not be corrected.
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
    left_by_factors = 1e-10  # more than that is balanced with others, whose K is far from singular
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
    """Make the iterate's velocity admissible, which takes a factorisation or a few. Collective.

    Pairs that push are held, and then those that enter; the iteration's velocity becomes the
    admissible one.
    """
    program, now, v = iteration.program, iteration.now, iteration.velocity
    jumps, inadmissible, entering = program.jumps, np.inf, np.inf
    largest = v.norm(PETSc.NormType.NORM_INFINITY)
    closed = (now.forces > program.springs * now.rooms) | (now.rooms < ROUNDING * largest)
    if program.dilates:  # in the end iterates are inside of all cones, and are left there
        closed[:] = False
    most_holdings = 5  # so often pairs are held; twice in the hardest case that was seen
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
    if program.dilates and entering <= ROUNDING:  # no pair was held, and what enters is rounding
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
    """Bring the velocity to the nearest one that keeps volumes and elastic bodies. Collective.

    It is nearest in the norm of the last viscosities, and found by the method of multipliers. Where
    bodies dilate see :func:`_centred`.

    Args:
        iteration: Whose velocity it is.
        held: Unknowns that become zero.

    Returns:
        What is left, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, now, v = iteration.program, iteration.now, iteration.velocity
    if program.dilates:
        return _centred(iteration)
    strains = program.strains
    # What is inadmissible that is gone on to as long as it is quick: what strict bounds and those
    # who check them let pass is about `EXACT`.
    better = 1e-12
    v.array[held] = 0
    # Regions that flow less than the mean are at most so many times stiffer in the projection.
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
    quick = 0.8  # share of what is inadmissible that an iteration leaves where it is quick
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
    """Make the velocity admissible where bodies dilate, and others may keep volumes. Collective.

    Steps towards the middle of the cones let bodies that dilate grow enough. They leave volume
    changes of the others that are small but no rounding, since the stiffness is next to singular.
    These are taken away with the factors of the last step: its moduli are the scaling of the cones,
    so that each cone changes by little beside what it has to spare.

    Returns:
        What is left, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, v = iteration.program, iteration.velocity
    keeps = ~(program.plastic & (program.strains.slopes > 0))
    both = bool(program.comm.allreduce(bool(keeps.any()), MPI.LOR))
    # What may be left without cohesion, and where volumes are kept too: what strict bounds and
    # those who check them let pass is about `EXACT`.
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
    stiff = weights / PROXIMAL**2  # as the last step has them

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
