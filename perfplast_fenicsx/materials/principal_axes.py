"""Compute principal values and axes of symmetric tensors in UFL, accurately also for equal values.

One axis is either known (the out-of-plane axis) or computed first. The computed axis belongs to the
value that is farthest from both other values, because a closed form for this axis is well
conditioned (O. K. Smith, Commun. ACM 4 (1961), 168). The other values follow from Mohr's circle in
the plane perpendicular to this axis.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import ufl

from perfplast_fenicsx.materials.mandel import Expr, deviator, tensor, trace

IN_PLANE = 4
"""Number of components of Mandel vectors with a known principal axis."""

TINY = 1e-150
"""Smallest divisor, which avoids 0/0 for two equal principal values. The square of this number does
not underflow to zero.
"""


@dataclass(frozen=True)
class PrincipalAxes:
    """Principal values of a Mandel vector with four or six components, and tensors of their axes.

    Attributes:
        e: The Mandel vector.
    """

    e: Expr

    @cached_property
    def out(self) -> tuple[Expr, Expr, Expr]:
        """Return unit vectors: the known or first computed axis, and two vectors normal to it."""
        if len(self.e) == IN_PLANE:
            rows = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            return tuple(ufl.as_vector(row) for row in rows)
        rest = tensor(deviator(self.e))
        size = ufl.sqrt(ufl.inner(rest, rest) / 6)
        unit = rest / ufl.max_value(size, TINY)
        half = ufl.det(unit) / 2
        angle = ufl.acos(ufl.min_value(abs(half), 1.0)) / 3
        value = 2 * ufl.conditional(ufl.lt(half, 0.0), -1.0, 1.0) * ufl.cos(angle)
        shifted = unit - value * ufl.Identity(3)
        rows = [ufl.as_vector([shifted[i, j] for j in range(3)]) for i in range(3)]
        crosses = [ufl.cross(rows[i], rows[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
        squares = [ufl.dot(cross, cross) for cross in crosses]
        best = ufl.max_value(squares[0], ufl.max_value(squares[1], squares[2]))
        found = crosses[2]
        for square, cross in zip(squares[:2], crosses[:2], strict=True):
            here = ufl.ge(square, best)
            found = ufl.as_vector([ufl.conditional(here, cross[i], found[i]) for i in range(3)])
        # A deviator below this relative size is a rounding error, and its axes have no meaning.
        rounded = 1e-14
        round_ = ufl.le(size, ufl.max_value(rounded * abs(trace(self.e)), TINY))
        unit_z = (0.0, 0.0, 1.0)
        length = ufl.sqrt(ufl.max_value(best, TINY))
        n = ufl.as_vector([ufl.conditional(round_, unit_z[i], found[i] / length) for i in range(3)])
        return n, *_beside(n)

    @cached_property
    def circle(self) -> tuple[Expr, Expr, Expr, Expr]:
        """Return the mean, the half difference and the shear in the plane, and the value across."""
        n, a, b = self.out
        A = tensor(self.e)
        first, last, shear = (ufl.dot(x, A * y) for x, y in ((a, a), (b, b), (a, b)))
        return (first + last) / 2, (first - last) / 2, shear, ufl.dot(n, A * n)

    @cached_property
    def radius(self) -> Expr:
        """Return the radius of Mohr's circle in the plane."""
        _, half, shear, _ = self.circle
        return ufl.sqrt(half**2 + shear**2)

    @cached_property
    def in_plane(self) -> tuple[Expr, Expr]:
        """Return the two principal values in the plane, the larger value first."""
        mean, *_ = self.circle
        return mean + self.radius, mean - self.radius

    @cached_property
    def across(self) -> Expr:
        """Return the principal value out of the plane."""
        return self.circle[3]

    @cached_property
    def ordered(self) -> tuple[Expr, Expr, Expr]:
        """Return all three principal values, the largest value first."""
        (p, q), z = self.in_plane, self.across
        middle = ufl.max_value(q, ufl.min_value(p, z))
        return ufl.max_value(p, z), middle, ufl.min_value(q, z)

    def placed(self, v: Sequence[Expr]) -> tuple[Expr, Expr, Expr]:
        """Return the descending values ``v`` in the order of the axes of ``e``.

        This order is: axis of the larger in-plane value, axis of the smaller in-plane value, axis
        out of the plane.
        """
        (p, q), z = self.in_plane, self.across
        above, below = ufl.gt(z, p), ufl.lt(z, q)
        across = ufl.conditional(above, v[0], ufl.conditional(below, v[2], v[1]))
        first = ufl.conditional(above, v[1], v[0])
        return first, ufl.conditional(below, v[1], v[2]), across

    @cached_property
    def _double_angle(self) -> tuple[Expr, Expr]:
        """Return cosine and sine of twice the angle of the axis of the larger in-plane value."""
        _, half, shear, _ = self.circle
        size, round_ = ufl.max_value(self.radius, TINY), ufl.le(self.radius, TINY)
        cosine = ufl.conditional(round_, 1.0, half / size)
        return cosine, ufl.conditional(round_, 0.0, shear / size)

    def _deviator(self, cosine: Expr, sine: Expr) -> Expr:
        _, a, b = self.out
        even, odd = ufl.outer(a, a) - ufl.outer(b, b), ufl.outer(a, b) + ufl.outer(b, a)
        return self._mandel((cosine * even + sine * odd) / math.sqrt(2))

    @cached_property
    def direction(self) -> Expr:
        """Return the unit deviator of the in-plane part as a Mandel vector.

        The result is arbitrary if the two in-plane values are equal.
        """
        return self._deviator(*self._double_angle)

    @cached_property
    def turned(self) -> Expr:
        """Return the unit deviator for a rotation of the axes in the plane."""
        cosine, sine = self._double_angle
        return self._deviator(-sine, cosine)

    @cached_property
    def tilted(self) -> tuple[Expr, ...]:
        """Return unit deviators for rotations of the in-plane axes out of the plane.

        The tuple is empty if the axis normal to the plane is known.
        """
        if len(self.e) == IN_PLANE:
            return ()
        n, a, b = self.out
        cosine, sine = self._double_angle
        # cosine and sine of the angle; of two equivalent forms, the form without cancellation
        c = ufl.sqrt((1 + abs(cosine)) / 2)
        s = abs(sine) / (2 * c)
        falls, sign = ufl.lt(cosine, 0.0), ufl.conditional(ufl.lt(sine, 0.0), -1.0, 1.0)
        along, beside = ufl.conditional(falls, s, c), sign * ufl.conditional(falls, c, s)
        found = []
        for x in (along * a + beside * b, along * b - beside * a):
            both = ufl.outer(x, n) + ufl.outer(n, x)
            found.append(self._mandel(both / math.sqrt(2)))
        return tuple(found)

    def vector(self, v: Sequence[Expr]) -> Expr:
        """Return the Mandel vector with given descending principal values and the same axes."""
        first, second, across = self.placed(v)
        n, mean = self.out[0], (first + second) / 2
        flat = self._mandel(mean * ufl.Identity(3) + (across - mean) * ufl.outer(n, n))
        return flat + (first - second) / math.sqrt(2) * self.direction

    def _mandel(self, A: Expr) -> Expr:
        """Return the Mandel vector of a tensor, with as many components as ``e``."""
        shears = [(0, 1)] if len(self.e) == IN_PLANE else [(1, 2), (0, 2), (0, 1)]
        parts = [A[i, i] for i in range(3)] + [math.sqrt(2) * A[i, j] for i, j in shears]
        return ufl.as_vector(parts)


@lru_cache(maxsize=8)
def principal_axes(e: Expr) -> PrincipalAxes:
    """Return the principal axes of a Mandel vector; equal vectors share one object."""
    return PrincipalAxes(e)


def _beside(n: Expr) -> tuple[Expr, Expr]:
    """Return two unit vectors normal to a unit vector n (T. Duff et al., JCGT 6 (2017))."""
    sign = ufl.conditional(ufl.lt(n[2], 0.0), -1.0, 1.0)
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    return (
        ufl.as_vector([1 + sign * n[0] ** 2 * a, sign * b, -sign * n[0]]),
        ufl.as_vector([b, sign + n[1] ** 2 * a, -n[1]]),
    )
