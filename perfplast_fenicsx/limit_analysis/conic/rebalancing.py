"""The stress in equilibrium that is nearest to an iterate, wherever its iteration has ended."""

from dataclasses import replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import Borne, Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.solvers.linear.conjugate_residuals import ConjugateResiduals

MOST_ROUNDS = 4
"""So often it is balanced, and forces that pull are let go of between."""


def rebalance(iteration: InteriorIteration) -> None:
    """Bring an iterate into equilibrium by the least change of its stress. Collective.

    It takes a factorisation. Contact forces change in proportion to their size, so that small ones
    stay positive. Where equilibrium leaves a force nothing but zero, what is left of the iteration
    may still make it pull; such forces are zero then, and the rest is balanced without them. Yield
    sets may be left. Where no factorisation is to be had, or forces pull to the end, what was last
    in equilibrium is left, or nothing changed.
    """
    program, balanced = iteration.program, iteration.now
    uniform: Floats = np.ones(len(program.weights))
    largest = max(program.comm.allgather(float(balanced.forces.max(initial=0))))
    least_change = 1e-6  # share of the largest contact force that one of zero changes with
    springs = program.springs * (balanced.forces / (largest or 1.0) + least_change)
    try:
        for _ in range(MOST_ROUNDS):
            program.assemble(Moduli(uniform, uniform, np.zeros_like(balanced.borne.deviator)))
            program.stiffness.add_at_jumps(springs)
            program.stiffness.factorise()
            _balance(iteration, springs)
            balanced = iteration.now
            pulls = balanced.forces < 0
            if not program.comm.allreduce(int(pulls.sum())):
                break
            springs[pulls] = 0.0
            pushes = replace(balanced.borne, forces=np.maximum(balanced.forces, 0.0))
            iteration.now = balanced.bearing(pushes, program.blocks)
    except SingularStiffness:
        pass
    finally:
        iteration.now = balanced


def _balance(iteration: InteriorIteration, springs: Floats) -> None:
    """Correct stress and contact forces with the factors that there are. Collective.

    By conjugate residuals, with the factors as those of K. Where rows of equilibrium nearly depend
    on each other, as where edges nearly cross, the ridge of the factors
    (:data:`condensed_stiffness.RIDGE`) is more than K itself: mere refinement corrects next to
    nothing of a few such motions, and conjugate gradients leave the balance again where no stress
    has it to the last bit. The best balance is kept.
    """
    program, units = iteration.program, iteration.row_units()
    direction, product = program.create_vector(), program.create_vector()
    directions = ConjugateResiduals(program.total)
    least, best, since = np.inf, iteration.now, 0
    # Forces without balance, relative to the largest load, that need not be corrected.
    balanced = 1e-13
    most_corrections = 20  # one or two, and one for each place where edges nearly cross
    worth = 0.5  # share of the least that was left, below which a correction has helped
    patience = 4  # corrections in a row that may not help before they end
    try:
        while directions.count <= most_corrections:
            missing = iteration.unbalanced()
            since = 0 if missing < worth * least else since + 1
            if missing < least:
                least, best = missing, iteration.now
            if not missing > balanced or since == patience:
                break
            left = iteration.balance()
            program.stiffness.solve(left, direction)
            _resistance(iteration, springs, direction, product)
            step = directions.step(direction.array_r, product.array_r / units, left.array_r / units)
            if step is None:
                break
            direction.array[:] = step
            less = _resistance(iteration, springs, direction, product)
            borne = iteration.now.borne.plus(-1.0, less)
            iteration.now = iteration.now.bearing(borne, program.blocks)
    finally:
        iteration.now = best
        for vector in (direction, product):
            vector.destroy()


def _resistance(
    iteration: InteriorIteration, springs: Floats, motion: PETSc.Vec, out: PETSc.Vec
) -> Borne:
    """Stress and forces that resist a motion. Collective.

    Args:
        iteration: Of whose program it is.
        springs: Stiffness of contact.
        motion: Of bodies whose moduli are 1.
        out: Set to the forces of all of it.
    """
    program = iteration.program
    rates, weights = program.rates_of(motion), program.weights
    stress = weights * rates.trace, weights[:, None] * rates.deviator
    program.internal_forces(*stress, out)
    pushes = springs * rates.jumps
    out.array[program.jumps] += pushes
    return Borne(*stress, pushes)
