"""The stress in equilibrium that is nearest to an iterate, wherever its iteration has ended."""

from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic_program import SingularStiffness
from perfplast_fenicsx.limit_analysis.interior_iteration import InteriorIteration

BALANCED = 1e-13
"""Forces without balance, relative to the largest load, that need not be corrected."""

MOST_CORRECTIONS = 5

LEAST = 1e-6
"""Share of the largest contact force that one of zero changes with."""


def rebalance(iteration: InteriorIteration) -> None:
    """Bring an iterate into equilibrium by the least change of its stress. Collective.

    It takes a factorisation. Contact forces change in proportion to their size, so that small ones
    stay positive. Yield sets may be left. Where no factorisation is to be had, nothing is
    changed.
    """
    program, now = iteration.program, iteration.now
    uniform: Floats = np.ones(len(program.weights))
    largest = max(program.comm.allgather(float(now.forces.max(initial=0))))
    springs = program.springs * (now.forces / (largest or 1.0) + LEAST)
    try:
        program.assemble(uniform, uniform, np.zeros_like(now.deviator))
        program.stiffness.add_at_jumps(springs)
        program.stiffness.factorise()
    except SingularStiffness:
        return
    correction = program.create_vector()
    for _ in range(MOST_CORRECTIONS):
        if iteration.unbalanced() <= BALANCED:
            break
        program.stiffness.solve(iteration.balance(), correction)
        trace, deviator = program.strains.of(correction)
        now = iteration.now
        stress = now.deviator - program.weights[:, None] * deviator
        S = now.S.copy()
        S[:, 1:] = stress[program.plastic]
        iteration.now = replace(
            now,
            pressure=now.pressure - program.weights * trace,
            deviator=stress,
            S=S,
            forces=now.forces - springs * correction.array_r[program.jumps],
        )
    correction.destroy()
