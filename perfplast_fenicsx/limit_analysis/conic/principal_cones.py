"""Sets of principal stresses, (1 + s)σ₁ − (1 − s)σ₃ ≤ b: Mohr–Coulomb, and Tresca of s = 0.

Or that and a tensile strength, σ₁ ≤ f.

With the mean stress p and the deviator d such a set is the shadow of one in (p, d, t) that two
semidefinite matrices bound,

    t I − (1 + s) d ⪰ 0,    (1 − s) d + (b − t − 2sp) I ⪰ 0,

since the one says t ≥ (1 + s)d₁ and the other t ≤ b − 2sp + (1 − s)d₃ (K. Krabbenhøft, A. V.
Lyamin, S. W. Sloan, Int. J. Solids Struct. 45 (2008), 6552). Strain rates are admissible where
tr ε ≥ s Σ|ε_i|, and dissipate (b/2s) tr ε; of s = 0 where tr ε = 0, and then (b/2) Σ|ε_i|.

With f < b/2s there is a third matrix, f I − pI − d ⪰ 0. The set then ends at three vertices with
σ₁ = f, and σ₂ and σ₃ each f or r = ((1 + s)f − b)/(1 − s). It holds no other stress without end
where s > 0, and pressure alone where s = 0: so the same rates are admissible, of s = 0 those with
tr ε ≥ 0, and dissipate (f − h) tr ε + h Σ|ε_i|, h = (f − r)/2. NumPy only.
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
        tensions: f > 0 (stress), ∞ where nothing else bounds σ₁, shape (num,).
        tensors: Unit tensor and orthonormal deviators that p and the first k of s are factors of,
            shape (1 + k, 3, 3); others are of other sets.
        flat: Whether no rate is out of the plane, and the stress there the mean of those in it.
    """

    at: Longs
    bounds: Floats
    sines: Floats
    tensions: Floats
    tensors: Floats
    flat: bool = False

    @classmethod
    def none(cls) -> "PrincipalCones":
        """Return cones for no point."""
        nothing: Floats = np.zeros(0)
        return cls(np.zeros(0, dtype=np.int64), nothing, nothing, nothing, np.zeros((1, 3, 3)))

    @property
    def count(self) -> int:
        """Points."""
        return len(self.at)

    @property
    def cut(self) -> npt.NDArray[np.bool_]:
        """Which have a tensile strength, shape (num,)."""
        return np.isfinite(self.tensions)

    @property
    def grows(self) -> npt.NDArray[np.bool_]:
        """Where the mean stress is bounded, so that bodies dilate, shape (num,)."""
        return (self.sines > 0) | self.cut

    def those(self, chosen: npt.NDArray[np.bool_] | Longs) -> "PrincipalCones":
        """Return some of the points.

        Args:
            chosen: Which, flags of shape (num,) or places among them.
        """
        numbers = {name: getattr(self, name)[chosen] for name in ("bounds", "sines", "tensions")}
        return replace(self, at=self.at[chosen], **numbers)

    def divided(self, unit: float) -> "PrincipalCones":
        """Return the same with stresses measured in a unit."""
        bounds, tensions = (np.asarray(of / unit) for of in (self.bounds, self.tensions))
        return replace(self, bounds=bounds, tensions=tensions)

    def scaled(self, factors: Floats) -> "PrincipalCones":
        """Return the same with bounds b multiplied by factors at all points, shape (count,)."""
        return replace(self, bounds=self.bounds * factors[self.at])

    def put(self, values: Floats, of_these: Floats) -> Floats:
        """Return values at all points with those of these points in their places."""
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
        pulled = (pressure[self.at] + d[:, 2]) / self.tensions  # 0 without a strength
        return np.where(self.cut, np.maximum(found, pulled), found)

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the dissipation of admissible rates per volume, shape (num,).

        Args:
            trace: tr ε at all points, shape (count,).
            deviator: The deviator of ε there, shape (count, m).
        """
        of_trace, of_sizes = self.factors
        found: Floats = of_trace * trace[self.at] + of_sizes * self.sizes(trace, deviator)
        return found

    @property
    def factors(self) -> tuple[Floats, Floats]:
        """Return the factors of tr ε and Σ|ε_i| for :meth:`powers`, shape (num,)."""
        steep, cut = self.sines > 0, self.cut
        of_trace = np.where(steep, self.bounds / np.where(steep, 2 * self.sines, 1.0), 0.0)
        of_sizes = np.where(steep, 0.0, self.bounds / 2)
        tensions = self.tensions[cut]
        half = (self.bounds[cut] / 2 - self.sines[cut] * tensions) / (1 - self.sines[cut])
        of_trace[cut], of_sizes[cut] = tensions - half, half
        return of_trace, of_sizes

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the shortfall of tr ε from s Σ|ε_i|, shape (num,); see :meth:`powers`."""
        found: Floats = np.maximum(self.sines * self.sizes(trace, deviator) - trace[self.at], 0.0)
        return found

    def sizes(self, trace: Floats, deviator: Floats) -> Floats:
        """Σ|ε_i|, without the trace where nothing bounds p, shape (num,); see :meth:`powers`."""
        unit = np.diag([1.0, 1.0, 0.0 if self.flat else 1.0])
        means = np.where(self.grows, trace[self.at], 0.0) / np.trace(unit)
        values = eigenvalues(self.deviators(deviator) + means[:, None, None] * unit)
        found: Floats = np.abs(values).sum(axis=1)
        return found

    def components(self, deviator: Floats) -> Floats:
        """Return those of s that count, shape (num, k), of s at all points."""
        found: Floats = deviator[self.at, : len(self.tensors) - 1]
        return found

    def deviators(self, deviator: Floats) -> Floats:
        """Return tensors of s at all points, shape (num, 3, 3)."""
        found: Floats = np.einsum("nj,jab->nab", self.components(deviator), self.tensors[1:])
        return found
