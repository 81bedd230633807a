"""Transform stresses and strain rates to the coordinates of the points' cones.

See :mod:`standard_cones`.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones


class StressFrames:
    """The relation x = F (p, s) at points, grouped by cones.

    Attributes:
        size: Number of components of s; missing components of a cone are zero.
    """

    def __init__(self, cones: BodyCones, of_points: Longs, size: int | None = None) -> None:
        """Group the points by their cones.

        Args:
            cones: Cones of the bodies.
            of_points: Index of the cone of each point.
            size: Number of components of s; by default the largest of all cones.
        """
        frames = [cone.standard.frame for cone in cones.cones]
        self.size = max(F.shape[1] - 1 for F in frames) if size is None else size
        self.frames = [np.pad(F, ((0, 0), (0, self.size + 1 - F.shape[1]))) for F in frames]
        self._cones, self._count = cones, len(of_points)
        self.groups = [np.flatnonzero(of_points == i) for i in range(len(frames))]

    def rates(self, e: Floats) -> tuple[Floats, Floats]:
        """Return ε' of strain rates, shapes (count,) and (count, size).

        Args:
            e: Components in equations, shape (count, n).
        """
        found = np.zeros((self._count, self.size + 1))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = e[here] @ F
        return found[:, 0].copy(), found[:, 1:].copy(order="F")

    def stresses(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the components in equations, shape (count, n)."""
        both = np.column_stack([pressure, deviator])
        found = np.zeros((self._count, len(self.frames[0])))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = both[here] @ F.T
        return found

    def whole(self, stress: Floats) -> Floats:
        """Return Mandel vectors of stresses from :meth:`stresses`, shape (count, m)."""
        found = np.zeros((self._count, 4 if stress.shape[1] == 3 else stress.shape[1]))
        for here, cone in zip(self.groups, self._cones.cones, strict=True):
            found[here] = cone.whole(stress[here])
        return found
