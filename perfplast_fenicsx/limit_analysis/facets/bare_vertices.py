"""Find vertices at which unconfined, cohesionless ground bears no stress.

On a free facet σn = 0. Without cohesion, the other principal stress then bounds a principal stress
of zero, so all of σ is zero. The tractions of all other facets of the cell at that vertex are then
zero too, and so is σ in its neighbours. This does not hold with water, since effective stresses
depend on its pressure. Such stresses are no unknowns of a lower bound, as their set has no
interior.
"""

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody
from perfplast_fenicsx.problem.problem import Problem

Flags = npt.NDArray[np.bool_]


def bare_vertices(problem: Problem, at: BoundBody, loose: Flags) -> Flags:
    """Return flags of these vertices in this rank's cells, shape (num_cells, d + 1). Collective.

    Args:
        problem: The bodies.
        at: Conditions on their facets.
        loose: Flags of the cells without cohesion, shape (num_cells,).
    """
    topology, on = problem.tagged_mesh.mesh.topology, at.numbers.facets
    tdim = topology.dim
    exterior = np.isin(on, exterior_facet_indices(topology))
    free = (
        exterior
        & ~at.facets.held[on].any(axis=2)
        & ~np.isin(on, at.facets.in_contact)
        & loose[:, None]
    )
    free &= at.rigid.surface[on] < 0
    pushed = (at.live.tractions != 0).any(axis=2) | (at.dead.tractions != 0).any(axis=2)
    vertices: Longs = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[: len(on)]
    others = np.array([[b for b in range(tdim + 1) if b != a] for a in range(tdim + 1)])
    bare = free[:, :, None] & ~np.take_along_axis(pushed[on], at.numbers.places, axis=2)
    wet = (at.live.pores != 0) | (at.dead.pores != 0)
    bare &= ~wet[:, others]
    flags = la.vector(topology.index_map(0), 1)
    flags.array[vertices[:, others][bare]] = 1.0
    flags.scatter_reverse(la.InsertMode.add)
    flags.scatter_forward()
    found: Flags = (flags.array[vertices] > 0) & loose[:, None]
    return found
