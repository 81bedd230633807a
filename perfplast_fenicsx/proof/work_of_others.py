"""Compute the largest possible work of the free loads, as the scale of their work on a velocity."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.guided import left_free
from perfplast_fenicsx.proof.load_kinds import Loads


def usual_speed(body: Body, loads: Loads, work: float) -> float:
    """Return the mean velocity at which loads do their work; 0 without tractions and forces.

    It depends only on loads, so that no fast cell can hide the work of the free loads.

    Args:
        body: The bodies.
        loads: Loads whose factor is bounded.
        work: Their work.
    """
    free = left_free(loads.traction, body.held, body.guided)
    pushes = np.linalg.norm(free, axis=2).mean(axis=1)
    size = body.areas @ pushes + body.volumes @ np.linalg.norm(loads.body_force, axis=1)
    return float(abs(work) / size) if size > 0 else 0.0


def most_work(
    body: Body, loads: Loads, v: Floats, at_facets: Floats, rates: Floats, usual: float
) -> float:
    """Return the largest possible work of loads at velocities of this size.

    Args:
        body: The bodies.
        loads: The free loads.
        v: Velocity at the nodes of each cell, shape (num_cells, nodes_per_cell, d).
        at_facets: Velocity at the nodes of each facet, shape (num_facets, nodes_per_facet, d).
        rates: Rates of strain at the vertices of each cell, shape (num_cells, d + 1, d, d).
        usual: Least velocity that counts: bodies at rest move by rounding, and the resulting factor
            is reported.
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
