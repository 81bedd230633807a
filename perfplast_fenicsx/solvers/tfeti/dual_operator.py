"""Multiply by F = B K⁺ Bᵀ on the active rows, and project onto forces that balance every piece.

The last row of the first rank is the border: a row that involves all unknowns, such as the work of
the loads.

The coarse problem determines which row forces balance every piece: G λ = 0. Here G = RᵀBᵀ with the
rigid motions R. GGᵀ couples pieces that share rows; it is small, and every rank stores its factors.
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
from perfplast_fenicsx.solvers.tfeti.gluing import Gluing
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains, TornStiffness


class CoarseProblem:
    """G of the active rows, and the projector P onto the kernel of G.

    Attributes:
        size: Number of rigid motions of all pieces.
    """

    def __init__(self, comm: MPI.Intracomm, pieces: Subdomains, B: PETSc.Mat, free: int) -> None:
        """Form G for all rows. Collective.

        Args:
            comm: Communicator of the ranks.
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
        """Set the active rows, followed by the border on the rank that owns it. Collective.

        Raises:
            LinearFailure: If the rows let a piece move as a rigid body.
        """
        G = self._every @ diags_array(force.astype(np.float64))
        last = csr_array(self.resultants(border)[:, None])
        self._G = csr_array(hstack([G, last]) if own_border else G)
        gram = self._comm.allreduce((self._G @ self._G.T).toarray())
        if not self.size:
            return
        values, vectors = eigh(gram)
        # Eigenvalues of GGᵀ below this fraction of the largest one count as zero.
        negligible = 1e-12
        free = vectors[:, values <= negligible * values[-1]]
        if free.shape[1] > self._free:
            raise LinearFailure(
                "a subdomain can move as a rigid body: neither supports nor closed contacts hold it"
            )
        # No load does work on the free motions, so the free part of all right-hand sides is zero.
        self._factors = cho_factor(gram + values[-1] * free @ free.T)

    def balance(self, multipliers: Floats) -> Floats:
        """Return G λ, the same on every rank, shape (size,). Collective."""
        total: Floats = self._comm.allreduce(self._G @ multipliers)
        return total

    def resultants(self, forces: Floats) -> Floats:
        """Return Rᵀ f for torn forces, the same on every rank, shape (size,). Collective."""
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
        """Return Gᵀ times a vector that is the same on every rank, at the rows of this rank."""
        lifted: Floats = self._G.T @ amplitudes
        return lifted

    def off(self, multipliers: Floats) -> Floats:
        """Return the unbalanced part Qλ = Gᵀ(GGᵀ)⁻¹Gλ of row forces. Collective."""
        return self.lift(self.solve(self.balance(multipliers)))

    def project(self, multipliers: Floats) -> Floats:
        """Return the balanced part Pλ = λ − Qλ of row forces. Collective."""
        return multipliers - self.off(multipliers)


class DualOperator:
    """Products with B and F. All methods are collective.

    Attributes:
        comm: Communicator of the ranks.
        size: Number of rows on this rank, including the border on the first rank.
        contact: Indices of the contact rows.
        coarse: Coarse problem of the active rows.
        norm: Estimate of ‖PFP‖, for the first stiffness or the last :meth:`measure`.
    """

    def __init__(self, comm: MPI.Intracomm, pieces: Subdomains, gluing: Gluing, free: int) -> None:
        """Form G of the rows of ``gluing``, which leave ``free`` rigid motions free. Collective.

        Raises:
            LinearFailure: If a piece can move as a rigid body although all rows are active.
        """
        self.comm, self._B = comm, gluing.B
        self._own_border = comm.rank == 0
        rows = self._B.getLocalSize()[0]
        self._rows = slice(0, rows)
        self.size = rows + int(self._own_border)
        self.contact = slice(rows - gluing.num_pairs, rows)
        self._u, self._image = self._B.createVecs()
        self._force: npt.NDArray[np.bool_] = np.ones(rows, dtype=np.bool_)
        self._border: Floats = np.zeros(self._u.getLocalSize())
        self._stiffness: TornStiffness | None = None
        self.coarse = CoarseProblem(comm, pieces, self._B, free)
        self.norm = 0.0
        self._measured = self._ready = False
        self._renew()

    def set_stiffness(self, stiffness: TornStiffness) -> None:
        """Set a new K, or the same K with new values. Collective."""
        self._stiffness, self._measured = stiffness, False
        if not self.norm > 0:
            self.measure()

    def put_in_force(self, contact: npt.NDArray[np.bool_], border: Floats | None) -> None:
        """Set the active rows: all rows except some contact rows, and a border. Collective.

        Args:
            contact: Whether each contact row is active, shape (num_pairs,).
            border: Torn forces whose work is prescribed; None if no work is prescribed.

        Raises:
            LinearFailure: If the rows let a piece move as a rigid body.
        """
        force = np.ones_like(self._force)
        force[self.contact] = contact
        row = np.zeros_like(self._border) if border is None else border
        same = np.array_equal(force, self._force) and np.array_equal(row, self._border)
        if self.comm.allreduce(same and self._ready, MPI.LAND):
            return
        self._force, self._border = force, row
        self._renew()

    def _renew(self) -> None:
        self._ready = False
        self.coarse.renew(self._force, self._border, self._own_border)
        self._ready = True

    def rows(self, u: Floats) -> Floats:
        """Return B u for torn unknowns u, 0 at inactive rows, and the work of the border on u."""
        self._u.array[:] = u
        self._B.mult(self._u, self._image)
        jumps = np.zeros(self.size)
        jumps[self._rows] = np.where(self._force, self._image.array_r, 0.0)
        work = self.comm.allreduce(float(self._border @ u))
        if self._own_border:
            jumps[-1] = work
        return jumps

    def forces(self, multipliers: Floats) -> Floats:
        """Return Bᵀλ of the active rows and the border, on torn unknowns."""
        self._image.array[:] = np.where(self._force, multipliers[self._rows], 0.0)
        self._B.multTranspose(self._image, self._u)
        share = self.comm.bcast(float(multipliers[-1]) if self._own_border else 0.0)
        forces: Floats = self._u.array_r + share * self._border
        return forces

    def multiply(self, multipliers: Floats) -> Floats:
        """Return F λ."""
        return self.rows(self.stiffness.solve(self.forces(multipliers)))

    @property
    def stiffness(self) -> TornStiffness:
        """Return the K of the last :meth:`set_stiffness`."""
        assert self._stiffness is not None
        return self._stiffness

    def measure(self) -> None:
        """Estimate ‖PFP‖ for the current stiffness by the power method. Collective."""
        if self._measured:
            return
        self._measured = True
        P = self.coarse.project
        x = P(np.cos(np.arange(self.size)))
        powers = 12  # number of steps in the power method for ‖PFP‖
        for _ in range(powers):
            size = np.sqrt(self.comm.allreduce(float(x @ x)))
            if not size > 0:
                break
            x = P(self.multiply(x / size))
            self.norm = float(np.sqrt(self.comm.allreduce(float(x @ x))))
