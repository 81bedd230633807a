"""Second-order cones a₀ ≥ ‖a'‖, many at once, and the scaling of Nesterov and Todd. NumPy only.

Members are rows (a₀, a') of arrays of shape (num_cones, 1 + m). Notation and formulas are those of
E. D. Andersen, C. Roos, T. Terlaky, On implementing a primal-dual interior-point method for conic
quadratic optimization, Math. Program. 95 (2003), 249.
"""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.rounding import TINY

Floats = npt.NDArray[np.float64]


def determinant(a: Floats) -> Floats:
    """a₀² − ‖a'‖², shape (num_cones,)."""
    size = np.sqrt(np.einsum("ni,ni->n", a[:, 1:], a[:, 1:]))
    return np.maximum((a[:, 0] - size) * (a[:, 0] + size), TINY)


def product(a: Floats, b: Floats) -> Floats:
    """Jordan's product (a·b, a₀ b' + b₀ a')."""
    head = np.einsum("ni,ni->n", a, b)[:, None]
    return np.hstack([head, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]])


def quotient(a: Floats, b: Floats) -> Floats:
    """Return the x whose product with a is b; a inside the cone."""
    inner = np.einsum("ni,ni->n", a[:, 1:], b[:, 1:])
    head = ((a[:, 0] * b[:, 0] - inner) / determinant(a))[:, None]
    return np.hstack([head, (b[:, 1:] - head * a[:, 1:]) / a[:, :1]])


def longest_step(a: Floats, da: Floats) -> float:
    """Largest t for which a + t da are in the cones, a being inside; ∞ if any is."""
    if not len(a):
        return np.inf
    # of A t² + 2 B t + C the smallest positive root, in a form that loses no digits
    square = da[:, 0] ** 2 - np.einsum("ni,ni->n", da[:, 1:], da[:, 1:])
    half = a[:, 0] * da[:, 0] - np.einsum("ni,ni->n", a[:, 1:], da[:, 1:])
    least = determinant(a)
    discriminant = half**2 - square * least
    divisor = np.sqrt(np.maximum(discriminant, 0)) - half
    leaves = (discriminant >= 0) & (divisor > 0) & ((square < 0) | (half < 0))
    steps = np.full(len(a), np.inf)
    np.divide(least, divisor, out=steps, where=leaves)
    return float(steps.min())


class Scaling:
    """The W of Nesterov and Todd with W z = W⁻¹ s =: point, for s and z inside the cones.

    W = η (w₀, w'ᵀ; w', I + w' w'ᵀ/(1 + w₀)) with w₀² − ‖w'‖² = 1.

    Attributes:
        point: W z, shape (num_cones, 1 + m).
    """

    def __init__(self, s: Floats, z: Floats) -> None:
        size_s, size_z = np.sqrt(determinant(s)), np.sqrt(determinant(z))
        unit_s, unit_z = s / size_s[:, None], z / size_z[:, None]
        mean = np.sqrt((1 + np.einsum("ni,ni->n", unit_s, unit_z)) / 2)
        unit_z[:, 1:] *= -1
        w = (unit_s + unit_z) / (2 * mean)[:, None]
        self._eta = np.sqrt(size_s / size_z)
        self._w0, self._w = w[:, 0], w[:, 1:]
        self.point = self.apply(z)

    def apply(self, a: Floats) -> Floats:
        """W a."""
        return self._boost(a, self._w) * self._eta[:, None]

    def invert(self, a: Floats) -> Floats:
        """W⁻¹ a."""
        return self._boost(a, -self._w) / self._eta[:, None]

    def _boost(self, a: Floats, w: Floats) -> Floats:
        inner = np.einsum("ni,ni->n", w, a[:, 1:])
        head = self._w0 * a[:, 0] + inner
        along = a[:, 0] + inner / (1 + self._w0)
        return np.hstack([head[:, None], a[:, 1:] + along[:, None] * w])

    def moduli(self) -> tuple[Floats, Floats]:
        """Return the inverse of the block of W⁻² that belongs to a', as a I − N Nᵀ.

        Returns:
            a, shape (num_cones,); N, shape (num_cones, m).
        """
        size2 = np.einsum("ni,ni->n", self._w, self._w)
        scale = self._eta * np.sqrt(2 / (1 + 2 * size2))
        return self._eta**2, scale[:, None] * self._w

    def coupled(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Return W² for a₀ = −αp besides :meth:`moduli`: κ(t − b·x)² for rates t and x.

        Args:
            slopes: α > 0, shape (num_cones,).

        Returns:
            κ, shape (num_cones,); b, shape (num_cones, m).
        """
        size2 = 1 + 2 * np.einsum("ni,ni->n", self._w, self._w)
        along = (2 * slopes * self._w0 / size2)[:, None] * self._w
        return self._eta**2 * size2 / slopes**2, along

    def inverse_square(self) -> tuple[Floats, Floats]:
        """W⁻² as (2 n nᵀ − J)/η² with J = diag(1, −1, …, −1).

        Returns:
            1/η², shape (num_cones,); n, shape (num_cones, 1 + m).
        """
        return self._eta**-2.0, np.column_stack([self._w0, -self._w])
