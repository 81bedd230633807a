"""Define Mandel vectors of symmetric tensors, and Hooke's tensor for these vectors.

The module uses only UFL. Mandel vectors are

    (e_xx, e_yy, e_zz, √2 e_yz, √2 e_xz, √2 e_xy)      in 3D,
    (e_xx, e_yy, e_zz, √2 e_xy)                        in plane strain,
    (e_rr, e_zz, e_θθ, √2 e_rz)                        in axisymmetry.

With these vectors, ``dot(s, e)`` is σ:e and ``sqrt(dot(e, e))`` is the Frobenius norm. Plane strain
is 3D with zero out-of-plane strain; the vectors include the out-of-plane stress.

The module also defines Hooke's tensor C of an isotropic body, and the inverse of C. All expressions
are UFL expressions at a point.
"""

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.utils.stacks import StackDict

from perfplast_fenicsx.arrays import Floats

Expr: TypeAlias = Any
"""A UFL expression; UFL provides no types."""


def mandel_size(gdim: int) -> int:
    """Return the number of Mandel components: 6 in 3D, 4 in plane strain and axisymmetry."""
    return {2: 4, 3: 6}[gdim]


def trace(e: Expr) -> Expr:
    """Return the trace of a Mandel vector."""
    return e[0] + e[1] + e[2]


def deviator(e: Expr) -> Expr:
    """Return the deviator of a Mandel vector."""
    mean = trace(e) / 3
    return ufl.as_vector([e[i] - mean if i < 3 else e[i] for i in range(len(e))])


def spherical(pressure: Expr, size: int) -> Expr:
    """Return the Mandel vector of ``pressure`` times the unit tensor."""
    return ufl.as_vector([pressure if i < 3 else 0 for i in range(size)])


def tensor(s: Expr) -> Expr:
    """Return the 3×3 symmetric tensor of a Mandel vector."""
    zero = ufl.as_ufl(0.0)
    shears = [s[i] / math.sqrt(2) for i in range(3, len(s))]
    yz, xz, xy = (zero, zero, *shears) if len(shears) == 1 else shears
    return ufl.as_tensor([[s[0], xy, xz], [xy, s[1], yz], [xz, yz, s[2]]])


def numbers_of(expression: Expr) -> Floats:
    """Return the values of a constant UFL expression, evaluated entry by entry."""
    plain = expand_derivatives(ufl.as_ufl(expression))  # once for all entries
    entries = [plain.evaluate((), {}, i, StackDict()) for i in np.ndindex(*plain.ufl_shape)]
    return np.array(entries, dtype=np.float64).reshape(plain.ufl_shape)


@dataclass(frozen=True)
class IsotropicElasticity:
    """Hooke's tensor C of an isotropic body: C e = κ tr(e) δ + 2μ dev e.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
    """

    bulk: Expr
    shear: Expr

    def hooke(self, e: Expr) -> Expr:
        """Return C e."""
        return spherical(self.bulk * trace(e), len(e)) + 2 * self.shear * deviator(e)

    def compliance(self, s: Expr) -> Expr:
        """Return C⁻¹ s."""
        return spherical(trace(s) / (9 * self.bulk), len(s)) + deviator(s) / (2 * self.shear)
