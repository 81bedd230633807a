"""The current iterate of a Newton-like method: gradient, tangent, line search, increments.

What ALG1 and the work-controlled methods do alike stands here; they differ in the step they take.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.problem.direction import Direction
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.state import State
from perfplast_fenicsx.problem.stiffness import Stiffness
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator

SLOPE_REDUCTION = 1e-3
"""The line search ends where |φ'(β)| is at most this share of |φ'(0)|."""

MOST_BISECTIONS = 40

ROUNDING = 1e-13
"""Slopes below this share of the terms they are the difference of are rounding noise."""


class Iterate:
    """u ∈ K_h, its fields, and a direction δu.

    Attributes:
        fields: Strain, stress, integrals.
        direction: δu and the integrals along it.
        y: u in the contact basis.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the forms. Collective."""
        self.problem = problem
        self.fields = QuadratureFields(problem)
        self.direction = Direction(self.fields)
        self._stiffness = Stiffness(self.fields)
        self.y = problem.create_vector()
        self._delta = problem.create_vector()
        self._residual = problem.create_vector()
        self._r = problem.create_vector()
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self._operator = ContactOperator(problem, self._stiffness.matrix)

    def begin(self, start: State | None) -> npt.NDArray[np.bool_]:
        """Start from a state, what penetrates being pushed back, or from zero displacement.

        Returns:
            The active set to begin with, the state's or the problem's first one.
        """
        basis, u = self.problem.basis, self.fields.u
        if start is None:
            u.x.array[:] = 0
        else:
            u.x.array[:] = start.u.x.array
        basis.M.mult(u.x.petsc_vec, self.y)
        jumps = self.y.array_r[basis.index]
        if self.problem.comm.allreduce(int((jumps > basis.gap).sum())):
            self.y.array[basis.index] = np.minimum(jumps, basis.gap)
            basis.T.mult(self.y, u.x.petsc_vec)
            u.x.scatter_forward()
        self.fields.update()
        return self.problem.first_active.copy() if start is None else start.active.copy()

    def room(self) -> npt.NDArray[np.float64]:
        """Room g − s ≥ 0 of each pair hosted here, shape (num_pairs,)."""
        basis = self.problem.basis
        room = basis.gap - self.y.array_r[basis.index]
        return np.maximum(room, 0)

    def work(self) -> float:
        """α = L(u)."""
        return float(self.problem.load.dot(self.fields.u.x.petsc_vec))

    def energy(self, zeta: float) -> float:
        """J_ζ(u) = Ψ(ε(u)) − ζL(u)."""
        return self.fields.potential() - zeta * self.work()

    def gradient(self, zeta: float) -> PETSc.Vec:
        """⟨Σ(ε(u)), ε(·)⟩ − ζL in the contact basis; valid until the next call."""
        self.fields.assemble_force().copy(self._residual)
        self._residual.axpy(-zeta, self.problem.load)
        self.problem.basis.T.multTranspose(self._residual, self._r)
        return self._r

    def operator(self, rho: float) -> ContactOperator:
        """Σ^{o,ρ}(ε(u)) in the contact basis; valid until the next call."""
        self._stiffness.assemble(rho)
        return self._operator

    def aim(self, delta: PETSc.Vec) -> None:
        """Take a direction, given in the contact basis."""
        delta.copy(self._delta)
        du = self.direction.du
        self.problem.basis.T.mult(delta, du.x.petsc_vec)
        du.x.array[: self._fixed.size][self._fixed] = 0
        du.x.scatter_forward()
        self.direction.update()

    @phase("line search")
    def line_search(self, zeta: float) -> float:
        """β = argmin over (0, 1] of J_ζ(u + β δu), by bisection on the monotone derivative.

        β = 1 is taken where the derivative there is not positive, or so small against the one at 0,
        or against the terms it is the difference of, that nothing is to be gained.
        """
        direction = self.direction
        load = zeta * float(self.problem.load.dot(direction.du.x.petsc_vec))
        size2 = self.fields.stress_norm2() * direction.du_norm2()
        noise = ROUNDING * float(np.sqrt(size2))

        def slope(beta: float) -> float:
            direction.beta.value = beta
            return direction.slope() - load

        at_zero, at_one = slope(0.0), slope(1.0)
        enough = max(SLOPE_REDUCTION * abs(at_zero), noise)
        if at_one <= enough or at_zero >= -noise:
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(MOST_BISECTIONS):
            middle = (low + high) / 2
            here = slope(middle)
            if abs(here) <= enough:
                return middle
            low, high = (middle, high) if here < 0 else (low, middle)
        return high

    def descends_until(self, alpha: float, zeta: float) -> bool:
        """Does J_ζ still fall along δu where the work of the loads has grown to ``alpha``?

        At least ten times the work of u is looked at. J_ζ is convex, so it then falls all the way.
        The ray has to stay in K_h: pairs that δu would close keep their distance instead.
        """
        direction, basis = self.direction, self.problem.basis
        jump = self._delta.array_r[basis.index]
        if self.problem.comm.allreduce(int((jump > 0).sum())):
            self._delta.array[basis.index] = np.minimum(jump, 0)
            self.aim(self._delta)
        work = float(self.problem.load.dot(direction.du.x.petsc_vec))
        if work <= 0:
            return False
        here = self.work()
        direction.beta.value = (max(alpha, 10 * here) - here) / work
        return direction.slope() < zeta * work

    def take_step(self, beta: float, stopping: str, zeta: float = 0.0) -> float:
        """Advance by β δu and tell how large the step was by a criterion of Remark 1.

        "energy" is the relative change of J_ζ; with ζ = 0, as for prescribed work, of Ψ.
        """
        if stopping != "energy":
            increment = self.increment(stopping)
            self.advance(beta)
            return increment
        before = self.energy(zeta)
        self.advance(beta)
        after = self.energy(zeta)
        return abs(after - before) / max(abs(after) + abs(before), 1e-300)

    def increment(self, stopping: str) -> float:
        """‖δu‖ or ‖δσ‖_E relative to the states before and after the full step (Remark 1)."""
        fields, direction = self.fields, self.direction
        if stopping == "stress":
            change, before, after = (
                direction.change_norm2(),
                fields.stress_norm2(),
                direction.moved_stress_norm2(),
            )
        else:
            change, before = direction.du_norm2(), fields.u_norm2()
            after = direction.moved_norm2()
        total = np.sqrt(before) + np.sqrt(after)
        return float(np.sqrt(max(change, 0)) / total) if total > 0 else 0.0

    def advance(self, beta: float) -> None:
        """Take the step: u ← u + β δu."""
        u = self.fields.u
        u.x.array[:] += beta * self.direction.du.x.array
        self.y.axpy(beta, self._delta)
        self.fields.update()

    def state(self, zeta: float, active: npt.NDArray[np.bool_]) -> State:
        """A copy of u that later steps leave alone."""
        u = fem.Function(self.problem.V, name="displacement")
        u.x.array[:] = self.fields.u.x.array
        return State(u, zeta, self.work(), active.copy())
