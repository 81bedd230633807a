"""The unknowns of the interior point method, which change in each step."""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic import semidefinite_cones
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import longest_step


@dataclass(frozen=True)
class Unknowns:
    """Static and kinematic unknowns, or changes of them, on this rank, in the program's units.

    Attributes:
        load: λ.
        aside: Factor of the loads of any factor, 0 without them.
        pressure: p, in the coordinates of the cones, shape (count,).
        deviator: s, the same, shape (count, m).
        S: Rows (γ − αp, s + γt) of points with second-order cones (:mod:`standard_cones`).
        Z: Rows (d, −w dev ε(v)) of these, with d ≥ w‖dev ε(v)‖.
        t: Of points whose principal stresses are bounded (:mod:`principal_cones`), shape (num,).
        X: Their semidefinite matrices, shape (num, k, 3, 3).
        Y: The multipliers of these, the same.
        forces: r, shape (num_pairs,).
        rooms: −[v], shape (num_pairs,).
    """

    load: float
    aside: float
    pressure: Floats
    deviator: Floats
    S: Floats
    Z: Floats
    t: Floats
    X: Floats
    Y: Floats
    forces: Floats
    rooms: Floats

    def plus(self, t: float, change: "Unknowns") -> "Unknowns":
        """Return the unknowns after t times a change."""
        return Unknowns(*(a + t * b for a, b in zip(self._all(), change._all(), strict=True)))

    def products(self) -> float:
        """Σ s·z of all cones and pairs of this rank."""
        of_cones = np.einsum("ni,ni->", self.S, self.Z) + np.einsum("nkab,nkab->", self.X, self.Y)
        return float(of_cones + self.forces @ self.rooms)

    def longest(self, change: "Unknowns") -> float:
        """Longest step on this rank that keeps cones and pairs inside."""
        lengths = [longest_step(self.S, change.S), longest_step(self.Z, change.Z)]
        for matrices, by in ((self.X, change.X), (self.Y, change.Y)):
            lengths.append(semidefinite_cones.longest_step(matrices, by))
        for a, da in ((self.forces, change.forces), (self.rooms, change.rooms)):
            lengths.append(float((-a[da < 0] / da[da < 0]).min(initial=np.inf)))
        return min(lengths)

    def _all(self) -> tuple:
        return tuple(vars(self).values())
