"""The stress in equilibrium that is nearest to an iterate, wherever its iteration has ended."""

from dataclasses import replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.discretisation import Moduli, SingularStiffness
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
            program.assemble(Moduli(uniform, uniform, np.zeros_like(balanced.deviator)))
            program.stiffness.add_at_jumps(springs)
            program.stiffness.factorise()
            _balance(iteration, springs)
            balanced = iteration.now
            pulls = balanced.forces < 0
            if not program.comm.allreduce(int(pulls.sum())):
                break
            springs[pulls] = 0.0
            iteration.now = replace(balanced, forces=np.maximum(balanced.forces, 0.0))
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
            pressure, stress, pushes = _resistance(iteration, springs, direction, product)
            now = iteration.now
            changed = now.pressure - pressure, now.deviator - stress
            iteration.now = replace(
                now,
                pressure=changed[0],
                deviator=changed[1],
                S=program.members(changed),
                X=program.blocks.members(now.t, *changed),
                forces=now.forces - pushes,
            )
    finally:
        iteration.now = best
        for vector in (direction, product):
            vector.destroy()


def _resistance(
    iteration: InteriorIteration, springs: Floats, motion: PETSc.Vec, out: PETSc.Vec
) -> tuple[Floats, Floats, Floats]:
    """Pressure, deviator and contact forces that resist a motion. Collective.

    Args:
        iteration: Iteration of whose program they are.
        springs: Stiffness of contact.
        motion: Motion of bodies whose moduli are 1.
        out: Set to the forces of all of them.
    """
    program = iteration.program
    trace, deviator = program.strains.of(motion)
    pressure, stress = program.weights * trace, program.weights[:, None] * deviator
    program.internal_forces(pressure, stress, out)
    pushes = springs * motion.array_r[program.jumps]
    out.array[program.jumps] += pushes
    return pressure, stress, pushes
