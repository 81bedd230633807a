"""Bound in-plane stresses by a parabola R² ≤ k (f − σ₁), the criterion of Hoek and Brown.

R = (σ₁ − σ₃)/2 is the radius of Mohr's circle. The gauge of this set of stresses is the positive
root g of kfg² − kσ₁g − R² = 0. For v = tr ε > 0 and γ = ε₁ − ε₃, the supremum of σ:ε is fv +
(k/4)(γ − v)₊²/v. The supremum tends to infinity as v tends to 0, so the checker requires v ≥ δγ.
Rates with v ≥ δγ form a convex cone, on which the supremum is Lipschitz continuous.
"""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.plain_arrays import ProofError, check_sizes

Floats = npt.NDArray[np.float64]

GENTLEST = 0.01
"""Least ratio δ of v to γ: the sine of the friction angle under a pressure of about 2500 k."""


def check_parabolas(curvature: Floats, tension: Floats, m: int) -> None:
    """Refuse parabolas that do not contain zero stress, or that are not for plane strain.

    Args:
        curvature: Factor k, shape (n,).
        tension: Tensile strength f, of the same shape.
        m: Number of components of a stress.

    Raises:
        ProofError: If a parabola is refused.
    """
    if len(curvature) and m != 3:
        raise ProofError("cone_curvature is given for bodies that are not in plane strain.")
    if not (np.isfinite(curvature) & (curvature > 0) & (tension > 0)).all():
        raise ProofError("cone_curvature or its bound is not positive and finite.")
    check_sizes("cone_curvature", curvature)
    if not ((curvature <= 1e12 * tension) & (tension <= 1e12 * curvature)).all():
        raise ProofError("cone_curvature differs too much from the tensile strength.")


def gauges(curvature: Floats, tension: Floats, stress: Floats) -> Floats:
    """Return the gauge of stresses (at most 1 in the set), shape (...) from vectors (..., 3)."""
    mean, radius = _circle(stress)
    along = curvature * (mean + radius)
    root = np.sqrt(along**2 + 4 * curvature * tension * radius**2)
    pressed = 2 * radius**2 / np.where(along < 0, root - along, 1.0)
    return np.where(along < 0, pressed, (along + root) / (2 * curvature * tension))


def most_gauge(curvature: Floats, tension: Floats) -> Floats:
    """Return upper bounds on the gauge of a stress of size 1, for which σ₁ ≤ 1 and R ≤ 1/√2."""
    root = np.sqrt(curvature**2 + 2 * curvature * tension)
    return np.asarray((curvature + root) / (2 * curvature * tension))


def powers(curvature: Floats, tension: Floats, rates: Floats) -> Floats:
    """Return the dissipation of rates per volume, where v counts as at least δγ."""
    growth, shear = sizes(rates)
    growth = np.maximum(growth, GENTLEST * shear)
    over = np.maximum(shear - growth, 0.0)
    bent = np.divide(over**2, growth, out=np.zeros_like(over), where=over > 0)
    return np.asarray(tension * growth + curvature / 4 * bent)


def steepest(curvature: Floats, tension: Floats) -> Floats:
    """Return upper bounds on the Lipschitz constant of :func:`powers`.

    The derivatives with respect to v and γ are at most f + k/4δ² and k/2δ + fδ in size, and |dv|
    and |dγ| are at most √2 |dε|.
    """
    by_growth = tension + curvature / (4 * GENTLEST**2)
    by_shear = curvature / (2 * GENTLEST) + tension * GENTLEST
    return np.asarray(np.sqrt(2.0) * (by_growth + by_shear))


def sizes(rates: Floats) -> tuple[Floats, Floats]:
    """Return v = tr ε and γ = ε₁ − ε₃, shapes (...) from vectors (..., 3)."""
    half, radius = _circle(rates)
    return 2 * half, 2 * radius


def _circle(vector: Floats) -> tuple[Floats, Floats]:
    """Return the mean of the principal values, and half of their difference."""
    half = (vector[..., 0] - vector[..., 1]) / 2
    radius = np.hypot(half, np.sqrt(0.5) * vector[..., 2])
    return (vector[..., 0] + vector[..., 1]) / 2, radius
