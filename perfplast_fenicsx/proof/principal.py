"""Bound principal stresses: (1 + s)σ₁ − (1 − s)σ₃ ≤ c, with or without a tensile strength σ₁ ≤ f.

In plane strain, the out-of-plane stress is free; some out-of-plane stress between the in-plane
principal stresses is always admissible. The out-of-plane strain rate is zero. If s > 0, without a
tensile strength, the supremum of σ:ε is attained at the apex, where all three stresses are c/2s.
With a tensile strength f, it is attained at vertices with σ₁ = f, at which σ₂ and σ₃ are each
either f or r = ((1 + s)f − c)/(1 − s).
"""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.plain_arrays import ProofError

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def check_principal(
    bound: Floats, sine: Floats, tension: Floats, sines: tuple[float, float]
) -> None:
    """Refuse bounds that do not contain zero stress, or whose dissipation is not supported.

    Args:
        bound: c, shape (n,).
        sine: s, same shape.
        tension: f, same shape, NaN without a tensile strength.
        sines: Least nonzero s and largest s that the checker supports.

    Raises:
        ProofError: If a bound is refused.
    """
    least, largest = sines
    if not ((sine == 0) | ((sine > least) & (sine < largest))).all():
        raise ProofError("cone_sine is nearly zero, negative or too close to 1.")
    if not (bound > 0).all():
        raise ProofError("a bound of principal stresses is not positive.")
    cut = ~np.isnan(tension)
    f, room = tension[cut], bound[cut] - 2 * sine[cut] * tension[cut]
    if not ((f > 0) & np.isfinite(f) & (room > 0)).all():
        raise ProofError("cone_tension is not positive, or not below the apex.")


def eigenvalues(vector: Floats) -> Floats:
    """Return the principal stresses in ascending order, shape (..., 3) from vectors (..., m)."""
    if vector.shape[-1] == 3:  # plane strain
        mean = vector[..., :2].mean(axis=-1)
        vector = np.insert(vector, 2, mean, axis=-1)
    return _values(vector)


def rate_sizes(rates: Floats) -> tuple[Floats, Floats]:
    """Return tr ε and Σ|ε_i|, shapes (...) from vectors (..., m)."""
    if rates.shape[-1] == 3:
        rates = np.insert(rates, 2, 0.0, axis=-1)
    return rates[..., :3].sum(axis=-1), np.abs(_values(rates)).sum(axis=-1)


def power_factors(bound: Floats, sine: Floats, tension: Floats) -> tuple[Floats, Floats]:
    """Return the coefficients of tr ε and Σ|ε_i| in the dissipation per volume, shape (n,) each.

    Args:
        bound: c, shape (n,).
        sine: s, same shape.
        tension: f, same shape, NaN without a tensile strength.
    """
    steep, cut = sine > 0, ~np.isnan(tension)
    apex = bound / np.where(steep, 2 * sine, 1.0)
    half = (bound / 2 - sine * tension) / (1 - sine)
    of_trace = np.where(cut, tension - half, np.where(steep, apex, 0.0))
    of_sizes = np.where(cut, half, np.where(steep, 0.0, bound / 2))
    return of_trace, of_sizes


def _values(vector: Floats) -> Floats:
    tensors = np.zeros((*vector.shape[:-1], 3, 3))
    for i in range(3):
        tensors[..., i, i] = vector[..., i]
    pairs = [(0, 1)] if vector.shape[-1] == 4 else [(1, 2), (0, 2), (0, 1)]
    for place, (i, j) in enumerate(pairs, start=3):
        tensors[..., i, j] = tensors[..., j, i] = np.sqrt(0.5) * vector[..., place]
    return np.asarray(np.linalg.eigvalsh(tensors), dtype=np.float64)
