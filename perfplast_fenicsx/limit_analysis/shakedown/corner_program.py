"""Formulate shakedown as a limit load, with a cone at each point for each corner of the domain.

The domain contains the factors of the varying loads (:class:`elastic_stresses.LoadDomain`).

Let σ_k be the elastic stress at corner k, σ₀ the elastic stress from constant loads, and ρ a
residual stress in equilibrium with zero loads. Melan's theorem leads to the problem

    max λ    with  τ_k = λσ_k + σ₀ + ρ in the yield set of each point, for each corner k = 0, 1, ….

Koiter's theorem is the dual problem, for the displacement v of a cycle and plastic strains p_k at
the corners, with the dissipation D:

    min Σ w (D(p_k) − σ₀:p_k)    with  Σ_k p_k = ε(v),  Σ w σ_k:p_k = 1.

The shakedown load is therefore the limit load of a body with the velocities y = (v, p₁, p₂, …).
Each point occurs once for each corner, with the strain rate ε(v) − p₁ − p₂ − … at corner 0 and p_k
at corner k > 0. The loads do the work L(y) = Σ w σ_k:p_k. Equilibrium for all p_k makes τ_k − λσ_k
the same at all corners, and equilibrium for all v makes this stress self-equilibrated up to the
constant loads. With alternating plasticity, v is zero.

The plastic strains of a point do not occur in the equations of other points, and the stiffness
eliminates them. With the moduli D_k of a point at the corners, the modulus (Σ D_k⁻¹)⁻¹ remains for
v. Inverses use triangular factors of roots of the moduli (QR), which lose half as many digits as
the moduli would lose. In plane strain, the out-of-plane residual stress is the same at all corners,
so the cones contain all stress components.
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, SingularStiffness
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointCoordinates, PointStrains
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING


class Frames:
    """Coordinates of strain rates without a redundant component, at the points of this rank.

    The coordinates of :mod:`standard_cones` are 1 + m numbers for m components of a strain rate. If
    the coordinates are the trace and the deviator, the deviator is a trace-free vector of m
    numbers.

    Attributes:
        columns: Matrix Q of (tr ε, dev ε) = Q q with orthonormal columns, shape (count, 1 + m, m).
        of_rates: Matrix E of q = E ε, shape (count, m, m).
        of_stresses: Matrix E⁻ᵀ for the stresses that do work on q, shape (count, m, m).
    """

    def __init__(self, at: PointCoordinates, size: int) -> None:
        """Compute the coordinates for each cone.

        Args:
            at: Coordinates of the points' cones.
            size: Number m of components.
        """
        count = len(at.numbers)
        rates = np.empty((count, 1 + size, size))
        for i, unit in enumerate(np.eye(size)):
            rates[:, :, i] = np.column_stack(at.rates(np.tile(unit, (count, 1))))
        self.columns: Floats = np.zeros((count, 1 + size, size))
        self.of_rates: Floats = np.zeros((count, size, size))
        self.of_stresses: Floats = np.zeros((count, size, size))
        for number in np.unique(at.numbers):
            here = at.numbers == number
            R = rates[here][0]
            axes, values, _ = np.linalg.svd(R[1:])
            rank = int((values > ROUNDING * values[0]).sum())
            Q = np.zeros((1 + size, size))
            Q[0, 0] = float(rank < size)
            Q[1:, size - rank :] = axes[:, :rank]
            self.columns[here], self.of_rates[here] = Q, Q.T @ R
            self.of_stresses[here] = np.linalg.inv(Q.T @ R).T


class CornerStrains:
    """Strain rates at points and corners; see :class:`discretisation.Strains`.

    The points of each corner are consecutive. The unknowns are v in the contact basis, followed by
    ℓ p_k in the coordinates of :class:`Frames`. The factor ℓ is the mean size of a point's volume.
    With this factor, the forces on ℓ p_k are about as large as the forces on v.

    Attributes:
        problem: The bodies.
        points: Strain rates of v at the points.
        corners: Number of corners.
        frames: Coordinates at the points.
    """

    def __init__(self, problem: Problem, points: PointStrains, corners: int) -> None:
        """Store the points of a problem; the caller still owns the points. Collective."""
        at, comm = points.coordinates, problem.comm
        self.problem, self.points, self.corners = problem, points, corners
        self.frames = Frames(at, points.size)
        self.count, self.size, self.gdim = corners * points.count, points.size, points.gdim
        self.weights: Floats = np.tile(points.weights, corners)
        self.radii, self.slopes = np.tile(points.radii, corners), np.tile(points.slopes, corners)
        tilts = points.tilts
        self.tilts = None if tilts is None else np.tile(tilts, (corners, 1))
        self.sets = at.sets_of(corners)
        volume, count = comm.allreduce(np.array([points.weights.sum(), points.count]))
        self.length = float(volume / count) ** (1 / (3 if points.size == 6 else 2))
        self._velocity = problem.create_vector()
        self._own = self._velocity.getLocalSize()

    def create_vector(self) -> PETSc.Vec:
        """Return a zero velocity. Collective."""
        size = self._own + (self.corners - 1) * self.points.count * self.size
        return PETSc.Vec().createMPI((size, None), comm=self.problem.comm)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._velocity.destroy()

    def velocity(self, y: PETSc.Vec) -> PETSc.Vec:
        """Return the part v of y, in a vector that later calls of any method overwrite."""
        self._velocity.array[:] = y.array_r[: self._own]
        return self._velocity

    def flows(self, y: PETSc.Vec) -> Floats:
        """Return the plastic rates at all corners, shape (corners, num_points, m). Collective."""
        shape = self.corners - 1, self.points.count, self.size
        flows = y.array_r[self._own :].reshape(shape) / self.length
        first = self.rates_of(self.velocity(y)) - flows.sum(axis=0)
        return np.concatenate([first[None], flows])

    def rates_of(self, velocity: PETSc.Vec) -> Floats:
        """Return ε(v) in the coordinates of :class:`Frames`, shape (num_points, m). Collective."""
        return self._reduced(*self.points.of(velocity))[0]

    def tensors(self, flows: Floats) -> Floats:
        """Return the plastic rates of :meth:`flows` as Mandel vectors."""
        found: Floats = np.einsum("nji,knj->kni", self.frames.of_stresses, flows)
        return found

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Return the trace and the deviator at points and corners. Collective."""
        found = self._whole(self.flows(y)).reshape(self.count, -1)
        return found[:, 0].copy(), found[:, 1:].copy(order="F")

    def _reduced(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return coordinates without the redundant component, shape (copies, num_points, m)."""
        both = np.column_stack([pressure, deviator])
        both = both.reshape(-1, self.points.count, 1 + self.size)
        return np.asarray(np.einsum("nji,knj->kni", self.frames.columns, both), np.float64)

    def _whole(self, reduced: Floats) -> Floats:
        """Return (tr ε, dev ε), shape (..., num_points, 1 + m)."""
        return np.asarray(np.einsum("nij,...nj->...ni", self.frames.columns, reduced), np.float64)

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w τ_k:p_k for all y. Collective."""
        reduced = self._reduced(pressure, deviator)
        self.forces_on_velocity(reduced[0], self._velocity)
        out.array[: self._own] = self._velocity.array_r
        apart = self.points.weights[:, None] / self.length * (reduced[1:] - reduced[0])
        out.array[self._own :] = apart.ravel()

    def forces_on_velocity(self, reduced: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ τ:ε(v) for all v. Collective.

        Args:
            reduced: Stress τ in the coordinates of :class:`Frames`, shape (num_points, m).
            out: Vector in the contact basis.
        """
        both = self._whole(reduced)
        self.points.forces(both[:, 0].copy(), both[:, 1:].copy(), out)

    def stresses(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return stresses as Mandel vectors, shape (corners, num_points, m)."""
        reduced = self._reduced(pressure, deviator)
        return np.asarray(np.einsum("nji,knj->kni", self.frames.of_rates, reduced), np.float64)

    def coordinates(self, stresses: Floats) -> tuple[Floats, Floats]:
        """Return the pressure and the deviator, shapes (count,) and (count, m), of stresses.

        The stresses are Mandel vectors, shape (corners, num_points, m).
        """
        reduced = np.einsum("nij,knj->kni", self.frames.of_stresses, stresses)
        found = self._whole(np.asarray(reduced, np.float64)).reshape(-1, 1 + self.size)
        return found[:, 0].copy(), found[:, 1:].copy(order="F")

    def deviators(self, deviator: Floats) -> Floats:
        """See :meth:`discretisation.Strains.deviators`."""
        parts = np.split(deviator, self.corners)
        return np.concatenate([self.points.deviators(part) for part in parts])

    def matrix(self) -> sparse.csr_array:
        """See :meth:`discretisation.Strains.matrix`."""
        frames, (count, parts, m) = self.frames.columns, self.frames.columns.shape
        rows = np.arange(count * parts).reshape(count, parts, 1)
        columns = np.arange(count * m).reshape(count, 1, m)
        places = tuple(it.ravel() for it in np.broadcast_arrays(rows, columns))
        flows = sparse.csr_array((frames.ravel() / self.length, places))
        others = self.corners - 1
        of_first = sparse.hstack([self.points.matrix(), *[-flows] * others])
        of_others = sparse.hstack(
            [
                sparse.csr_array((others * count * parts, self._own)),
                sparse.block_diag([flows] * others),
            ]
        )
        return sparse.csr_array(sparse.vstack([of_first, of_others]))


class CornerStiffness:
    """Stiffness of y, solved with the factors of K for v; see :class:`discretisation.Stiffness`."""

    def __init__(self, bodies: ConicStiffness, strains: CornerStrains) -> None:
        """Take ownership of the stiffness of v."""
        self._bodies, self._strains = bodies, strains
        self.jump_diagonal, self.add_at_jumps = bodies.jump_diagonal, bodies.add_at_jumps
        self.factorise, self.counts = bodies.factorise, bodies.counts
        self._right, self._change = (strains.problem.create_vector() for _ in range(2))

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        for thing in (self._bodies, self._right, self._change):
            thing.destroy()

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at points and corners. Collective.

        Raises:
            SingularStiffness: If the moduli at a point are singular.
        """
        strains, Q = self._strains, self._strains.frames.columns
        count, parts, m = Q.shape
        roots = np.swapaxes(moduli.roots().reshape(-1, count, parts, parts), 2, 3) @ Q
        soft = np.swapaxes(softness_roots(roots), 2, 3)
        root = softness_roots(np.moveaxis(soft, 0, 1).reshape(count, -1, m))
        regular = bool(np.isfinite(root).all())
        if not strains.problem.comm.allreduce(regular, MPI.LAND):
            raise SingularStiffness("the moduli of a point have no inverse")
        self._moduli, self._soft, self._stiff = roots, soft[1:], np.swapaxes(root, 1, 2)
        ones = np.ones(count)
        of_bodies = Moduli(ones, ones, np.zeros((count, m))).with_whole(np.arange(count), Q @ root)
        self._bodies.assemble(of_bodies, held)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        strains, points = self._strains, self._strains.points
        own = self._right.getLocalSize()
        shape = strains.corners - 1, points.count, strains.size
        pushes = b.array_r[own:].reshape(shape) * (strains.length / points.weights[:, None])
        free = _times(self._soft, pushes)
        off = free.sum(axis=0)
        strains.forces_on_velocity(_times(self._stiff, off), self._right)
        self._right.array[:] += b.array_r[:own]
        self._bodies.solve(self._right, self._change)
        rates = strains.rates_of(self._change)
        flows = free + _times(self._soft, _times(self._stiff, rates - off))
        self._refine(flows, rates, pushes)
        x.array[:own] = self._change.array_r
        x.array[own:] = (strains.length * flows).ravel()

    def _refine(self, flows: Floats, rates: Floats, pushes: Floats) -> None:
        """Refine plastic rates until the residual stress is the same at all corners.

        The moduli of a point that flows at several corners differ by many orders of magnitude.
        Inverses then lose as many digits, and refinement recovers these digits.

        Args:
            flows: Plastic rates, which the function changes, shape (corners − 1, num_points, m).
            rates: Rates ε(v), shape (num_points, m).
            pushes: Excess of the stresses over the stress at the first corner, with the shape of
                ``flows``.
        """
        # largest number of refinements; relative difference of stresses that may remain
        most, enough = 4, 1e-12
        for _ in range(most):
            whole = np.concatenate([(rates - flows.sum(axis=0))[None], flows])
            stresses = _times(self._moduli, whole)
            apart = pushes + stresses[0] - stresses[1:]
            if np.abs(apart).max(initial=0.0) <= enough * np.abs(stresses).max(initial=0.0):
                break
            more = _times(self._soft, apart)
            flows += more - _times(self._soft, _times(self._stiff, more.sum(axis=0)))


def _times(roots: Floats, vectors: Floats) -> Floats:
    """Return AᵀA x at points, shape (..., num_points, m).

    Args:
        roots: Roots A, shape (..., num_points, k, m).
        vectors: Vectors x, shape (..., num_points, m).
    """
    half = roots @ vectors[..., None]
    return np.asarray((np.swapaxes(roots, -1, -2) @ half)[..., 0], np.float64)


def softness_roots(rows: Floats) -> Floats:
    """Return R with R Rᵀ = (AᵀA)⁻¹, shape (..., m, m); all entries are ∞ if any A is singular.

    Args:
        rows: Matrices A, shape (..., n, m).
    """
    triangles = np.linalg.qr(rows, mode="r")
    sizes = np.abs(np.diagonal(triangles, axis1=-2, axis2=-1))
    if not sizes.all():
        return np.full_like(triangles, np.inf)
    return np.asarray(np.linalg.inv(triangles), np.float64)
