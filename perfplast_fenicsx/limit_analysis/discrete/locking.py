"""Identify bodies that lock: those that prevent a velocity of the mesh from keeping volumes.

A quadratic velocity on arbitrary tetrahedra has few ways to keep the volume at all points. The
volume changes of the nearest velocity show the bodies whose mesh is too coarse for a mechanism.
"""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.problem.problem import Problem

MOST = 0.9
"""Share of the inadmissible part that the named bodies have together."""


def locking_bodies(problem: Problem, iteration: InteriorIteration) -> tuple[str, ...]:
    """Return the bodies with most of the inadmissible part of a velocity. Collective.

    Args:
        problem: The bodies.
        iteration: The iteration with the velocity after the projection.

    Returns:
        Names of volumes, those with the largest part first; empty if the velocity is admissible.
    """
    program, tagged_mesh = iteration.program, problem.tagged_mesh
    trace, deviator = program.strains.of(iteration.velocity)
    wrong = trace**2 / program.strains.gdim
    wrong += np.where(program.plastic, 0.0, np.einsum("ni,ni->n", deviator, deviator))
    wrong *= program.weights  # points of friction follow those of cells
    owned = tagged_mesh.mesh.topology.index_map(problem.bodies.gdim).size_local
    cells = wrong[problem.Q.dofmap.list[:owned]].sum(axis=1)
    names = sorted(tagged_mesh.volumes)
    mine = [cells[here[here < owned]].sum() for here in map(tagged_mesh.cells, names)]
    shares = problem.comm.allreduce(np.asarray(mine, dtype=np.float64))
    return _largest(names, [float(share) for share in shares])


def _largest(names: Sequence[str], shares: Sequence[float]) -> tuple[str, ...]:
    """Return the fewest names that have the share :data:`MOST` together, the largest first."""
    total = sum(shares)
    if not 0 < total < np.inf:
        return ()
    chosen, so_far = list[str](), 0.0
    for share, name in sorted(zip(shares, names, strict=True), key=lambda one: -one[0]):
        chosen.append(name)
        so_far += share
        if so_far >= MOST * total:
            break
    return tuple(chosen)
