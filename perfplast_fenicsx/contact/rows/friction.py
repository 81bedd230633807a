"""Define friction on contact rows: tangential jumps, and the force at which slip begins.

In the jump basis, the tangential jumps s of a row with friction are unknowns in addition to the
normal jump. Friction adds Σ c‖s − s₀‖ to the energy, where c is a force; friction forces μ lie in
the balls ‖μ‖ ≤ c. At the jumps s₀ the slip is zero; s₀ includes prescribed motions of supports and
obstacles, and earlier slip in stages.
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints


@dataclass(frozen=True)
class Friction:
    """The points with friction, with the forces at which slip begins.

    Attributes:
        pair: Contact row of each point with friction on this rank, shape (num_places,).
        index: Local owned unknowns of the jumps in the jump basis, shape (num_places, gdim − 1); −1
            for directions that supports hold.
        direction: Unit vector of each jump, zero if the jump does not exist, shape (num_places,
            gdim − 1, gdim).
        area: Tributary length or area of each point, shape (num_places,).
        coulomb: Coefficient of Coulomb's friction, shape (num_places,); 0 at points without
            Coulomb's friction.
        adhesion: Force at which slip begins without pressure, shape (num_places,).
        bound: Force c at which slip begins, shape (num_places,). With Coulomb's friction, c follows
            from the contact force and is updated in place.
        origin: s₀ (length), same shape as ``index``; updated in place.
        count: Number of points on all ranks.
        follows_pressure: Whether any point has Coulomb's friction.
        shares: Coefficients of shape (num_places, gdim − 1, k) if each jump is a combination of k
            unknowns; ``index`` then has shape (num_places, k). Otherwise None. Only the
            interior-point method supports such jumps.
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
        """Return the same friction, with row numbers replaced by local unknowns."""
        return replace(self, index=np.append(unknowns, np.int32(-1))[self.index])

    def smooth(self) -> "Friction":
        """Return the same points without resistance to slip."""
        none = np.zeros_like(self.bound)
        return replace(self, coulomb=none, adhesion=none, bound=none, follows_pressure=False)

    def nowhere(self) -> "Friction":
        """Return friction without any points."""
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
        """Return the tangential jumps of a vector in the jump basis, same shape as ``index``."""
        return self.gather(y.array_r)

    def slip(self, y: PETSc.Vec) -> Floats:
        """Return the slip s − s₀ (length) of a vector in the jump basis, shape of ``index``."""
        return self.jumps(y) - self.origin

    def gather(self, array: Floats) -> Floats:
        """Return the entries of a local array at the jumps, 0 if missing, shape of ``index``."""
        if not self.index.size:
            return np.zeros(self.index.shape)
        return np.where(self.index >= 0, array[self.index], 0.0)

    def add(self, values: Floats, array: Floats) -> None:
        """Add values, with the same shape as ``index``, to the entries of a local array."""
        there = self.index >= 0
        array[self.index[there]] += values[there]

    def unknowns(self, where: npt.NDArray[np.bool_]) -> Ints:
        """Return the local unknowns of the jumps at the points selected by ``where``."""
        some = self.index[where]
        return some[some >= 0]

    def energy(self, slip: Floats) -> float:
        """Return the dissipation Σ c‖slip‖ on this rank; infinite c allows no slip."""
        sizes = norms(slip)
        slips = (sizes > 0) & np.isfinite(self.bound)
        return float(self.bound[slips] @ sizes[slips])

    def slope(self, slip: Floats, change: Floats, beta: float) -> float:
        """Return the derivative of the energy on this rank along a change of slip.

        The derivative is at ``slip`` + β ``change``. At a kink it is the left derivative, or the
        right derivative if β = 0.
        """
        moves = (norms(change) > 0) & np.isfinite(self.bound)
        d, at = change[moves], slip[moves] + beta * change[moves]
        sizes, lengths = norms(at), norms(d)
        rounding = 1e-12  # a jump below this fraction of its change is at the kink of ‖s‖
        kink = sizes <= rounding * lengths
        along = np.einsum("ni,ni->n", at, d) / np.where(kink, 1.0, sizes)
        along = np.where(kink, lengths if beta == 0 else -lengths, along)
        return float(self.bound[moves] @ along)

    def last_turn(self, slip: Floats, change: Floats, comm: MPI.Intracomm) -> float:
        """Return the largest β ≥ 1 at which a point reverses its slip along a change.

        Collective.

        At this β, ``slip`` + β ``change`` of the point is shortest. The value is 1 if no point
        reverses its slip beyond β = 1.
        """
        moves = (norms(change) > 0) & (self.bound > 0)
        d = change[moves]
        beta = -np.einsum("ni,ni->n", slip[moves], d) / norms(d) ** 2
        return float(comm.allreduce(float(beta.max(initial=1.0)), MPI.MAX))


def norms(vectors: Floats) -> Floats:
    """Return the Euclidean norm of each row of an array."""
    lengths: Floats = np.sqrt(np.einsum("ni,ni->n", vectors, vectors))
    return lengths


def shrunk(vectors: Floats, bound: Floats) -> Floats:
    """Return the vectors, scaled down to their largest norms where they are longer.

    Args:
        vectors: Vectors, shape (n, k).
        bound: Largest norms, shape (n,).
    """
    sizes = norms(vectors)
    share = np.divide(bound, sizes, out=np.ones_like(sizes), where=sizes > bound)
    return share[:, None] * vectors
