"""Stresses and strain rates of points in the coordinates of their cones (:mod:`standard_cones`)."""

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones


class StressFrames:
    """x = F (p, s) at points, those of each cone together.

    Attributes:
        size: Components of s; those that a cone does not have are zero.
    """

    def __init__(self, cones: BodyCones, of_points: Longs, size: int | None = None) -> None:
        """Sort the points.

        Args:
            cones: Cones of the bodies.
            of_points: Number of the cone of each point.
            size: Components of s; by default the most of any cone.
        """
        frames = [cone.standard.frame for cone in cones.cones]
        self.size = max(F.shape[1] - 1 for F in frames) if size is None else size
        self.frames = [np.pad(F, ((0, 0), (0, self.size + 1 - F.shape[1]))) for F in frames]
        self._cones, self._count = cones, len(of_points)
        self.groups = [np.flatnonzero(of_points == i) for i in range(len(frames))]

    def rates(self, e: Floats) -> tuple[Floats, Floats]:
        """ε' of strain rates, shapes (count,) and (count, size).

        Args:
            e: Components in equations, shape (count, n).
        """
        found = np.zeros((self._count, self.size + 1))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = e[here] @ F
        return found[:, 0].copy(), found[:, 1:].copy(order="F")

    def stresses(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return components in equations, shape (count, n)."""
        both = np.column_stack([pressure, deviator])
        found = np.zeros((self._count, len(self.frames[0])))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = both[here] @ F.T
        return found

    def whole(self, stress: Floats) -> Floats:
        """Mandel vectors of :meth:`stresses`, shape (count, m)."""
        found = np.zeros((self._count, 4 if stress.shape[1] == 3 else stress.shape[1]))
        for here, cone in zip(self.groups, self._cones.cones, strict=True):
            found[here] = cone.whole(stress[here])
        return found
