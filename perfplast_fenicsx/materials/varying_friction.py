"""Define spatially varying friction angles for the Mohr–Coulomb condition.

In plane strain the yield set at a point x is ‖dev σ‖ ≤ √2 s(x)(a(x) − p), with s = sin φ, the mean
stress p and the apex a = c cot φ. For a stress that is linear in a cell, s(x) p(x) is quadratic. A
check of the condition at the vertices is therefore not sufficient. Strict bounds use one slope for
each cell:

- The lower bound uses the smallest s in the cell, and a linear function b ≤ s a instead of s a.
  If b − s p ≥ 0, then p ≤ b/s ≤ a, and therefore b − s p ≤ s(x)(a(x) − p). The set therefore lies
  inside the yield set of each point.
- The upper bound uses the largest s, and a linear function b ≥ s a. The set therefore contains the
  yield set of each point.

The linear functions follow from linear bounds of φ, because the cotangent is convex: it lies above
its tangents and below its chords. Both bounds converge to the same value as cells become smaller.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.formulas import Pair, linear_product
from perfplast_fenicsx.spatial_fields import SpatialField, Strength


@dataclass(frozen=True)
class FrictionAngle(SpatialField):
    """A field of friction angles φ (degrees), with tan φ divided by a number.

    Args:
        angle: The field of angles before the division (degrees).
        divisor: F > 0.
        scale: Always 1.
    """

    angle: SpatialField
    divisor: float = 1.0

    def in_words(self) -> str:
        """Return a description of the field and of the divisor of its tangent."""
        less = "" if self.divisor == 1 else f", its tangent divided by {self.divisor:.6g}"
        return f"{self.angle}{less}"

    def _at(self, x: Floats, place: str) -> Floats:
        return np.degrees(np.arctan(self._tangents(x, place)))

    def _between(self, corners: Floats, place: str) -> Pair:
        low, high = (np.degrees(np.arctan(it)) for it in self.extremes(corners, place))
        return _even(low, corners), _even(high, corners)

    def _tangents(self, x: Floats, place: str) -> Floats:
        """Return tan φ/F at points.

        Raises:
            InputError: If an angle is out of its range; the message gives the point with the worst
                angle.
        """
        angles = self.angle.at(x, place)
        wrong = ~((angles > 0) & (angles < 90))
        if wrong.any():
            worst = int(np.argmax(np.where(wrong, np.abs(angles - 45), -np.inf)))
            raise InputError(
                f"{place}: friction_angle, {self.angle}, is {angles[worst]:.6g} degrees at "
                f"{place_of(x[worst])}; a friction angle that varies must be between 0 and 90 "
                "degrees in the whole body, so give valid values there, or give ground without "
                "friction a separate body with law = 'tresca'."
            )
        return np.asarray(np.tan(np.radians(angles)) / self.divisor)

    def angles_between(self, corners: Floats, place: str) -> Pair:
        """Return linear bounds of the undivided angle in simplices (radians).

        Args:
            corners: Vertices of the simplices, shape (n, k, d).
            place: Name of the object with the field, for messages.

        Returns:
            Values of the lower and the upper bound at the vertices, each of shape (n, k).

        Raises:
            InputError: If a linear bound of the angle leaves the range of angles.
        """
        low, high = self.angle.between(corners, place)
        wrong = ~((low > 0) & (high < 90)).all(axis=1)
        if wrong.any():
            where = place_of(corners[int(np.argmax(wrong))].mean(axis=0))
            raise InputError(
                f"{place}: friction_angle, {self.angle}, varies so steeply in the cell at {where} "
                "that no linear bounds between 0 and 90 degrees are known for it; refine the "
                "mesh there, or draw lines where the slope of the angle changes."
            )
        return np.radians(low), np.radians(high)

    def extremes(self, corners: Floats, place: str) -> Pair:
        """Return a lower and an upper bound on tan φ/F in each simplex, each of shape (n,)."""
        low, high = self.angles_between(corners, place)
        return np.tan(low.min(axis=1)) / self.divisor, np.tan(high.max(axis=1)) / self.divisor


@dataclass(frozen=True)
class FrictionSine(SpatialField):
    """The field sin φ, with lower and upper bounds that are constant in each cell.

    Args:
        friction: φ.
        scale: Always 1.
    """

    friction: FrictionAngle

    def in_words(self) -> str:
        """Return a description of the field."""
        return f"the sine of {self.friction}"

    def _at(self, x: Floats, place: str) -> Floats:
        return np.sin(np.radians(self.friction.at(x, place)))

    def _between(self, corners: Floats, place: str) -> Pair:
        least, most = map(_sine, self.friction.extremes(corners, place))
        return _even(least, corners), _even(most, corners)


@dataclass(frozen=True)
class FrictionStrength(SpatialField):
    """The field 2c cos φ, with linear bounds in a cell that fit the slope of :class:`FrictionSine`.

    Args:
        cohesion: c > 0 (stress).
        friction: φ.
        scale: Factor of the field.
    """

    cohesion: Strength
    friction: FrictionAngle

    def in_words(self) -> str:
        """Return a description of the field."""
        return f"2 ({self.cohesion}) times the cosine of {self.friction}"

    def _at(self, x: Floats, place: str) -> Floats:
        cohesion = self.cohesion
        if isinstance(cohesion, SpatialField):
            cohesion = cohesion.at(x, place)
        return np.asarray(2 * cohesion * np.cos(np.radians(self.friction.at(x, place))))

    def _between(self, corners: Floats, place: str) -> Pair:
        friction = self.friction
        low, high = friction.angles_between(corners, place)
        least, most = friction.extremes(corners, place)
        one = np.ones(corners.shape[:2])
        weak, strong = one * self.cohesion, one * self.cohesion
        if isinstance(self.cohesion, SpatialField):
            weak, strong = self.cohesion.between(corners, place)
        middle = high.mean(axis=1, keepdims=True)
        tangent = 1 / np.tan(middle) - (high - middle) / np.sin(middle) ** 2
        below = linear_product(weak, friction.divisor * tangent)[0]
        steady = weak / most[:, None]
        below = np.where((below > steady / 2).all(axis=1, keepdims=True), below, steady)
        above = linear_product(strong, friction.divisor / np.tan(low))[1]
        return 2 * _sine(least)[:, None] * below, 2 * _sine(most)[:, None] * above


def friction_of(angle: SpatialField) -> FrictionAngle:
    """Return a friction angle as a :class:`FrictionAngle`, whose tangent can be divided."""
    return angle if isinstance(angle, FrictionAngle) else FrictionAngle(angle)


def divided_friction(angle: SpatialField, factor: float) -> FrictionAngle:
    """Return a friction angle with its tangent divided by a factor.

    Args:
        angle: φ (degrees).
        factor: F > 0.
    """
    friction = friction_of(angle)
    return FrictionAngle(friction.angle, friction.divisor * factor)


def _sine(tangent: Floats) -> Floats:
    return np.asarray(tangent / np.sqrt(1 + tangent**2))


def _even(values: Floats, corners: Floats) -> Floats:
    """Return the value of each simplex, repeated for each of its vertices."""
    return np.repeat(values[:, None], corners.shape[1], axis=1)
