"""Friction in limit analysis: places of slip are points beside those of the bodies.

A place with the area A and the force c that slip s has to overcome is a point with the volume A h,
the strain s/h and the yield radius c/A, h = A^(1/(gdim − 1)): its cone is ‖μ‖ ≤ c, an interval in
the plane, and what it dissipates is c‖s‖.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, Moduli, Strains
from perfplast_fenicsx.limit_analysis.discrete.conic_stiffness import ConicStiffness


class FrictionStrains:
    """ε(v) at points and s/h at places of friction; see :class:`discretisation.Strains`."""

    def __init__(self, points: Strains, friction: Friction) -> None:
        self._points, self._friction = points, friction
        self.size, self.gdim = points.size, points.gdim
        self._rubs = friction.bound > 0
        bound, area = friction.bound[self._rubs], friction.area[self._rubs]
        self.length = area ** (1 / (self.gdim - 1))
        self.count = points.count + len(bound)
        self.weights = np.concatenate([points.weights, area * self.length])
        self.radii = np.concatenate([points.radii, bound / area])
        self.slopes = np.append(points.slopes, np.zeros(len(bound)))
        self.tilts = points.tilts
        if points.tilts is not None:
            self.tilts = np.concatenate([points.tilts, np.zeros((len(bound), self.size))])

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._points.destroy()

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator, shapes (count,) and (count, m). Collective."""
        trace, deviator = self._points.of(y)
        jumps = self._friction.jumps(y)[self._rubs] / self.length[:, None]
        more = np.zeros((len(jumps), self.size))
        more[:, : jumps.shape[1]] = jumps
        return np.append(trace, np.zeros(len(more))), np.concatenate([deviator, more])

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) + Σ μ·s for all v. Collective."""
        count, index = self._points.count, self._friction.index
        self._points.forces(pressure[:count], deviator[:count], out)
        mu = np.zeros(index.shape)
        share = self.weights[count:] / self.length
        mu[self._rubs] = share[:, None] * deviator[count:, : index.shape[1]]
        self._friction.add(mu, out.array)

    def springs(self, a: Floats, normal: Floats) -> tuple[Ints, Floats]:
        """Unknowns of the places, and what a I − N Nᵀ at their points is as springs."""
        count, size = self._points.count, self._friction.index.shape[1]
        N = normal[count:, :size]
        moduli = a[count:, None, None] * np.eye(size) - np.einsum("ni,nj->nij", N, N)
        share = self.weights[count:] / self.length**2
        return self._friction.index[self._rubs], share[:, None, None] * moduli


class FrictionStiffness:
    """K with friction; see :class:`discretisation.Stiffness`."""

    def __init__(self, bodies: ConicStiffness, strains: FrictionStrains, count: int) -> None:
        """Take K of the bodies over, whose points are ``count``."""
        self._bodies, self._strains, self._count = bodies, strains, count
        self.jump_diagonal, self.add_at_jumps = bodies.jump_diagonal, bodies.add_at_jumps
        self.factorise, self.solve = bodies.factorise, bodies.solve
        self.destroy = bodies.destroy

    @property
    def factorisations(self) -> int:
        """So far."""
        return self._bodies.factorisations

    @property
    def solves(self) -> int:
        """Systems solved so far."""
        return self._bodies.solves

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Bring K to moduli at all points. Collective."""
        self._bodies.add_springs(self._strains.springs(moduli.a, moduli.normal))
        self._bodies.assemble(moduli.first(self._count), held)
