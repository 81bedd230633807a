"""Points of an iterate whose principal stresses are bounded, by semidefinite matrices.

The members X_k = a_k t I + d_k dev σ + e_k p I + c_k b I (:mod:`principal_cones`) are linear in
y = (t, p, s), X = h + Gy, and their multipliers Z_k fulfil −Gᵀz = (0, w tr ε, w dev ε). With the
scaling of Nesterov and Todd, dx̃ + dz̃ = r̃ for the products to change by Λ∘r̃, so that

    GᵀW⁻²G dy = G̃ᵀ r̃ + Gᵀz + w(ε + dε),

a system of 2 + m rows a point. Of its inverse the part without t is the modulus. Where p is in no
member, as without friction, it follows the proximal point method.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import PROXIMAL, ConicProgram
from perfplast_fenicsx.limit_analysis.conic.conic_unknowns import Unknowns
from perfplast_fenicsx.limit_analysis.conic.discretisation import Moduli
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import (
    SIZE,
    MatrixScaling,
    product,
)
from perfplast_fenicsx.mandel_arrays import vectors


class PrincipalPoints:
    """Such points of this rank, where the iteration is."""

    def __init__(
        self, program: ConicProgram, now: Unknowns, trace: Floats, deviator: Floats
    ) -> None:
        """Scale, and factorise the system of each point. Not collective.

        Args:
            program: The program that was solved.
            now: The iterate.
            trace: Trace of the strain rate of its velocity, at all points.
            deviator: As ``trace``.
        """
        self._blocks, self._cones = program.blocks, program.blocks.cones
        self._weights, self._now = program.weights[self._cones.at], now
        self._scaling = MatrixScaling(now.X, now.Y)
        scaled = [self._scaling.primal(tensor) for tensor in self._cones.tensors]
        self._columns = self._blocks.columns(np.stack(scaled, axis=2))
        soft = np.zeros((self._cones.count, 1, self._columns.shape[2]))
        soft[:, 0, 1] = np.where(self._cones.grows, 0.0, np.sqrt(PROXIMAL))
        rows = np.concatenate([self._columns, soft], axis=1)
        triangles = np.linalg.qr(rows, mode="r")
        self._roots: Floats = np.asarray(np.linalg.inv(triangles), dtype=np.float64)
        self._off = self._blocks.works(now.Y) + self._rates(trace, deviator)

    def _rates(self, trace: Floats, deviator: Floats) -> Floats:
        """w(0, tr ε, dev ε), shape (num, 2 + m)."""
        at = self._cones.at
        rates = np.column_stack([np.zeros(len(at)), trace[at], self._cones.components(deviator)])
        return self._weights[:, None] * rates

    def moduli(self, moduli: Moduli) -> Moduli:
        """Return those of all points, with the whole ones of these."""
        roots = self._roots[:, 1:, 1:]  # of a triangle's part, as it is a triangle too
        more = moduli.normal.shape[1] + 1 - roots.shape[2]
        return moduli.with_whole(self._cones.at, np.pad(roots, ((0, 0), (0, more), (0, more))))

    def scaled(self, change: Unknowns) -> Floats:
        """Jordan's products of a change's members."""
        return product(self._scaling.primal(change.X), self._scaling.dual(change.Y))

    @property
    def products(self) -> Floats:
        """Those of the members themselves."""
        found: Floats = self._scaling.point[..., None] ** 2 * np.eye(SIZE)
        return found

    def aim(self, products: Floats) -> Floats:
        """r̃ for a change of the products."""
        return self._scaling.quotient(products)

    def stresses(
        self, aim: Floats | None = None, trace: Floats | None = None, deviator: Floats | None = None
    ) -> Floats:
        """Dy, shape (num, 2 + m).

        Args:
            aim: r̃, with what is missing in Z; None for neither.
            trace: Trace of the change of the velocity, at all points; None if it does not change.
            deviator: As ``trace``.
        """
        right = np.zeros_like(self._off)
        if trace is not None and deviator is not None:
            right += self._rates(trace, deviator)
        if aim is not None:
            right += self._off
            numbers = vectors(aim).reshape(len(aim), -1, 1)
            right += (np.swapaxes(self._columns, 1, 2) @ numbers)[:, :, 0]
        half = np.einsum("nji,nj->ni", self._roots, right)
        found: Floats = np.einsum("nij,nj->ni", self._roots, half)
        return found

    def put(self, dy: Floats, pressure: Floats, deviator: Floats) -> None:
        """Write the change of the stress into arrays of all points."""
        at = self._cones.at
        pressure[at], deviator[at, : dy.shape[1] - 2] = dy[:, 1], dy[:, 2:]

    def multipliers(self, dX: Floats, aim: Floats, trace: Floats, deviator: Floats) -> Floats:
        """DZ where members change by dX and the velocity's rates as given."""
        dZ = self._scaling.undone(aim - self._scaling.primal(dX))
        left = self._blocks.works(dZ) + self._off + self._rates(trace, deviator)
        return dZ - self._blocks.least(left)
