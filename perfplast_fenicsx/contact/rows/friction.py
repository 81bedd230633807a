"""Friction on the rows of contact: jumps along the surface, and the force that slip overcomes.

In the jump basis the tangential jumps s of a row with friction are unknowns, beside the normal one.
Friction adds Σ c‖s − s₀‖ to the energy, with c a force; its forces μ are in the balls ‖μ‖ ≤ c. With
the jumps s₀ nothing has slipped: they are what supports and obstacles move by a given way, and what
has slipped in stages before.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints


@dataclass(frozen=True)
class Friction:
    """Where there is friction, and how much.

    Attributes:
        pair: Row of contact of each place with friction hosted here, shape (num_places,).
        index: Local (owned) unknowns of its jumps in the jump basis, −1 where supports leave it
            fewer directions than the surface has, shape (num_places, gdim − 1).
        direction: Unit vector of each jump, zero where there is none, shape (num_places,
            gdim − 1, gdim).
        area: What each place stands for of its surface (length, area), shape (num_places,).
        coulomb: Coefficient of friction where it is Coulomb's, 0 elsewhere, shape (num_places,).
        adhesion: Force that slip has to overcome without pressure, shape (num_places,).
        bound: Force c that slip has to overcome, shape (num_places,). Coulomb's follows from that
            of contact, and is brought up to date in place.
        origin: s₀ (length), shape of ``index``; brought up to date in place.
        count: Places on all ranks together.
        follows_pressure: Whether any friction is Coulomb's.
        shares: Where jumps are combinations of k unknowns each, ``index`` is of shape (num_places,
            k) and these are the coefficients, shape (num_places, gdim − 1, k); else None. Only the
            interior point method knows such.
    """

    pair: Ints
    index: Ints
    direction: Floats
    area: Floats
    coulomb: Floats
    adhesion: Floats
    bound: Floats
    origin: Floats
    count: int
    follows_pressure: bool
    shares: Floats | None = None

    def __repr__(self) -> str:
        return f"Friction({self.count} places)"

    def at(self, unknowns: Ints) -> "Friction":
        """Return the same with the local unknowns of rows in place of the numbers of rows."""
        return replace(self, index=np.append(unknowns, np.int32(-1))[self.index])

    def smooth(self) -> "Friction":
        """Return the same places without any resistance."""
        none = np.zeros_like(self.bound)
        return replace(self, coulomb=none, adhesion=none, bound=none, follows_pressure=False)

    def nowhere(self) -> "Friction":
        """Return the same without any place."""
        return Friction(
            pair=self.pair[:0],
            index=self.index[:0],
            direction=self.direction[:0],
            area=self.area[:0],
            coulomb=self.coulomb[:0],
            adhesion=self.adhesion[:0],
            bound=self.bound[:0],
            origin=self.origin[:0],
            count=0,
            follows_pressure=False,
        )

    def jumps(self, y: PETSc.Vec) -> Floats:
        """Entries of a vector of the jump basis at the tangential jumps, shape of ``index``."""
        return self.gather(y.array_r)

    def slip(self, y: PETSc.Vec) -> Floats:
        """Slip s − s₀ (length) of a displacement in the jump basis, shape of ``index``."""
        return self.jumps(y) - self.origin

    def gather(self, array: Floats) -> Floats:
        """Entries of a local array at the jumps, 0 where there is none, shape of ``index``."""
        if not self.index.size:
            return np.zeros(self.index.shape)
        return np.where(self.index >= 0, array[self.index], 0.0)

    def add(self, values: Floats, array: Floats) -> None:
        """Add values, of the shape of ``index``, to the entries of a local array."""
        there = self.index >= 0
        array[self.index[there]] += values[there]

    def unknowns(self, where: npt.NDArray[np.bool_]) -> Ints:
        """Local unknowns of the jumps at these places."""
        some = self.index[where]
        return some[some >= 0]

    def energy(self, slip: Floats) -> float:
        """Σ c‖slip‖ of this rank, which it dissipates; where c is infinite nothing slips."""
        sizes = norms(slip)
        slips = (sizes > 0) & np.isfinite(self.bound)
        return float(self.bound[slips] @ sizes[slips])

    def slope(self, slip: Floats, change: Floats, beta: float) -> float:
        """Derivative of the energy of this rank along a change, at ``slip`` + β ``change``.

        At a kink it is that from the left, or from the right at β = 0.
        """
        moves = (norms(change) > 0) & np.isfinite(self.bound)
        d, at = change[moves], slip[moves] + beta * change[moves]
        sizes, lengths = norms(at), norms(d)
        rounding = 1e-12  # a jump below this share of its change is at the kink of ‖s‖
        kink = sizes <= rounding * lengths
        along = np.einsum("ni,ni->n", at, d) / np.where(kink, 1.0, sizes)
        along = np.where(kink, lengths if beta == 0 else -lengths, along)
        return float(self.bound[moves] @ along)

    def last_turn(self, slip: Floats, change: Floats, comm: MPI.Intracomm) -> float:
        """Return the largest β ≥ 1 at which a place stops moving back on a change. Collective.

        There its ``slip`` + β ``change`` is shortest; 1 where none moves back so far.
        """
        moves = (norms(change) > 0) & (self.bound > 0)
        d = change[moves]
        beta = -np.einsum("ni,ni->n", slip[moves], d) / norms(d) ** 2
        return float(comm.allreduce(float(beta.max(initial=1.0)), MPI.MAX))


def norms(vectors: Floats) -> Floats:
    """Return the length of each row."""
    lengths: Floats = np.sqrt(np.einsum("ni,ni->n", vectors, vectors))
    return lengths


def shrunk(vectors: Floats, bound: Floats) -> Floats:
    """Return the nearest vectors that are not longer than their bounds.

    Args:
        vectors: Shape (n, k).
        bound: Shape (n,).
    """
    sizes = norms(vectors)
    share = np.divide(bound, sizes, out=np.ones_like(sizes), where=sizes > bound)
    return share[:, None] * vectors
