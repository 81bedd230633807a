"""Construct dual functions on partly covered facets.

The multipliers are defined on the host's facets e. Over the covered part e' of each facet, the dual
functions φ = D_e M_e⁻¹ Ñ are biorthogonal to the host's functions Ñ: ∫φ_i Ñ_k = δ_ik ∫Ñ_k. They sum
to 1 (Cichosz and Bischoff, CMAME 200, 2011, doi 10.1016/j.cma.2010.11.004). So a row has one host
on its own surface, and its weights on the other surface sum to the host's weight.

On triangles of second order, the functions N of vertices have ∫N = 0, which no multiplier can use.
There the functions are Ñ_v = N_v + α Σ N_m over the midsides m next to v, and Ñ_m = (1 − 2α) N_m
(Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34, 2012, doi 10.1137/110848190). With α = 1/4
they are Bernstein polynomials, which are nowhere negative. The weights d are then positive whatever
part is covered.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.surfaces.surface_facets import EDGES, STRAIGHT, Facets


def coupled(gdim: int, count: int) -> bool:
    """Return whether the functions Ñ of a facet with ``count`` nodes differ from N."""
    return count == 6 and gdim == 3


def own_basis(gdim: int, count: int) -> Floats:
    """Return the matrix of Ñ = basis · N on a host facet, shape (count, count)."""
    basis = np.eye(count)
    if coupled(gdim, count):
        alpha = 0.25  # α of the functions on triangles of second order
        basis[3:, 3:] *= 1 - 2 * alpha
        for middle, ends in enumerate(EDGES[3], start=3):
            basis[ends, middle] = alpha
    return basis


def turning(hosts: Facets) -> PairFlags:
    """Return which facets with Ñ ≠ N have a varying normal, shape (num_hosts,)."""
    if not coupled(hosts["x"].shape[2], hosts["node"].shape[1]):
        return np.zeros(len(hosts), dtype=np.bool_)
    return np.asarray(np.ptp(hosts["normal"], axis=1).max(axis=1) > STRAIGHT)


def dual_factors(mass: Floats, d: Floats) -> Floats:
    """Return D_e M_e⁻¹ of each host facet, shape (num_hosts, nodes, nodes).

    If almost nothing of a facet is covered, M_e cannot be inverted. All its functions are then
    constants, φ_i = d_i / |e'|, which preserve balance and constant pressures.

    Args:
        mass: M_e = ∫ÑÑ of each facet, same shape.
        d: Integrals ∫Ñ, shape (num_hosts, nodes).
    """
    diagonal = np.einsum("nii->ni", mass)
    size = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
    scaled = mass / (size[:, :, None] * size[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    # Smallest eigenvalue at which a facet's mass matrix, scaled to a diagonal of 1, is inverted.
    singular = 1e-14
    sound = (values[:, 0] > singular) & (d.sum(axis=1) > 0)
    roots = np.where(sound[:, None], values, 1.0)
    inverse = np.einsum("nij,nj,nkj->nik", vectors, 1 / roots, vectors)
    inverse /= size[:, :, None] * size[:, None, :]
    total = d.sum(axis=1)
    constant = d / np.where(total > 0, total, 1.0)[:, None]
    ones = np.broadcast_to(constant[:, :, None], mass.shape)
    dual: Floats = np.where(sound[:, None, None], d[:, :, None] * inverse, ones)
    return dual
