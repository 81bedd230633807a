"""Compute the bounds of the discrete limit load that the program prints, from an iterate.

A stress that is in equilibrium with λL and contact forces, and that lies in the yield sets
everywhere, gives a lower bound. A velocity gives an upper bound if it causes no penetration, if it
preserves the shape of elastic bodies, and if plastic bodies preserve their volume or dilate as
their yield sets require. This module corrects the iterate until it satisfies these conditions up to
rounding.
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
"""Largest inadmissible part of ε(v), such as a volume change, that counts as zero, relative to
‖ε(v)‖."""


MOST_ITERATIONS, USUAL = 400, 20
"""Largest and usual number of iterations of the projection. Each iteration solves one system with
the same factors. On a mesh that nearly locks, the projection continues beyond the usual number
while each iteration leaves less than :data:`PROGRESS` of the inadmissible part.
"""

PROGRESS = 0.999
"""Fraction of the inadmissible part that an iteration beyond the usual number may leave."""


@dataclass(frozen=True)
class StaticLoad:
    """The load factor λ of a stress that is in equilibrium and in the yield sets.

    Attributes:
        value: The bound; None if equilibrium was not reached, or if the stress leaves the yield
            sets and cannot be scaled, because of constant loads or points without cohesion.
        unbalanced: Largest unbalanced force, relative to the largest load.
    """

    value: float | None
    unbalanced: float


@dataclass(frozen=True)
class KinematicLoad:
    """The dissipation of a mechanism with L(v) = 1, minus the work of constant loads.

    Attributes:
        value: The bound; None if no admissible mechanism was reached.
        size: Size by which differences of bounds are divided; 0 without a bound.
        inadmissible: Remaining inadmissible part (:meth:`InteriorIteration.inadmissible`), relative
            to ‖ε(v)‖.
    """

    value: float | None
    size: float
    inadmissible: float


def static_load(iteration: InteriorIteration) -> StaticLoad:
    """Return the load of the iterate's stress, in equilibrium and scaled into the yield set.

    Collective.

    The function first corrects the stress with the factors of the last step. If the result is not
    balanced, the function factorises K again, with uniform moduli.
    """
    # Largest unbalanced force, relative to the largest load, that needs no correction.
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
    # for larger residuals, the function uses uniform moduli, with which K is far from singular
    left_by_factors = 1e-10
    if not unbalanced <= left_by_factors:
        rebalance(iteration)
    program, now = iteration.program, iteration.now
    ratio = program.overstress(program.whole(now.stress, now.load))
    unbalanced = iteration.unbalanced()
    if not unbalanced <= IN_BALANCE or (program.keeps and ratio > 1):
        return StaticLoad(None, unbalanced)
    return StaticLoad(now.load / max(1.0, ratio) * program.load_unit, unbalanced)


def kinematic_load(iteration: InteriorIteration) -> KinematicLoad:
    """Make the velocity of the iterate, or of an earlier one, admissible, and return its load.

    If bodies dilate, K is closer to singular at later iterates. An earlier iterate within the
    tolerance may then give a mechanism although the last iterate does not. The function replaces
    the velocity of the iteration by the admissible velocity. Collective.
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
    """Make the iterate's velocity admissible, and return its load. Collective.

    The function needs one or a few factorisations. It first holds the contact pairs with pressure,
    and then also the pairs that penetrate. If bodies dilate, it holds no pairs at first.
    """
    program, now, v = iteration.program, iteration.now, iteration.velocity
    jumps, inadmissible, entering = program.jumps, np.inf, np.inf
    largest = v.norm(PETSc.NormType.NORM_INFINITY)
    closed = (now.forces > program.springs * now.rooms) | (now.rooms < ROUNDING * largest)
    if program.dilates:  # final iterates are inside all cones and remain inside
        closed[:] = False
    most_holdings = 5  # rounds of holding pairs; the hardest known case needs two
    for _ in range(most_holdings):
        try:
            inadmissible = _project(iteration, jumps[closed])
        except SingularStiffness:
            return KinematicLoad(None, 0.0, np.inf)
        largest = v.norm(PETSc.NormType.NORM_INFINITY) or 1.0
        enters = v.array_r[jumps] / largest
        entering = program.comm.allreduce(float(enters.max(initial=0)), MPI.MAX)
        if inadmissible > EXACT or entering <= ROUNDING:
            break
        closed |= enters > 0
    work, dissipation = program.work(v), program.dissipation(v)
    if not (inadmissible <= EXACT and entering <= ROUNDING and work > ROUNDING):
        return KinematicLoad(None, 0.0, inadmissible)
    v.scale(1 / work)
    dissipated = dissipation / work * program.load_unit
    value = dissipated - program.dead_work(v) * program.load_unit
    size = measure_of(dissipated, value, program.loose)
    return KinematicLoad(value, size, inadmissible)


def _project(iteration: InteriorIteration, held: npt.NDArray[np.int32]) -> float:
    """Project the velocity onto the velocities that preserve volumes and shapes. Collective.

    The result is the nearest admissible velocity in the norm of the last viscosities. The method of
    multipliers computes this velocity. If bodies dilate, see :func:`_centred`.

    Args:
        iteration: The iteration with the velocity.
        held: Unknowns that the function sets to zero.

    Returns:
        The remaining inadmissible part, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, v = iteration.program, iteration.velocity
    if program.dilates:
        return _centred(iteration)
    strains = program.strains
    # The projection continues down to this inadmissible part while it converges quickly. Strict
    # bounds and the proof checker accept about `EXACT`.
    better = 1e-12
    v.array[held] = 0
    # Largest stiffness in the projection of regions that flow less than the mean, relative to the
    # mean.
    stiffer = 1e3
    flows = program.weights * np.linalg.norm(strains.of(v)[1], axis=1)
    viscosity = program.strengths / np.maximum(flows, 1 / stiffer)
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
    """Make the velocity admissible in a problem with dilating bodies. Collective.

    Steps towards the centre of the cones sufficiently increase the volume of dilating bodies.
    Because the stiffness is nearly singular, small volume changes above rounding remain in bodies
    that preserve their volume. The factors of the last step remove these changes. The moduli of
    this step are the scaling of the cones; each cone member therefore changes by little compared
    with its distance from the boundary.

    Returns:
        The remaining inadmissible part, relative to ‖ε(v)‖.

    Raises:
        SingularStiffness: If K cannot be factorised.
    """
    program, v = iteration.program, iteration.velocity
    keeps = ~(program.plastic & (program.strains.slopes > 0))
    both = bool(program.comm.allreduce(bool(keeps.any()), MPI.LOR))
    # Inadmissible part that may remain if points have no cohesion or if bodies preserve volume.
    # Strict bounds and the proof checker accept about `EXACT`.
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
    most_corrections, patience, worth = 50, 8, 0.5  # usually 10 to 30 corrections
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
