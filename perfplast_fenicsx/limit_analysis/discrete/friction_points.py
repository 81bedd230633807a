"""Treat friction in limit analysis as further points, one point for each place that can slip.

A place has the area A and a friction force c that resists the slip s. The place is a point with the
volume A h, the strain rate s/h and the yield radius c/A, where h = A^(1/(gdim − 1)). Its yield set
is ‖μ‖ ≤ c, an interval in 2D, and the place dissipates c‖s‖.

A place may also open by w along its normal, and pressure may increase its resistance. For such a
place, w/h is the trace of the strain rate, and the yield set is ‖μ‖ ≤ c − αp with the slope α,
where p < 0 is compression.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

from petsc4py import PETSc

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, Stiffness, Strains

Springs = tuple[Ints, Floats]
"""Unknowns of n small groups, shape (n, k), −1 for missing unknowns, and stiffness matrices, shape
(n, k, k)."""


class SpringStiffness(Stiffness, Protocol):
    """A stiffness that can contain springs at a few unknowns."""

    def add_springs(self, springs: Springs) -> None:
        """Set springs that each later assembly adds to K."""
        ...


@dataclass(frozen=True, eq=False)
class SlipPlaces:
    """Places of this rank that can slip; each jump is a linear combination of a few unknowns.

    Attributes:
        index: Indices of owned unknowns, −1 for missing unknowns, shape (num_places, k).
        shares: Coefficients of the unknowns in each component of the jump, shape (num_places, gdim
            − 1, k).
        area: Area of each place (a length in 2D), shape (num_places,).
        bound: Friction force c, shape (num_places,); 0 where α > 0.
        closing: Index of the owned unknown that equals −w, shape (num_places,); −1 if the place
            cannot open.
        slope: Slope α, shape (num_places,).
    """

    index: Ints
    shares: Floats
    area: Floats
    bound: Floats
    closing: Ints
    slope: Floats

    @classmethod
    def of(cls, friction: Friction) -> "SlipPlaces":
        """Return the places at which friction resists slip."""
        rubs = friction.bound > 0
        index = friction.index[rubs]
        if friction.shares is None:
            shares = np.tile(np.eye(index.shape[1]), (len(index), 1, 1))
        else:
            shares = friction.shares[rubs]
        return cls.that_slip(index, shares, friction.area[rubs], friction.bound[rubs])

    @classmethod
    def that_slip(cls, index: Ints, shares: Floats, area: Floats, bound: Floats) -> "SlipPlaces":
        """Return places that cannot open, with a friction force independent of pressure.

        See the attributes of the class for the arguments.
        """
        return cls(index, shares, area, bound, np.full(len(area), -1), np.zeros(len(area)))

    def and_those(self, others: "SlipPlaces") -> "SlipPlaces":
        """Return these places, followed by other places whose jumps have as many unknowns."""
        names = (it.name for it in fields(self))
        both = (np.concatenate([getattr(self, it), getattr(others, it)]) for it in names)
        return SlipPlaces(*both)

    def shared_out(self, pressure: Floats, slips: Floats) -> Floats:
        """Return shear stresses that use friction under pressure first, and adhesion for the rest.

        Args:
            pressure: Normal stress p at the places, shape (num_places,), negative in compression.
            slips: Shear stresses at the places, shape (num_places, gdim − 1).

        Returns:
            Shear stresses with the same sums at each node, of the same shape.
        """
        pressed = np.flatnonzero(self.slope > 0)
        adheres = np.flatnonzero(self.slope == 0)
        _, first, second = np.intersect1d(
            self.index[adheres, 0], self.index[pressed, 0], return_indices=True
        )
        rest, one = adheres[first], pressed[second]
        both: Floats = slips[one] + slips[rest]
        sizes = np.linalg.norm(both, axis=1)
        most = np.maximum(-self.slope[one] * pressure[one], 0.0)
        borne = np.divide(most, sizes, out=np.ones_like(sizes), where=sizes > most)
        found = slips.copy()
        found[one] = borne[:, None] * both
        found[rest] = both - found[one]
        return found

    @cached_property
    def unknowns(self) -> Ints:
        """Return the unknowns of w and of the jump, −1 if missing, shape (num_places, 1 + k)."""
        return np.column_stack([self.closing, self.index]).astype(np.int32)

    @cached_property
    def rows(self) -> Floats:
        """Return matrices that map ``unknowns`` to (w, jump), shape (num_places, gdim, 1 + k)."""
        count, size, k = self.shares.shape
        found: Floats = np.zeros((count, 1 + size, 1 + k))
        found[:, 0, 0] = np.where(self.closing >= 0, -1.0, 0.0)
        found[:, 1:, 1:] = self.shares
        return found

    def jumps(self, array: Floats) -> Floats:
        """Return w and the jumps from a local array of unknowns, shape (num_places, gdim)."""
        if not self.index.size:
            return np.zeros((len(self.area), 1 + self.shares.shape[1]))
        values = np.where(self.unknowns >= 0, array[self.unknowns], 0.0)
        return (self.rows @ values[:, :, None])[:, :, 0]

    def add(self, forces: Floats, array: Floats) -> None:
        """Add the forces conjugate to w and the jumps to a local array of unknowns.

        This is the transpose of :meth:`jumps`.
        """
        values = (forces[:, None] @ self.rows)[:, 0]
        there = self.unknowns >= 0
        np.add.at(array, self.unknowns[there], values[there])


class FrictionStrains:
    """Rates ε(v) at points, w/h and s/h at places; see :class:`discretisation.Strains`."""

    def __init__(self, points: Strains, places: SlipPlaces) -> None:
        self._points, self._places = points, places
        self.size, self.gdim = points.size, points.gdim
        area = places.area
        self.length = area ** (1 / (self.gdim - 1))
        self.count = points.count + len(area)
        self.weights = np.concatenate([points.weights, area * self.length])
        self.radii = np.concatenate([points.radii, places.bound / area])
        self.slopes = np.append(points.slopes, places.slope)
        self.tilts, self.sets = points.tilts, points.sets
        if points.tilts is not None:
            self.tilts = np.concatenate([points.tilts, np.zeros((len(area), self.size))])

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._points.destroy()

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Return the trace and the deviator, shapes (count,) and (count, m). Collective."""
        trace, deviator = self._points.of(y)
        opens, *jumps = (self._places.jumps(y.array_r) / self.length[:, None]).T
        more = np.zeros((len(opens), self.size), order="F")
        more[:, : len(jumps)] = np.transpose(jumps)
        return np.append(trace, opens), np.concatenate([deviator, more])

    def matrix(self) -> sparse.csr_array:
        """See :meth:`discretisation.Strains.matrix`."""
        of_points, places = self._points.matrix(), self._places
        rows = places.rows / self.length[:, None, None]
        to = np.arange(len(rows) * (1 + self.size)).reshape(-1, 1 + self.size)
        both = np.broadcast_arrays(to[:, : rows.shape[1], None], places.unknowns[:, None])
        there = both[1] >= 0
        at_places = (rows[there], tuple(it[there] for it in both))
        of_places = sparse.csr_array(at_places, shape=(to.size, of_points.shape[1]))
        return sparse.vstack([of_points, of_places], format="csr")

    def deviators(self, deviator: Floats) -> Floats:
        """See :meth:`discretisation.Strains.deviators`."""
        count = self._points.count
        return np.concatenate([self._points.deviators(deviator[:count]), deviator[count:]])

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) + Σ A (p w + τ·s) for all v. Collective.

        At the places, p is the normal stress and τ, the deviator, is the shear stress.
        """
        count = self._points.count
        self._points.forces(pressure[:count], deviator[:count], out)
        share = self.weights[count:] / self.length
        slips = deviator[count:, : self._places.shares.shape[1]]
        stress = np.column_stack([pressure[count:], slips])
        self._places.add(share[:, None] * stress, out.array)

    def springs(self, moduli: Moduli) -> Springs:
        """Return the unknowns of friction points, and springs from the moduli of these points."""
        of_places, rows = moduli.beyond(self._points.count).matrices(), self._places.rows
        of_places = of_places[:, : rows.shape[1], : rows.shape[1]]
        share = self.weights[self._points.count :] / self.length**2
        springs = np.swapaxes(rows, 1, 2) @ of_places @ rows
        return self._places.unknowns, share[:, None, None] * springs


class FrictionStiffness:
    """Stiffness K with friction; see :class:`discretisation.Stiffness`."""

    def __init__(self, bodies: SpringStiffness, strains: FrictionStrains, count: int) -> None:
        """Take ownership of the K of bodies, which have ``count`` points."""
        self._bodies, self._strains, self._count = bodies, strains, count
        self.jump_diagonal, self.add_at_jumps = bodies.jump_diagonal, bodies.add_at_jumps
        self.factorise, self.solve = bodies.factorise, bodies.solve
        self.destroy, self.counts = bodies.destroy, bodies.counts

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at all points. Collective."""
        self._bodies.add_springs(self._strains.springs(moduli))
        self._bodies.assemble(moduli.first(self._count), held)
