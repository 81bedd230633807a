"""Compute with arrays of double-double numbers and bounds on their errors.

A number is the sum of two doubles. The second double is at most a rounding error of the first
double. The radius of a number bounds its error: every result contains the exact result for all
numbers within the radii. Sums and products of two doubles are exact as pairs of doubles (T. J.
Dekker, doi:10.1007/BF01397083). Each operation rounds only the second double, by at most U times
its size, and increases the radius by this amount. Radii are rounded too, and enlarged accordingly.
The entries of stored arrays are zero or between 1e-60 and 1e60 in size, so products do not
overflow. Numbers below 1e-75 become zero with the radius 1e-75, which covers underflow.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats

U = 2.0**-53
"""Largest rounding error of an operation, relative to its result."""

TINY = 1e-75
"""Smaller numbers become zero, with this value as radius."""


def upwards(values: Floats, terms: int = 16) -> Floats:
    """Return rounded sums or products of ``terms`` non-negative numbers as upper bounds."""
    return np.asarray(values * (1 + 4 * terms * U))


def norms_of(vectors: Floats) -> Floats:
    """Return Euclidean norms along the last axis; at least 1e-150 for a vector that is not zero.

    Squares of numbers below 1e-150 may underflow.
    """
    found = np.sqrt((vectors**2).sum(axis=-1))
    return np.asarray(np.where((vectors != 0).any(axis=-1), np.maximum(found, 1e-150), found))


@dataclass(frozen=True)
class Balls:
    """Numbers that differ from ``mid + low`` by at most ``rad``.

    Attributes:
        mid: First part, any shape.
        low: Second part, of the same shape.
        rad: Radius, of the same shape.
    """

    mid: Floats
    low: Floats
    rad: Floats

    @classmethod
    def exact(cls, values: Any) -> "Balls":
        """Return numbers with zero radius, except that numbers below 1e-75 become 0 ± 1e-75."""
        mid = np.asarray(values, dtype=np.float64)
        lost = (mid != 0) & (np.abs(mid) < TINY)
        return cls(np.where(lost, 0.0, mid), np.zeros_like(mid), np.where(lost, TINY, 0.0))

    @classmethod
    def part(cls, number: int) -> "Balls":
        """Return 1/``number``."""
        mid = np.asarray(1 / number)
        product, rest = _product(mid, np.asarray(float(number)))
        low = np.asarray(((1 - product) - rest) / number)
        return cls(mid, low, 4 * U * np.abs(low))

    @property
    def size(self) -> Floats:
        """Return upper bounds on the numbers' magnitudes."""
        return upwards(np.abs(self.mid) + np.abs(self.low) + self.rad)

    def norms(self) -> Floats:
        """Return upper bounds on the Euclidean norms along the last axis."""
        return upwards(norms_of(self.size))

    def distances(self) -> Floats:
        """Return upper bounds on the distances of vectors from ``mid``, along the last axis."""
        return upwards(norms_of(self.rad + np.abs(self.low)))

    def each(self, change: Callable[[Floats], Any]) -> "Balls":
        """Return the numbers after applying ``change`` to each of their three parts."""
        return Balls(*(np.asarray(change(part)) for part in (self.mid, self.low, self.rad)))

    def __getitem__(self, at: Any) -> "Balls":
        return self.each(lambda part: part[at])

    def __neg__(self) -> "Balls":
        return Balls(-self.mid, -self.low, self.rad)

    def __add__(self, other: "Balls") -> "Balls":
        mid, rest = _sum(self.mid, other.mid)
        low = self.low + other.low
        low, lost = low + rest, np.abs(low) + np.abs(rest)
        rad = self.rad + other.rad + 2 * U * lost
        return Balls(*_sum(mid, low), upwards(rad))

    def __sub__(self, other: "Balls") -> "Balls":
        return self + -other

    @cached_property
    def _is_exact(self) -> bool:
        return not (self.low.any() or self.rad.any())

    def __mul__(self, other: "Balls") -> "Balls":
        mid, rest = _product(self.mid, other.mid)
        if self._is_exact and other._is_exact:
            return Balls(mid, rest, upwards(3 * U * np.abs(rest)))
        one, two = self.mid * other.low, self.low * other.mid
        low = rest + (one + two)
        lost = 3 * U * (np.abs(rest) + np.abs(one) + np.abs(two)) + np.abs(self.low * other.low)
        rad = lost + _size(self) * other.rad + self.rad * (_size(other) + other.rad)
        return Balls(*_short_sum(mid, low), upwards(rad))

    def sum(self, axis: int) -> "Balls":
        """Return sums along an axis with few entries."""
        count = self.mid.shape[axis]
        every = (slice(None),) * (axis % self.mid.ndim)
        return reduce(Balls.__add__, (self[(*every, k)] for k in range(count)))

    def where(self, here: Any, other: "Balls | None" = None) -> "Balls":
        """Return the numbers where ``here`` is True, and ``other`` (by default zero) elsewhere."""
        if other is None:
            return self.each(lambda part: np.where(here, part, 0.0))
        return Balls(
            np.where(here, self.mid, other.mid),
            np.where(here, self.low, other.low),
            np.where(here, self.rad, other.rad),
        )

    def root(self) -> "Balls":
        """Return square roots of numbers, which must be zero or larger than their radii."""
        mid = np.sqrt(self.mid)
        some = mid > 0
        square, rest = _product(mid, mid)
        left = (self.mid - square) - rest + self.low  # the first difference is exact
        low = np.divide(left, 2 * mid, out=np.zeros_like(mid), where=some)
        lost = self.rad + 4 * U * (np.abs(left) + np.abs(rest)) + low**2
        rad = np.divide(lost, mid, out=np.zeros_like(mid), where=some)
        return Balls(mid, low, upwards(rad))


