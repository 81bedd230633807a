"""Products of static and kinematic unknowns, and how they are brought near to one another.

An interior point method goes far where all products shrink together. J. Gondzio, Multiple
centrality corrections in a primal-dual method for linear programming, Comput. Optim. Appl. 6
(1996), 137, doi:10.1007/BF00249643; for cones with the eigenvalues of the products.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import SIZE, least_eigenvalue
from perfplast_fenicsx.rounding import TINY

NEAR = 0.1
"""Products between this share of what they should be and its inverse are left as they are."""


@dataclass(frozen=True)
class Products:
    """Products of static and kinematic members, for the cones and pairs of this rank.

    Attributes:
        cones: Jordan's products of scaled members, shape (num_cones, 1 + m).
        matrices: The same of semidefinite ones, shape (num, k, 3, 3).
        pairs: Forces times rooms, shape (num_pairs,).
    """

    cones: Floats
    matrices: Floats
    pairs: Floats

    def __add__(self, other: "Products") -> "Products":
        cones, matrices = self.cones + other.cones, self.matrices + other.matrices
        return Products(cones, matrices, self.pairs + other.pairs)

    def __neg__(self) -> "Products":
        return Products(-self.cones, -self.matrices, -self.pairs)

    def raised(self, by: float) -> "Products":
        """Return the products with a number added to their eigenvalues."""
        cones = self.cones.copy(order="K")
        cones[:, 0] += by
        return Products(cones, self.matrices + by * np.eye(SIZE), self.pairs + by)

    def missing(self, mu: float) -> "Products":
        """Return the change that brings outliers nearer to μ; large ones by a limited amount."""
        size = np.linalg.norm(self.cones[:, 1:], axis=1)
        low, high = (_missing(self.cones[:, 0] + s * size, mu) for s in (-1, 1))
        cones = np.empty_like(self.cones)
        cones[:, 0] = (low + high) / 2
        share = (high - low) / 2 / np.maximum(size, TINY)
        cones[:, 1:] = share[:, None] * self.cones[:, 1:]
        matrices = np.zeros_like(self.matrices)
        near = 1 + 1e-6  # most matrices have nothing to be moved, which their ends show sooner
        least, most = least_eigenvalue(self.matrices), -least_eigenvalue(-self.matrices)
        far = (least < near * NEAR * mu) | (most * near > mu / NEAR)
        values, axes = np.linalg.eigh(self.matrices[far])
        matrices[far] = (axes * _missing(values, mu)[..., None, :]) @ np.swapaxes(axes, -1, -2)
        return Products(cones, matrices, _missing(self.pairs, mu))


def _missing(values: Floats, mu: float) -> Floats:
    most = mu / NEAR
    missing: Floats = np.maximum(np.clip(values, NEAR * mu, most) - values, -most)
    return missing
