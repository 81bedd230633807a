"""Anderson acceleration of a fixed-point iteration for a strain field, with a safeguard."""

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from perfplast_fenicsx.problem.problem import Problem

Strains = npt.NDArray[np.float64]

MEMORY = 8
"""Differences kept."""

GROWTH = 1.5
"""An extrapolation counts as failed where the residual exceeds the smallest by this factor."""

REGULARISATION = 1e-12
"""Added to the normal equations, relative to their trace."""


class Anderson:
    """Extrapolates e ← g(e) from the last iterations, residuals measured in ‖·‖_C.

    D. G. Anderson, J. ACM 12 (1965); type II, undamped. Where an extrapolated strain has led to a
    larger residual the plain iterate is taken and the memory cleared.
    """

    def __init__(self, problem: Problem) -> None:
        """Tabulate the weights of the norm. Collective."""
        self._comm = problem.comm
        self._width = problem.S.dofmap.index_map_bs
        self._owned = problem.S.dofmap.index_map.size_local
        points = problem.Q.dofmap.index_map.size_local
        form = fem.form(ufl.TestFunction(problem.Q) * problem.dx)
        volume = fem.assemble_vector(form).array[:points]
        moduli = problem.moduli
        self._spherical = np.sqrt(3 * moduli.bulk.x.array[:points] * volume)[:, None]
        self._deviatoric = np.sqrt(2 * moduli.shear.x.array[:points] * volume)[:, None]
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
        if size > GROWTH * self._smallest:
            self.restart()
        self._smallest = min(self._smallest, size)
        self._images.append(after.copy())
        self._residuals.append(residual)
        del self._images[:-MEMORY], self._residuals[:-MEMORY]
        if len(self._images) < 2:
            return
        gram = np.array([[np.vdot(a, b) for a in self._residuals] for b in self._residuals])
        gram = self._comm.allreduce(gram)
        gram += REGULARISATION * np.trace(gram) * np.eye(len(gram))
        weights = np.linalg.solve(gram, np.ones(len(gram)))
        weights /= weights.sum()
        after[:] = sum(w * g for w, g in zip(weights, self._images, strict=True))
        image.x.scatter_forward()

    def _values(self, strain: fem.Function) -> Strains:
        return strain.x.array[: self._owned * self._width].reshape(-1, self._width)

    def _weigh(self, strains: Strains) -> Strains:
        """Coordinates in which ‖·‖_C is the Euclidean norm."""
        mean = strains[:, :3].sum(axis=1, keepdims=True) / 3
        weighed = self._deviatoric * strains
        weighed[:, :3] += (self._spherical - self._deviatoric) * mean
        return weighed
