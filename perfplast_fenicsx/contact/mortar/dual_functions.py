"""Dual functions of facets, of which part is covered.

The multipliers live on the host's facets e. Over the covered part e' of each, the dual functions
φ = D_e M_e⁻¹ Ñ of the host's functions Ñ are biorthogonal to them, ∫φ_i Ñ_k = δ_ik ∫Ñ_k, and add up
to 1 (Cichosz and Bischoff, CMAME 200, 2011, doi 10.1016/j.cma.2010.11.004). So a row has one host
on its own surface, and its weights on the other one add up to the host's.

On triangles of second order vertices have functions N with ∫N = 0, which no multiplier can use. So
there Ñ_v = N_v + α Σ N_m over the midsides m next to v, and Ñ_m = (1 − 2α) N_m (Popp, Wohlmuth, Gee
and Wall, SIAM J. Sci. Comput. 34, 2012, doi 10.1137/110848190). α = 1/4 makes them Bernstein's
polynomials, which are nowhere negative: weights d stay positive whatever part is covered.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.surfaces.surface_facets import EDGES, STRAIGHT, Facets


def coupled(gdim: int, count: int) -> bool:
    """Return whether the Ñ of a host facet with so many nodes are not its N."""
    return count == 6 and gdim == 3


def own_basis(gdim: int, count: int) -> Floats:
    """Ñ = basis · N of a host facet, shape (count, count)."""
    basis = np.eye(count)
    if coupled(gdim, count):
        alpha = 0.25  # α of the functions on triangles of second order
        basis[3:, 3:] *= 1 - 2 * alpha
        for middle, ends in enumerate(EDGES[3], start=3):
            basis[ends, middle] = alpha
    return basis


def turning(hosts: Facets) -> PairFlags:
    """Facets with functions other than N along which the normal turns, shape (num_hosts,)."""
    if not coupled(hosts["x"].shape[2], hosts["node"].shape[1]):
        return np.zeros(len(hosts), dtype=np.bool_)
    return np.asarray(np.ptp(hosts["normal"], axis=1).max(axis=1) > STRAIGHT)


def dual_factors(mass: Floats, d: Floats) -> Floats:
    """D_e M_e⁻¹ of each host facet, shape (num_hosts, nodes, nodes).

    Where next to nothing of a facet is covered M_e cannot be inverted. All its functions then are
    constants, φ_i = d_i / |e'|: they keep balance and constant pressures.

    Args:
        mass: M_e = ∫ÑÑ of each, same shape.
        d: ∫Ñ, shape (num_hosts, nodes).
    """
    diagonal = np.einsum("nii->ni", mass)
    size = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
    scaled = mass / (size[:, :, None] * size[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    # Smallest eigenvalue of a facet's mass matrix, scaled to a diagonal of 1, that is inverted.
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
