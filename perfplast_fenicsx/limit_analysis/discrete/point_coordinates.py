"""Provide coordinates of stresses and strain rates at a problem's points, and their cones.

If all cones are about the hydrostatic axis, the coordinates are trace and deviator of Mandel
vectors. In plane strain these are in-plane vectors, kept with four components. Otherwise each point
has the coordinates of its cone.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.conic.cone import PointSets
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import (
    profiles_at_points,
    steepness_at_points,
)
from perfplast_fenicsx.limit_analysis.discrete.stress_frames import StressFrames
from perfplast_fenicsx.problem.problem import Problem


class PointCoordinates:
    """Coordinates (p, s) of stresses, and the conjugate rates; see :mod:`standard_cones`.

    Attributes:
        numbers: Index of the cone of each point of this rank, shape (count,).
        radii: Yield radius γ (stress) of the points of this rank, ∞ in elastic bodies, shape
            (count,).
        profile: Factor by which γ varies in space, shape (count,); None if no strength varies.
        slopes: Slope α, shape (count,).
        tilts: Tilt t, shape (count, m); None where all are zero.
        sets: Sets of the points without a second-order cone.
        isotropic: Whether the coordinates are trace and deviator at all points.
        dilates: Whether any cone has a slope.
        normal: Number of normal stresses in equations, two in plane strain.
        among: Indices of the Mandel components in equations.
        frames: Frames of the cones.
    """

    def __init__(self, problem: Problem, cones: BodyCones | None = None) -> None:
        """Read the cones of the laws. Collective.

        Args:
            problem: The bodies and the points.
            cones: Cones of the bodies; by default those of the stress components in equations.

        Raises:
            InputError: If the method does not support a body's yield set.
        """
        self._cones = cones = body_cones(problem) if cones is None else cones
        self.isotropic, self.dilates, self.normal = cones.isotropic, cones.dilates, cones.normal
        self._size = problem.S.dofmap.index_map_bs
        self.among = [0, 1, 3] if cones.normal == 2 else list(range(self._size))
        points = problem.Q.dofmap.list[: len(cones.of_cells)]
        self.numbers: Longs = np.zeros(problem.Q.dofmap.index_map.size_local, dtype=np.int64)
        self.numbers[points] = cones.of_cells[:, None]
        numbers = self.numbers
        forms = [cone.standard for cone in cones.cones]
        self.radii: Floats = np.array([form.radius for form in forms])[numbers]
        self.slopes: Floats = np.array([form.slope for form in forms])[numbers]
        tilts = np.array([np.pad(it.tilt, (0, self._size - len(it.tilt))) for it in forms])
        self.tilts: Floats | None = tilts[numbers] if tilts.any() else None
        steepness = steepness_at_points(problem, numbers)
        if steepness is not None:
            self.slopes = self.slopes * steepness
        self.profile = profiles_at_points(problem, numbers)
        if self.profile is not None:
            self.radii = self.radii * self.profile
        self.sets = cones.sets_at(numbers, self.profile)
        self.frames = StressFrames(cones, numbers, self._size)

    def sets_of(self, copies: int) -> tuple[PointSets, ...]:
        """Return the sets of the points, repeated ``copies`` times one after the other."""
        profile = None if self.profile is None else np.tile(self.profile, copies)
        return self._cones.sets_at(np.tile(self.numbers, copies), profile)

    def rates(self, e: Floats) -> tuple[Floats, Floats]:
        """Return ε' of strain rates, shapes (count,) and (count, m)."""
        if not self.isotropic:
            return self.frames.rates(e[:, self.among])
        sums = e[:, :3].sum(axis=1)
        e[:, : self.normal] -= sums[:, None] / self.normal
        return sums, e

    def working(self, pressure: Floats, deviator: Floats, out: Floats) -> None:
        """Set ``out``, shape (count, m), to Mandel vectors that do the work of σ on strain rates.

        Out-of-plane components that do no work are zero.
        """
        if self.isotropic:
            out[:] = deviator
            out[:, :3] += pressure[:, None]
        else:
            out[:] = 0.0
            out[:, self.among] = self.frames.stresses(pressure, deviator)

    def whole(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return σ as Mandel vectors, shape (count, m).

        The out-of-plane stress takes its most favourable value.
        """
        stress = np.empty((len(pressure), self._size))
        self.working(pressure, deviator, stress)
        return self.frames.whole(stress[:, self.among])
