"""Compute the strength of cells under a given stress, as the scale of residuals."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.rings import radii_of

TINY = float(np.finfo(np.float64).tiny)

BARE = float(np.finfo(np.float64).max)
"""Strength of cells without cohesion at zero stress. Rows that touch only such cells must be exact.
For elastic cells with strength ∞, residuals are relative to the weakest cell."""


def least_radii(body: Body, stress: Floats) -> Floats:
    """Return the strength of each cell: its yield radius, which depends on the stress if c = 0.

    Args:
        body: The bodies.
        stress: Stress, in the form of :func:`lower.measure_stress`.
    """
    found, plastic = body.yield_radius.copy(), body.plastic
    if body.is_revolved:
        return found * radii_of(body).max(axis=1)
    own = body.cones.own_radius(body.cone[plastic], vectors(stress[plastic]))
    found[plastic] = np.where(np.isinf(own), BARE, own)
    return found


def least_of(radii: Floats) -> float:
    """Return the least radius if it is positive and less than ``BARE``, and ``TINY`` otherwise."""
    least = float(radii.min())
    return least if 0 < least < BARE else TINY


def finite(radii: Floats, weakest: float) -> Floats:
    """Return the radii, with ``weakest`` in place of ∞ and ``TINY`` in place of ``BARE``."""
    return np.where(np.isinf(radii), weakest, np.where(radii == BARE, TINY, radii))
