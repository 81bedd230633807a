"""The stress in equilibrium that is nearest to an iterate, wherever its iteration has ended."""

from dataclasses import replace

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.discretisation import Moduli, SingularStiffness
from perfplast_fenicsx.limit_analysis.interior_iteration import InteriorIteration

BALANCED = 1e-13
"""Forces without balance, relative to the largest load, that need not be corrected."""

MOST_CORRECTIONS = 20
"""One or two, and a step of conjugate gradients for each place where edges nearly cross."""

REFINED = 0.1
"""Share of what was left before a mere refinement, above which it does not help enough."""

MOST_ROUNDS = 4
"""So often it is balanced, and forces that pull are let go of between."""

LEAST = 1e-6
"""Share of the largest contact force that one of zero changes with."""


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
    springs = program.springs * (balanced.forces / (largest or 1.0) + LEAST)
    correction = program.create_vector()
    try:
        for _ in range(MOST_ROUNDS):
            program.assemble(Moduli(uniform, uniform, np.zeros_like(balanced.deviator)))
            program.stiffness.add_at_jumps(springs)
            program.stiffness.factorise()
            _balance(iteration, springs, correction)
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
        correction.destroy()


def _balance(iteration: InteriorIteration, springs: Floats, correction: PETSc.Vec) -> None:
    """Correct stress and contact forces with the factors that there are. Collective.

    By refinement as long as that helps, then by conjugate gradients with the factors as those of
    K: where rows of equilibrium nearly depend
    on each other, as where edges nearly cross, the ridge of the factors
    (:data:`condensed_stiffness.RIDGE`) is more than K itself, and of a few such motions mere
    refinement would correct next to nothing. The best balance is kept: where no stress has it, what
    is left grows.
    """
    program = iteration.program
    direction, product = program.create_vector(), program.create_vector()
    before, least, best, refining = 0.0, np.inf, iteration.now, True
    try:
        for _ in range(MOST_CORRECTIONS + 1):
            missing = iteration.unbalanced()
            refining = refining and missing < REFINED * least
            if missing < least:
                least, best = missing, iteration.now
            if not missing > BALANCED:
                break
            left = iteration.balance()
            program.stiffness.solve(left, correction)
            power = float(left.dot(correction))
            direction.aypx(power / before if before > 0 else 0.0, correction)
            before = 0.0 if refining else power
            trace, deviator = program.strains.of(direction)
            pressure, stress = program.weights * trace, program.weights[:, None] * deviator
            program.internal_forces(pressure, stress, product)
            forces = springs * direction.array_r[program.jumps]
            product.array[program.jumps] += forces
            resisted = float(direction.dot(product))
            if not (refining or (power > 0 and resisted > 0)):
                break
            length, now = 1.0 if refining else power / resisted, iteration.now
            changed = now.pressure - length * pressure, now.deviator - length * stress
            iteration.now = replace(
                now,
                pressure=changed[0],
                deviator=changed[1],
                S=program.members(changed),
                forces=now.forces - length * forces,
            )
    finally:
        iteration.now = best
        for vector in (direction, product):
            vector.destroy()
