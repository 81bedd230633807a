"""Sets of principal stresses, (1 + s)σ₁ − (1 − s)σ₃ ≤ b: Mohr–Coulomb, and Tresca of s = 0.

With the mean stress p and the deviator d such a set is the shadow of one in (p, d, t) that two
semidefinite matrices bound,

    t I − (1 + s) d ⪰ 0,    (1 − s) d + (b − t − 2sp) I ⪰ 0,

since the one says t ≥ (1 + s)d₁ and the other t ≤ b − 2sp + (1 − s)d₃ (K. Krabbenhøft, A. V.
Lyamin, S. W. Sloan, Int. J. Solids Struct. 45 (2008), 6552). Strain rates are admissible where
tr ε ≥ s Σ|ε_i|, and dissipate (b/2s) tr ε; of s = 0 where tr ε = 0, and then (b/2) Σ|ε_i|.
NumPy only.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import eigenvalues


@dataclass(frozen=True, eq=False)
class PrincipalCones:
    """The points of a rank with such sets, in the coordinates (p, s) of :mod:`standard_cones`.

    Attributes:
        at: Their numbers, shape (num,).
        bounds: b > 0 (stress), shape (num,).
        sines: s in [0, 1), shape (num,).
        tensors: Unit tensor and orthonormal deviators that p and the first k of s are factors of,
            shape (1 + k, 3, 3); others are of other sets.
    """

    at: Longs
    bounds: Floats
    sines: Floats
    tensors: Floats

    @classmethod
    def none(cls) -> "PrincipalCones":
        """Of no point."""
        nothing: Floats = np.zeros(0)
        return cls(np.zeros(0, dtype=np.int64), nothing, nothing, np.zeros((1, 3, 3)))

    @property
    def count(self) -> int:
        """Points."""
        return len(self.at)

    def those(self, chosen: npt.NDArray[np.bool_]) -> "PrincipalCones":
        """Some of the points.

        Args:
            chosen: Which, shape (num,).
        """
        return replace(
            self, at=self.at[chosen], bounds=self.bounds[chosen], sines=self.sines[chosen]
        )

    def divided(self, unit: float) -> "PrincipalCones":
        """The same with stresses measured in a unit."""
        return replace(self, bounds=np.asarray(self.bounds / unit, dtype=np.float64))

    def put(self, values: Floats, of_these: Floats) -> Floats:
        """Values at all points with those of these points in their places."""
        values[self.at] = of_these
        return values

    def ratios(self, pressure: Floats, deviator: Floats) -> Floats:
        """By how much stresses exceed yield, shape (num,); negative where no multiple does.

        Args:
            pressure: p at all points, shape (count,).
            deviator: s at all points, shape (count, m).
        """
        d = eigenvalues(self.deviators(deviator))
        along = (1 + self.sines) * d[:, 2] - (1 - self.sines) * d[:, 0]
        found: Floats = (along + 2 * self.sines * pressure[self.at]) / self.bounds
        return found

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """What admissible rates dissipate per volume, shape (num,).

        Args:
            trace: tr ε at all points, shape (count,).
            deviator: The deviator of ε there, shape (count, m).
        """
        safe = np.where(self.sines > 0, self.sines, 1.0)
        sizes = self.sizes(trace, deviator)
        found: Floats = self.bounds / 2 * np.where(self.sines > 0, trace[self.at] / safe, sizes)
        return found

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """What tr ε lacks of s Σ|ε_i|, shape (num,); see :meth:`powers`."""
        found: Floats = np.maximum(self.sines * self.sizes(trace, deviator) - trace[self.at], 0.0)
        return found

    def sizes(self, trace: Floats, deviator: Floats) -> Floats:
        """Σ|ε_i|, without the trace where s = 0, shape (num,); see :meth:`powers`."""
        means = np.where(self.sines > 0, trace[self.at] / 3, 0.0)
        values = eigenvalues(self.deviators(deviator)) + means[:, None]
        found: Floats = np.abs(values).sum(axis=1)
        return found

    def components(self, deviator: Floats) -> Floats:
        """Those of s that count, shape (num, k), of s at all points."""
        found: Floats = deviator[self.at, : len(self.tensors) - 1]
        return found

    def deviators(self, deviator: Floats) -> Floats:
        """Tensors of s at all points, shape (num, 3, 3)."""
        found: Floats = np.einsum("nj,jab->nab", self.components(deviator), self.tensors[1:])
        return found
