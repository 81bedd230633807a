"""The largest possible work of loads of any factor, as the measure of their work on a velocity."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.guided import left_free
from perfplast_fenicsx.proof.load_kinds import Loads


def usual_speed(body: Body, loads: Loads, work: float) -> float:
    """The mean velocity with which loads do their work; 0 where no tractions or forces do it.

    It depends only on loads, so that no cell is fast enough to hide what others leave.

    Args:
        body: The bodies.
        loads: Those whose factor is bounded.
        work: Theirs.
    """
    free = left_free(loads.traction, body.held, body.guided)
    pushes = np.linalg.norm(free, axis=2).mean(axis=1)
    size = body.areas @ pushes + body.volumes @ np.linalg.norm(loads.body_force, axis=1)
    return float(abs(work) / size) if size > 0 else 0.0


def most_work(
    body: Body, loads: Loads, v: Floats, at_facets: Floats, rates: Floats, usual: float
) -> float:
    """Return the largest possible work of loads with velocities as large as there.

    Args:
        body: The bodies.
        loads: Those of any factor.
        v: Velocity at the nodes of each cell, shape (num_cells, nodes_per_cell, d).
        at_facets: At those of each facet, shape (num_facets, nodes_per_facet, d).
        rates: Rates of strain at the vertices of each cell, shape (num_cells, d + 1, d, d).
        usual: Velocity that counts at least: what rests moves by rounding alone, and the factor
            that this leaves is reported.
    """
    free = left_free(loads.traction, body.held, body.guided)
    pushes = np.linalg.norm(free, axis=2).mean(axis=1)
    quick = np.maximum(np.linalg.norm(at_facets, axis=2).max(axis=1), usual)
    total = float((body.areas * pushes) @ quick)
    quick = np.maximum(np.linalg.norm(v, axis=2).max(axis=1), usual)
    total += float((body.volumes * np.linalg.norm(loads.body_force, axis=1)) @ quick)
    strains = np.linalg.norm(rates, axis=(2, 3)).max(axis=1)
    strains = np.maximum(strains, usual / np.ptp(body.vertices, axis=0).max())
    pressures = np.abs(loads.pore_pressure).max(axis=1)
    return total + float((body.volumes * pressures) @ strains) * float(np.sqrt(body.dim))
