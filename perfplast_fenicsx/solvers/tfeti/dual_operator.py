"""Multiply with F = B K⁺ Bᵀ on the active rows, G, and the projector on balanced forces.

The last row of the first rank is the border: a row with all unknowns, such as the work of the
loads.
"""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.tfeti.coarse_problem import CoarseProblem
from perfplast_fenicsx.solvers.tfeti.gluing import Gluing
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains
from perfplast_fenicsx.solvers.tfeti.torn_stiffness import TornStiffness


class DualOperator:
    """Products with B and F; all methods are collective.

    Attributes:
        comm: The ranks.
        size: Number of rows of this rank, including the border on the first rank.
        contact: Indices of the rows of contact.
        coarse: Coarse problem of the active rows.
        norm: Estimate of ‖PFP‖, for the first stiffness or the last :meth:`measure`.
    """

    def __init__(self, comm: MPI.Intracomm, pieces: Subdomains, gluing: Gluing, free: int) -> None:
        """Form G of the rows of ``gluing``, which leave ``free`` rigid motions free. Collective.

        Raises:
            LinearFailure: If a piece can move as a rigid body, whatever the rows are.
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
        """Take a new K, or the same one with new values. Collective."""
        self._stiffness, self._measured = stiffness, False
        if not self.norm > 0:
            self.measure()

    def put_in_force(self, contact: npt.NDArray[np.bool_], border: Floats | None) -> None:
        """Set the active rows: all rows except some of contact, and a border. Collective.

        Args:
            contact: Active rows of contact, shape (num_pairs,).
            border: Torn forces whose work is prescribed; None for none.

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
        """Return B u of torn unknowns."""
        self._u.array[:] = u
        self._B.mult(self._u, self._image)
        jumps = np.zeros(self.size)
        jumps[self._rows] = np.where(self._force, self._image.array_r, 0.0)
        work = self.comm.allreduce(float(self._border @ u))
        if self._own_border:
            jumps[-1] = work
        return jumps

    def forces(self, multipliers: Floats) -> Floats:
        """Return Bᵀλ on torn unknowns."""
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
        """Estimate ‖PFP‖ of the present stiffness by the power method. Collective."""
        if self._measured:
            return
        self._measured = True
        P = self.coarse.project
        x = P(np.cos(np.arange(self.size)))
        powers = 12  # steps of the power method for ‖PFP‖
        for _ in range(powers):
            size = np.sqrt(self.comm.allreduce(float(x @ x)))
            if not size > 0:
                break
            x = P(self.multiply(x / size))
            self.norm = float(np.sqrt(self.comm.allreduce(float(x @ x))))
