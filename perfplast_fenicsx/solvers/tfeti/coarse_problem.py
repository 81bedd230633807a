"""Solve the coarse problem: which forces of the rows balance every piece, G λ = 0.

G = RᵀBᵀ with the rigid motions R. GGᵀ couples pieces that share rows; it is small, and every rank
stores its factors.
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, eigh
from scipy.sparse import csr_array, diags_array, hstack

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.constraints import entries_of, matrix_of_entries
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains


class CoarseProblem:
    """G of the active rows, and the projector P on its kernel.

    Attributes:
        size: Number of rigid motions of all pieces.
    """

    def __init__(self, comm: MPI.Intracomm, pieces: Subdomains, B: PETSc.Mat, free: int) -> None:
        """Form G of all rows. Collective.

        Args:
            comm: The ranks.
            pieces: Pieces of all bodies.
            B: The rows.
            free: Number of rigid motions of the bodies that no row resists.
        """
        self._comm, self._pieces, self._free = comm, pieces, free
        torn, gdim, modes = pieces.motions.shape
        self.size = pieces.total * modes
        self._here = slice(pieces.first * modes, (pieces.first + pieces.count) * modes)
        self._motions = pieces.motions.reshape(-1, modes)
        row = np.arange(torn * gdim).reshape(torn, gdim, 1)
        number = pieces.of_node[:, None, None] * modes + np.arange(modes)
        unknown, motion = (
            np.broadcast_to(part, pieces.motions.shape).ravel() for part in (row, number)
        )
        own = (pieces.count * modes, self.size)
        R = matrix_of_entries(
            comm, B.getSizes()[1], own, [(unknown, motion, pieces.motions.ravel())]
        )
        moved = B.matMult(R)
        each, column, value = entries_of(moved)
        self._every = csr_array((value, (column, each)), (self.size, moved.getLocalSize()[0]))
        for matrix in (R, moved):
            matrix.destroy()

    def renew(self, force: npt.NDArray[np.bool_], border: Floats, own_border: bool) -> None:
        """Take the active rows, and the border after those of one rank. Collective.

        Raises:
            LinearFailure: If they let a piece move as a rigid body.
        """
        G = self._every @ diags_array(force.astype(np.float64))
        last = csr_array(self.resultants(border)[:, None])
        self._G = csr_array(hstack([G, last]) if own_border else G)
        gram = self._comm.allreduce((self._G @ self._G.T).toarray())
        if not self.size:
            return
        values, vectors = eigh(gram)
        # Eigenvalues of GGᵀ below this share of the largest one count as zero.
        negligible = 1e-12
        free = vectors[:, values <= negligible * values[-1]]
        if free.shape[1] > self._free:
            raise LinearFailure(
                "a subdomain can move as a rigid body: neither supports nor closed contact hold it"
            )
        # no load does work on the free motions, so that their part of all right-hand sides is zero
        self._factors = cho_factor(gram + values[-1] * free @ free.T)

    def balance(self, multipliers: Floats) -> Floats:
        """Return G λ, the same on every rank, shape (size,). Collective."""
        total: Floats = self._comm.allreduce(self._G @ multipliers)
        return total

    def resultants(self, forces: Floats) -> Floats:
        """Return Rᵀ f of torn forces, the same on every rank, shape (size,). Collective."""
        own = np.zeros(self.size)
        if self._pieces.count:
            per_node = self._motions.shape[0] // len(self._pieces.node)
            each = self._motions * forces[:, None]
            own[self._here] = np.add.reduceat(each, self._pieces.ends[:-1] * per_node).ravel()
        total: Floats = self._comm.allreduce(own)
        return total

    def motion(self, amplitudes: Floats) -> Floats:
        """Return R α on the torn unknowns of this rank."""
        own = amplitudes[self._here].reshape(self._pieces.count, self._motions.shape[1])
        each = np.repeat(own, np.diff(self._pieces.ends), axis=0)
        return np.einsum("nim,nm->ni", self._pieces.motions, each).ravel()

    def solve(self, values: Floats) -> Floats:
        """Return (GGᵀ)⁻¹ times a vector that is the same on every rank."""
        return np.asarray(cho_solve(self._factors, values)) if self.size else values

    def lift(self, amplitudes: Floats) -> Floats:
        """Return Gᵀ times a vector that is the same on every rank, on this rank's rows."""
        lifted: Floats = self._G.T @ amplitudes
        return lifted

    def off(self, multipliers: Floats) -> Floats:
        """Return Qλ = Gᵀ(GGᵀ)⁻¹Gλ. Collective."""
        return self.lift(self.solve(self.balance(multipliers)))

    def project(self, multipliers: Floats) -> Floats:
        """Return Pλ = λ − Qλ. Collective."""
        return multipliers - self.off(multipliers)
