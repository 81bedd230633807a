"""Accelerate a fixed-point iteration for a strain field by Anderson's method, with a safeguard."""

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, OfLaw
from perfplast_fenicsx.problem.problem import Problem

Strains = Floats


Weights = tuple[Floats, Floats]
"""Weights of the spherical and the deviatoric part of the strains, at each owned point."""


def elastic_weights(problem: Problem) -> Weights:
    """Return square roots of 3κ and of 2μ, each times the volume of a point. Collective."""
    Q = problem.Q
    owned = Q.dofmap.index_map.size_local
    volume = fem.assemble_vector(fem.form(ufl.TestFunction(Q) * problem.dx)).array[:owned]

    def root(modulus: OfLaw) -> Floats:
        at_points = fem.Function(Q)
        LawExpression(problem.laws, Q, modulus).interpolate(at_points)
        return np.sqrt(at_points.x.array[:owned] * volume)

    return root(lambda on: 3 * on.law.elastic.bulk), root(lambda on: 2 * on.law.elastic.shear)


class Anderson:
    """Extrapolates e ← g(e) from the last iterations, with residuals measured in ‖·‖_C.

    D. G. Anderson, J. ACM 12 (1965); type II, undamped. If an extrapolated strain increases the
    residual, the plain iterate is taken and the memory cleared.
    """

    def __init__(self, comm: MPI.Intracomm, weights: Weights) -> None:
        """Store the norm.

        Args:
            comm: Ranks that share the strains.
            weights: Of ‖·‖_C (:func:`elastic_weights`).
        """
        self._comm = comm
        self._spherical, self._deviatoric = (values[:, None] for values in weights)
        self._images: list[Strains] = []
        self._residuals: list[Strains] = []
        self._smallest = np.inf

    def restart(self) -> None:
        """Forget all iterations."""
        self._images.clear()
        self._residuals.clear()
        self._smallest = np.inf

    def extrapolate(self, current: fem.Function, image: fem.Function) -> None:
        """Replace the image g(e) of the current strain by an extrapolation. Collective."""
        before, after = self._values(current), self._values(image)
        residual = self._weigh(after - before)
        size = self._comm.allreduce(float(np.vdot(residual, residual))) ** 0.5
        # Factor by which a residual may exceed the smallest one before the extrapolation counts as
        # failed.
        growth = 1.5
        if size > growth * self._smallest:
            self.restart()
        self._smallest = min(self._smallest, size)
        self._images.append(after.copy())
        self._residuals.append(residual)
        most_kept = 8  # number of stored differences
        del self._images[:-most_kept], self._residuals[:-most_kept]
        if len(self._images) < 2:
            return
        gram = np.array([[np.vdot(a, b) for a in self._residuals] for b in self._residuals])
        gram = self._comm.allreduce(gram)
        regularisation = 1e-12  # added to the normal equations, relative to their trace
        gram += regularisation * np.trace(gram) * np.eye(len(gram))
        weights = np.linalg.solve(gram, np.ones(len(gram)))
        weights /= weights.sum()
        after[:] = sum(w * g for w, g in zip(weights, self._images, strict=True))
        image.x.scatter_forward()

    def _values(self, strain: fem.Function) -> Strains:
        width = strain.function_space.dofmap.index_map_bs
        return strain.x.array[: len(self._spherical) * width].reshape(-1, width)

    def _weigh(self, strains: Strains) -> Strains:
        """Return coordinates in which ‖·‖_C is the Euclidean norm."""
        mean = strains[:, :3].sum(axis=1, keepdims=True) / 3
        weighed = self._deviatoric * strains
        weighed[:, :3] += (self._spherical - self._deviatoric) * mean
        return weighed
