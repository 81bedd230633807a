"""Friction in limit analysis: places of slip are points beside those of the bodies.

A place with the area A and the force c that slip s has to overcome is a point with the volume A h,
the strain s/h and the yield radius c/A, h = A^(1/(gdim − 1)): its cone is ‖μ‖ ≤ c, an interval in
the plane, and what it dissipates is c‖s‖.
"""

from dataclasses import dataclass
from typing import Protocol

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, Moduli, Stiffness, Strains

Springs = tuple[Ints, Floats]
"""Unknowns of small groups, shape (n, k), −1 for none, and their moduli, shape (n, k, k)."""


class SpringStiffness(Stiffness, Protocol):
    """A stiffness that may have springs at a few unknowns."""

    def add_springs(self, springs: Springs) -> None:
        """Let K have springs, from the next assembly on."""
        ...


@dataclass(frozen=True, eq=False)
class SlipPlaces:
    """Places of slip on this rank, whose jumps are combinations of a few unknowns each.

    Attributes:
        index: Local (owned) unknowns, −1 for none, shape (num_places, k).
        shares: Of these in each component of the jump, shape (num_places, gdim − 1, k).
        area: What a place stands for (length, area), shape (num_places,).
        bound: Force c > 0 that slip has to overcome, shape (num_places,).
    """

    index: Ints
    shares: Floats
    area: Floats
    bound: Floats

    @classmethod
    def of(cls, friction: Friction) -> "SlipPlaces":
        """Those where a friction resists."""
        rubs = friction.bound > 0
        index = friction.index[rubs]
        if friction.shares is None:
            shares = np.tile(np.eye(index.shape[1]), (len(index), 1, 1))
        else:
            shares = friction.shares[rubs]
        return cls(index, shares, friction.area[rubs], friction.bound[rubs])

    def jumps(self, array: Floats) -> Floats:
        """Jumps of the entries of a local array, shape (num_places, gdim − 1)."""
        if not self.index.size:
            return np.zeros(self.shares.shape[:2])
        values = np.where(self.index >= 0, array[self.index], 0.0)
        return (self.shares @ values[:, :, None])[:, :, 0]

    def add(self, forces: Floats, array: Floats) -> None:
        """Add forces on the jumps to the entries of a local array, the transpose of that."""
        values = (forces[:, None] @ self.shares)[:, 0]
        there = self.index >= 0
        np.add.at(array, self.index[there], values[there])


class FrictionStrains:
    """ε(v) at points and s/h at places of friction; see :class:`discretisation.Strains`."""

    def __init__(self, points: Strains, places: SlipPlaces) -> None:
        self._points, self._places = points, places
        self.size, self.gdim = points.size, points.gdim
        area = places.area
        self.length = area ** (1 / (self.gdim - 1))
        self.count = points.count + len(area)
        self.weights = np.concatenate([points.weights, area * self.length])
        self.radii = np.concatenate([points.radii, places.bound / area])
        self.slopes = np.append(points.slopes, np.zeros(len(area)))
        self.tilts, self.principal = points.tilts, points.principal
        if points.tilts is not None:
            self.tilts = np.concatenate([points.tilts, np.zeros((len(area), self.size))])

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._points.destroy()

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator, shapes (count,) and (count, m). Collective."""
        trace, deviator = self._points.of(y)
        jumps = self._places.jumps(y.array_r) / self.length[:, None]
        more = np.zeros((len(jumps), self.size))
        more[:, : jumps.shape[1]] = jumps
        return np.append(trace, np.zeros(len(more))), np.concatenate([deviator, more])

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) + Σ μ·s for all v. Collective."""
        count = self._points.count
        self._points.forces(pressure[:count], deviator[:count], out)
        share = self.weights[count:] / self.length
        self._places.add(share[:, None] * deviator[count:, : self._size], out.array)

    def springs(self, a: Floats, normal: Floats) -> Springs:
        """Unknowns of the places, and what a I − N Nᵀ at their points is as springs."""
        count, size, shares = self._points.count, self._size, self._places.shares
        N = normal[count:, :size]
        moduli = a[count:, None, None] * np.eye(size) - np.einsum("ni,nj->nij", N, N)
        share = self.weights[count:] / self.length**2
        moduli = np.swapaxes(shares, 1, 2) @ moduli @ shares
        return self._places.index, share[:, None, None] * moduli

    @property
    def _size(self) -> int:
        """Components of a jump."""
        return int(self._places.shares.shape[1])


class FrictionStiffness:
    """K with friction; see :class:`discretisation.Stiffness`."""

    def __init__(self, bodies: SpringStiffness, strains: FrictionStrains, count: int) -> None:
        """Take K of the bodies over, whose points are ``count``."""
        self._bodies, self._strains, self._count = bodies, strains, count
        self.jump_diagonal, self.add_at_jumps = bodies.jump_diagonal, bodies.add_at_jumps
        self.factorise, self.solve = bodies.factorise, bodies.solve
        self.destroy = bodies.destroy

    @property
    def factorisations(self) -> int:
        """So far."""
        return self._bodies.factorisations

    @property
    def solves(self) -> int:
        """Systems solved so far."""
        return self._bodies.solves

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Bring K to moduli at all points. Collective."""
        self._bodies.add_springs(self._strains.springs(moduli.a, moduli.normal))
        self._bodies.assemble(moduli.first(self._count), held)
