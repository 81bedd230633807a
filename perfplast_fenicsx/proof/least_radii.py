"""Compute the strength of cells in relation to a stress, as the scale of residuals."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.rings import radii_of

TINY = float(np.finfo(np.float64).tiny)

BARE = float(np.finfo(np.float64).max)
"""Strength of cells without stress and cohesion. Rows that touch only such cells must be exact. For
elastic cells with strength ∞, residuals are relative to the weakest cell."""


def least_radii(body: Body, stress: Floats) -> Floats:
    """Return the strength of each cell: its yield radius, or without cohesion from the stress.

    Args:
        body: The bodies.
        stress: Stress as for :func:`lower.measure_stress`.
    """
    found, plastic = body.yield_radius.copy(), body.plastic
    if body.is_revolved:
        return found * radii_of(body).max(axis=1)
    own = body.cones.own_radius(body.cone[plastic], vectors(stress[plastic]))
    found[plastic] = np.where(np.isinf(own), BARE, own)
    return found


def least_of(radii: Floats) -> float:
    """Return the least radius, or the smallest number without any radius."""
    least = float(radii.min())
    return least if 0 < least < BARE else TINY


def finite(radii: Floats, weakest: float) -> Floats:
    """Return the finite radii, and the weakest one in place of the others."""
    return np.where(np.isinf(radii), weakest, np.where(radii == BARE, TINY, radii))
