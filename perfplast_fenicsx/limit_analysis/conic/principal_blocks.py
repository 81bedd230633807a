"""The matrices of a point whose principal stresses are bounded, and what they are linear in.

They are two, or three where any of a rank's points has a tensile strength: the third one of a point
without is a constant.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.principal_cones import PrincipalCones
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import (
    SIZE,
    least_eigenvalue,
)
from perfplast_fenicsx.mandel_arrays import vectors

MOST_VISCOUS = 1e4
"""Cap on the initial viscosity of strong bodies, beside those that bear the loads, for the
conditioning of the first K."""


class Blocks:
    """The coefficients of members: what X_k is of t, p and the deviator.

    Attributes:
        cones: Cones of the points.
        pressures: In the middle of the sets (stress), shape (num,).
    """

    def __init__(self, cones: PrincipalCones) -> None:
        """Write them down."""
        self.cones = cones
        s, one, none = cones.sines, np.ones(cones.count), np.zeros(cones.count)
        cut = np.where(cones.cut, one, none)
        half = cones.bounds / 2
        self.pressures: Floats = -half * cut
        middle = half * (1 + s * cut)
        columns = [(one, none, -(1 + s), none, middle), (-one, -2 * s, 1 - s, 2 * half, middle)]
        if cut.any():
            strengths = np.where(cones.cut, cones.tensions, half)
            columns.append((none, -cut, -cut, strengths, strengths - self.pressures))
        parts = (np.stack(of, axis=1) for of in zip(*columns, strict=True))
        self._of_t, self._of_p, self._of_d, self._constant, self._rooms = parts

    @property
    def degree(self) -> int:
        """Rows of all matrices."""
        return SIZE * self._of_t.size

    def members(self, t: Floats, pressure: Floats, deviator: Floats) -> Floats:
        """X, shape (num, k, 3, 3).

        Args:
            t: Shape (num,).
            pressure: At all points.
            deviator: As ``pressure``.
        """
        found = self.changes(t, pressure, deviator)
        found += self._constant[:, :, None, None] * np.eye(SIZE)
        return found

    def changes(self, t: Floats, pressure: Floats, deviator: Floats) -> Floats:
        """Return those of X with changes of the arguments of :meth:`members`."""
        cones = self.cones
        heads = self._of_t * t[:, None] + self._of_p * pressure[cones.at, None]
        tensors = cones.deviators(deviator)
        found: Floats = heads[:, :, None, None] * np.eye(SIZE)
        found += self._of_d[:, :, None, None] * tensors[:, None]
        return found

    @property
    def _viscosities(self) -> Floats:
        """Return the squares of the factors of unit tensors P in the middle, shape (num, k)."""
        found: Floats = np.minimum(self._rooms**2, MOST_VISCOUS)
        return found

    def moduli(self, loose: float) -> tuple[Floats, Floats]:
        """κ and a at the start, where matrices are scaled by multiples of the unit tensor.

        Args:
            loose: κ where nothing bounds the mean stress.

        Returns:
            Shapes (num,).
        """
        grows, squares = self.cones.grows, self._viscosities
        # with the t that makes the first two the same
        of_p = self._of_p.copy()
        of_p[:, :2] = self._of_p[:, :2].mean(axis=1, keepdims=True)
        soft = SIZE * (of_p**2 / squares).sum(axis=1)
        bulk = np.where(grows, 1 / np.where(grows, soft, 1.0), loose)
        return bulk, 1 / (self._of_d**2 / squares).sum(axis=1)

    def start(self) -> tuple[Floats, Floats, Floats]:
        """T, X and Z in the middle of the sets, without a deviator."""
        apart = self._rooms / self._viscosities
        X, Z = (of[:, :, None, None] * np.eye(SIZE) for of in (self._rooms, apart))
        return self._rooms[:, 0].copy(), X, Z

    def middle(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the t that leaves both members as much room, shape (num,)."""
        X = self.members(np.zeros(self.cones.count), pressure, deviator)
        least = least_eigenvalue(X)
        found: Floats = (least[:, 1] - least[:, 0]) / 2
        return found

    def columns(self, primal: Floats) -> Floats:
        """Return the columns of members in (t, p, s), as vectors.

        Args:
            primal: Unit tensor and deviators as each member scales them, shape (num, k, 1 + m, 3,
                3).

        Returns:
            Shape (num, 6k, 2 + m).
        """
        numbers = vectors(primal)
        of_t, of_p = (
            coefficient[:, :, None, None] * numbers[:, :, :1]
            for coefficient in (self._of_t, self._of_p)
        )
        of_d = self._of_d[:, :, None, None] * numbers[:, :, 1:]
        found = np.concatenate([of_t, of_p, of_d], axis=2)
        return np.swapaxes(found, 2, 3).reshape(len(found), -1, found.shape[2])

    def works(self, Z: Floats) -> Floats:
        """Gᵀz, shape (num, 2 + m)."""
        traces = np.trace(Z, axis1=2, axis2=3)
        deviators = np.einsum("nkab,jab->nkj", Z, self.cones.tensors[1:])
        return np.column_stack(
            [
                (self._of_t * traces).sum(axis=1),
                (self._of_p * traces).sum(axis=1),
                np.einsum("nk,nkj->nj", self._of_d, deviators),
            ]
        )

    def least(self, works: Floats) -> Floats:
        """Return the smallest z of given :meth:`works`, that of p being left out where none is."""
        grows = self.cones.grows
        grid = np.empty((len(works), 2, 2))
        both = np.stack([self._of_t, self._of_p], axis=1)
        grid[:] = SIZE * both @ np.swapaxes(both, 1, 2)
        grid[~grows, 1, 1] = 1.0
        right = np.where(np.column_stack([grows | True, grows]), works[:, :2], 0.0)
        heads = (np.linalg.solve(grid, right[:, :, None])[:, :, 0][:, None] @ both)[:, 0]
        tails = works[:, 2:] / (self._of_d**2).sum(axis=1)[:, None]
        tensors = np.einsum("nj,jab->nab", tails, self.cones.tensors[1:])
        found: Floats = heads[:, :, None, None] * np.eye(SIZE)
        return found + self._of_d[:, :, None, None] * tensors[:, None]
