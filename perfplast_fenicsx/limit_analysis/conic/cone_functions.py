"""Gauge and support function of cones in their coordinates, ‖s + γt‖ ≤ γ − αp; NumPy only.

See :mod:`standard_cones`. With ρ² = 1 − ‖t‖², the set of t ≠ 0 (which has α = 0) is that of
√(‖s‖² + (t·s)²/ρ²) + t·s/ρ ≤ γρ.
"""

from typing import Protocol

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import PrincipalCones


class ConesAtPoints(Protocol):
    """The cone of each point.

    Attributes:
        radii: γ (stress), ∞ where nothing yields, shape (count,).
        slopes: α, shape (count,).
        tilts: t, shape (count, m); None where all are zero.
        principal: The points whose principal stresses are bounded instead.
    """

    radii: Floats
    slopes: Floats
    tilts: Floats | None
    principal: PrincipalCones


def yield_ratios(cones: ConesAtPoints, pressure: Floats, deviator: Floats) -> Floats:
    """By how much a stress exceeds yield, shape (count,): it is on the surface where 1 is found.

    Negative where no multiple of the stress yields. Without cohesion, γ = 0, a multiple yields
    where the stress does, and ‖s‖/(−αp) is found: how much steeper than the cone it is.

    Args:
        cones: The cones.
        pressure: p, shape (count,).
        deviator: s, shape (count, m).
    """
    sizes = np.linalg.norm(deviator, axis=1) + cones.slopes * pressure
    loose = cones.radii == 0
    ratios: Floats = sizes / np.where(loose, 1.0, cones.radii)
    if loose.any():
        ratios[loose] = _steepness(cones.slopes[loose] * pressure[loose], deviator[loose])
    if cones.tilts is not None:
        tilts = cones.tilts
        square = 1 - np.einsum("ni,ni->n", tilts, tilts)
        along = np.einsum("ni,ni->n", tilts, deviator)
        length2 = np.einsum("ni,ni->n", deviator, deviator)
        tilted = (np.sqrt(length2 + along**2 / square) + along / np.sqrt(square)) / np.sqrt(square)
        there = tilts.any(axis=1)
        ratios[there] = (tilted / cones.radii)[there]
    return cones.principal.put(ratios, cones.principal.ratios(pressure, deviator))


def _steepness(heads: Floats, deviator: Floats) -> Floats:
    """‖s‖/(−αp), 0 without any stress and ∞ where p does not press."""
    sizes, rest = np.linalg.norm(deviator, axis=1), (heads <= 0) & ~deviator.any(axis=1)
    found: Floats = np.divide(sizes, -heads, out=np.full_like(sizes, np.inf), where=heads < 0)
    found[rest] = 0.0
    return found


def own_strengths(cones: ConesAtPoints, pressure: Floats) -> Floats:
    """Return the strengths that measure residuals: γ, or −αp of a stress without cohesion.

    No more than a tensile strength.

    Args:
        cones: The cones.
        pressure: p (stress), shape (count,).

    Returns:
        Shape (count,), ∞ where nothing yields or, without cohesion, there is no pressure.
    """
    heads = -cones.slopes * pressure
    own = np.where(heads > 0, heads, np.inf)
    found: Floats = np.where(cones.radii > 0, cones.radii, own)
    principal = cones.principal
    return principal.put(found, np.minimum(found[principal.at], principal.tensions))


def powers(cones: ConesAtPoints, trace: Floats, deviator: Floats) -> Floats:
    """Return the dissipation of admissible rates per volume, shape (count,).

    Args:
        cones: The cones.
        trace: ε'₀, shape (count,).
        deviator: ε'₁, shape (count, m).
    """
    rates = np.linalg.norm(deviator, axis=1)
    np.divide(trace, cones.slopes, out=rates, where=cones.slopes > 0)
    if cones.tilts is not None:
        rates -= np.einsum("ni,ni->n", cones.tilts, deviator)
    found: Floats = np.where(np.isfinite(cones.radii), cones.radii, 0.0) * rates
    return cones.principal.put(found, cones.principal.powers(trace, deviator))
