"""Define the cones of contact pairs, forces r ≥ 0 and slacks −[v] ≥ 0, in NumPy."""

from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import (
    NO_OWN,
    Borne,
    Columns,
    ConeKind,
    ConeRows,
    Members,
    Moduli,
    Rates,
    missing_of,
)


@dataclass(frozen=True, eq=False)
class Pairs:
    """The contact pairs of a rank; see :class:`cone.Block`.

    Attributes:
        springs: Stiffness of contact that suits the stiffness of the bodies, shape (num_pairs,).
    """

    springs: Floats

    @property
    def degree(self) -> int:
        """Return the number of pairs."""
        return len(self.springs)

    def start(self, borne: Borne) -> Members:
        """Write the initial forces √springs, and return forces and slacks with products 1."""
        root = np.sqrt(self.springs)
        borne.forces[:] = root
        return Members(root, 1 / root)

    def flow(self, moduli: Moduli) -> None:
        """Do nothing, because the caller adds the springs."""

    def static(self, borne: Borne, own: Floats) -> Floats:
        """Return the forces."""
        return borne.forces

    def rows(self, at: Columns) -> ConeRows:
        """See :meth:`cone.MatrixBlock.rows`."""
        count = len(at.forces)
        right, factors = np.zeros((count, 1)), np.ones((count, 1, 1))
        return ConeRows(ConeKind.NONNEGATIVE, right, at.forces[:, None], factors)

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """See :meth:`cone.MatrixBlock.from_rows`."""
        return Members(static[:, 0], kinematic[:, 0])

    def longest(self, a: Floats, da: Floats) -> float:
        """See :meth:`cone.Block.longest`."""
        return float((-a[da < 0] / da[da < 0]).min(initial=np.inf))

    def raised(self, products: Floats, by: float) -> Floats:
        """See :meth:`cone.Block.raised`."""
        return products + by

    def missing(self, products: Floats, mu: float) -> Floats:
        """See :meth:`cone.Block.missing`."""
        return missing_of(products, mu)

    def scaled(self, now: Members, rates: Rates) -> "ScaledPairs":
        """Return these pairs at an iterate, with forces r and slacks −[v]."""
        return ScaledPairs(now, rates)


class ScaledPairs:
    """Pairs at an iterate; see :class:`cone.ScaledBlock`."""

    def __init__(self, now: Members, rates: Rates) -> None:
        self._forces, self._rooms = now.static, now.kinematic
        self._springs = now.static / now.kinematic
        self._off = rates.jumps + now.kinematic

    def stiffen(self, moduli: Moduli) -> Moduli:
        """Return the moduli with springs r/(−[v])."""
        return replace(moduli, springs=self._springs)

    def products(self, change: Members | None = None) -> Floats:
        """Return r·(−[v]), or the product of the changes of both factors, without any scaling."""
        if change is None:
            return self._forces * self._rooms
        return change.static * change.kinematic

    def aim(self, products: Floats) -> Floats:
        """Return the products unchanged."""
        return products

    def bear(self, aim: Floats, change: Borne) -> None:
        """See :meth:`cone.ScaledBlock.bear`."""
        change.forces[:] = (aim + self._forces * self._off) / self._rooms

    def follow(self, aim: Floats, rates: Rates, change: Borne) -> Members:
        """See :meth:`cone.ScaledBlock.follow`."""
        rooms = -self._off - rates.jumps
        forces = (aim - self._forces * rooms) / self._rooms
        change.forces[:] = forces
        return Members(forces, rooms)

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """See :meth:`cone.ScaledBlock.resist`."""
        change.forces[:] = self._springs * rates.jumps
        return NO_OWN