def _size(of: Balls) -> Floats:
    return np.abs(of.mid) + np.abs(of.low)


def _sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return a + b and its rounding error."""
    total = a + b
    there = total - a
    return total, (a - (total - there)) + (b - there)


def _short_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return a + b and its rounding error, for |b| ≤ |a|."""
    total = a + b
    return total, b - (total - a)


def _product(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return ab and its rounding error."""
    total = a * b
    (a1, a2), (b1, b2) = _halves(a), _halves(b)
    return total, a2 * b2 - (((total - a1 * b1) - a2 * b1) - a1 * b2)


def _halves(a: Floats) -> tuple[Floats, Floats]:
    """Return two numbers of at most 26 bits whose sum is a."""
    large = 134_217_729.0 * a
    first = large - (large - a)
    return first, a - first


def inverse_of(of: Balls) -> Balls:
    """Return 1/x for numbers x; the radius is ∞ if x may be zero.

    For an approximation y of 1/x, the result is y(1 + r + r² + ...) with r = 1 − yx.
    """
    first = Balls.exact(np.divide(1.0, of.mid, out=np.zeros_like(of.mid), where=of.mid != 0))
    rest = Balls.exact(np.ones_like(of.mid)) - first * of
    found, size = first + first * rest, rest.size
    last = np.where(size < 0.5, 2 * np.abs(first.mid) * size**2, np.inf)
    return Balls(found.mid, found.low, upwards(found.rad + last))


def put(all_of: Balls, at: npt.NDArray[np.int64], values: Balls) -> Balls:
    """Return ``all_of`` with the rows ``at`` replaced by ``values``."""
    found = all_of.each(np.copy)
    found.mid[at], found.low[at], found.rad[at] = values.mid, values.low, values.rad
    return found


def contracted(one: Balls, other: Balls) -> Balls:
    """Return sums of products along the last axis, which has few entries."""
    if len(one.mid) != len(other.mid):
        return (one * other).sum(axis=-1)
    return in_blocks(lambda a, b: (a * b).sum(axis=-1), one, other)


def in_blocks(change: Callable[..., Balls], *all_of: Balls) -> Balls:
    """Return the results of ``change`` for blocks of rows, whose intermediate arrays fit a cache.

    Args:
        change: Function of arrays with equal numbers of rows, which returns as many rows.
        all_of: Its arguments.
    """
    rows, at_once = len(all_of[0].mid), 500
    if rows <= at_once:
        return change(*all_of)
    blocks = (slice(first, first + at_once) for first in range(0, rows, at_once))
    parts = [change(*(of[block] for of in all_of)) for block in blocks]
    return Balls(*(np.concatenate([getattr(p, of) for p in parts]) for of in ("mid", "low", "rad")))


def stacked(parts: Iterable[Balls], axis: int) -> Balls:
    """Return arrays stacked along a new axis."""
    parts = list(parts)
    return Balls(*(np.stack([getattr(p, of) for p in parts], axis) for of in ("mid", "low", "rad")))


def crossed(arms: Balls, forces: Balls) -> Balls:
    """Return arms × forces, of shape (..., 1) in 2D and (..., 3) in 3D."""
    pairs = [(0, 1)] if arms.mid.shape[-1] == 2 else [(1, 2), (2, 0), (0, 1)]
    parts = [arms[..., i] * forces[..., j] - arms[..., j] * forces[..., i] for i, j in pairs]
    return stacked(parts, -1)
