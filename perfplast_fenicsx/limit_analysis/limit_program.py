"""The discrete limit load as a static and a kinematic problem, in units that make numbers about 1.

On the points of the quadrature, with weights w,

    max λ            with  Σ w σ:ε(v) + r·[v] = λ L(v) for all v,   ‖dev σ‖ ≤ γ,   r ≥ 0,
    min Σ w γ‖dev ε(v)‖   with  L(v) = 1,   tr ε(v) = 0,   [v] ≤ 0,

where [v] are the jumps of contact pairs and obstacles and r their forces. In elastic bodies ‖dev σ‖
is not bounded, and ε(v) = 0. The gaps of contact play no part: a body that moves without end has
closed or opened them (E. Christiansen, Handbook of Numerical Analysis IV, 1996).
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.limit_analysis.conic_stiffness import NONE, ConicStiffness
from perfplast_fenicsx.limit_analysis.point_strains import PointStrains
from perfplast_fenicsx.problem.problem import Problem

Floats = npt.NDArray[np.float64]

PROXIMAL = 1e-5
"""δ: stresses that nothing bounds change by 1/δ times a strain. With 1e-4 linear elements that
nearly lock take three times the steps; with less K is worse conditioned."""


MOST_VISCOUS = 1e4
"""Strong bodies are so viscous at first, at most."""


class LimitProgram:
    """Both problems of one discretisation. Velocities are vectors in the contact basis.

    Attributes:
        problem: The bodies and their loads.
        strains: Strain rates at the points.
        stiffness: K, to be assembled with any moduli.
        load: L.
        plastic: Which points of this rank have a yield stress, shape (count,).
        weights: w, 1 in the mean, shape (count,).
        radii: γ of the plastic points, 1 in the harmonic mean.
        viscosities: γ over a rate that suits the point.
        springs: Stiffness of contact that suits that of the bodies, shape (num_pairs,).
        degree: Plastic points and pairs of all ranks.
        stress_unit: What 1 is of σ.
        load_unit: What 1 is of λ.
        force_unit: What 1 is of r.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the forms, and choose units by a flow that is viscous. Collective.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        self.problem, self._comm = problem, problem.comm
        self.strains = strains = PointStrains(problem)
        self.stiffness = ConicStiffness(problem)
        self.plastic = np.isfinite(strains.radii)
        radii = strains.radii[self.plastic]
        mine = np.array([strains.count, strains.weights.sum(), len(radii), (1 / radii).sum()])
        points, volume, cones, weaknesses = self._comm.allreduce(mine)
        self.degree = int(cones) + problem.num_pairs
        self._mean_weight = volume / points
        self.stress_unit = cones / weaknesses if cones else 1.0  # that of weak bodies counts
        self.weights, self.radii = strains.weights / self._mean_weight, radii / self.stress_unit
        self.viscosities = np.minimum(self.radii**2, MOST_VISCOUS)
        self.force_unit = self.stress_unit * self._mean_weight
        self.load = problem.create_vector()
        problem.basis.T.multTranspose(problem.loads.live, self.load)
        self.load.scale(1 / self.force_unit)
        self.load_unit = 1.0
        self.springs: Floats = np.zeros(len(problem.basis.gap))

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for thing in (self.strains, self.stiffness, self.load):
            thing.destroy()

    def choose_units(self) -> None:
        """Make the limit load about as large as there are points and pairs. Collective.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        viscosity = self.at_points(self.viscosities, 1 / PROXIMAL)
        none: Floats = np.zeros((len(viscosity), self.problem.S.dofmap.index_map_bs))
        self.assemble(np.ones_like(viscosity), viscosity, none)
        self.springs = self.stiffness.jump_diagonal()
        self.assemble(np.full_like(viscosity, 1 / PROXIMAL), viscosity, none)
        self.stiffness.add_at_jumps(self.springs)
        self.stiffness.factorise()
        flow = self.load.duplicate()
        self.stiffness.solve(self.load, flow)
        unit = self.dissipation(flow) / self.work(flow) / max(self.degree, 1)
        flow.destroy()
        self.load_unit *= unit
        self.load.scale(unit)

    def at_points(self, plastic: Floats, elastic: float) -> Floats:
        """Values at all points from those at the plastic ones."""
        values: Floats
        values = np.full((self.strains.count, *plastic.shape[1:]), elastic)
        values[self.plastic] = plastic
        return values

    def assemble(
        self, bulk: Floats, a: Floats, normal: Floats, held: npt.NDArray[np.int32] = NONE
    ) -> None:
        """Assemble Σ w² (κ tr ε δ + a dev ε − (N:ε) N):ε; see :class:`ConicStiffness`."""
        scale = self.weights / self._mean_weight
        self.stiffness.assemble(scale * bulk, scale * a, np.sqrt(scale)[:, None] * normal, held)

    def internal_forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w (p δ + s):ε(v) for all v. Collective."""
        self.strains.forces(pressure / self._mean_weight, deviator / self._mean_weight, out)

    def work(self, velocity: PETSc.Vec) -> float:
        """L(v). Collective."""
        return float(self.load.dot(velocity))

    def dissipation(self, velocity: PETSc.Vec) -> float:
        """Σ w γ‖dev ε(v)‖ over plastic points. Collective."""
        _, deviator = self.strains.of(velocity)
        rates = np.linalg.norm(deviator[self.plastic], axis=1)
        return self.total(float((self.weights[self.plastic] * self.radii) @ rates))

    def total(self, value: float) -> float:
        """Sum over all ranks. Collective."""
        return float(self._comm.allreduce(value))
