"""Compute a kinematic side of a mesh's limit load from an admissible collapse mechanism.

Let v be zero on supports, without penetration, and let ε(v) be admissible for the law of each body.
Then the limit load is at most (D(v) − L₀(v))/L₁(v). D is the dissipation, the support function of
the yield sets (kinematic theorem of limit analysis, E. Christiansen, Handbook of Numerical Analysis
IV, 1996). Bodies that keep their volume require div v = 0, and elastic ones ε(v) = 0.

The increments of a loading path come near such a v. From v_k the next one is the flow with the
viscosity η_k = D(ε_k)/‖ε_k‖², ε_k = ε(v_k), in the norm in which the law's D(ε) is γ‖ε‖ (Kačanov's
iteration). The bound does not grow, as with L₁(v) = 1

    D(v) − L₀(v) ≤ ½ ∫ γ(‖ε(v)‖²/‖ε_k‖ + ‖ε_k‖) − L₀(v),

whose right-hand side this v minimises.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.limit_analysis.path.viscous_flow import NoFlow, ViscousFlow
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, OfLaw, integrate
from perfplast_fenicsx.problem.assembled.spaces import Integral
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import TINY


@dataclass(frozen=True)
class MechanismBound:
    """The bound (D(v) − L₀(v))/L₁(v), or None and the reason.

    Attributes:
        value: The bound; None without one.
        mechanism: Mechanism v with L₁(v) = 1; None without a bound.
        solves: Number of linear systems solved.
        reason: Reason why there is no bound; empty if there is one.
    """

    value: float | None
    mechanism: fem.Function | None
    solves: int
    reason: str = ""


def dissipation_bound(problem: Problem, velocity: fem.Function, state: State) -> MechanismBound:
    """Return an upper bound from a velocity. Collective.

    Args:
        problem: The bodies and their loads.
        velocity: Velocity near a collapse mechanism.
        state: State of the collapse; pairs that push stay closed.
    """
    bound = KinematicBound(problem)
    try:
        return bound.of(velocity, state.active)
    finally:
        bound.destroy()


class KinematicBound:
    """Upper bounds from velocities; the forms are compiled once."""

    def __init__(self, problem: Problem) -> None:
        """Compile the forms, if the laws have bounds. Collective."""
        self._comm, laws, self._friction = problem.comm, problem.laws, problem.friction
        self._flow: ViscousFlow | None = None
        strain = problem.kinematics.strain
        rate = strain(fem.Function(problem.V))
        unable = [
            type(on.law).__name__
            for on in laws
            if on.law.carries_any_load or on.law.yields.inadmissible(rate) is None
        ]
        if unable:
            self.unable = f"{unable[0]} has no linear condition for admissible rates"
            return
        self._flow = ViscousFlow(problem)
        rate = strain(self._flow.velocity)
        self._count = problem.Q.dofmap.index_map.size_local
        self._value = fem.Function(problem.Q)

        def at_points(value: OfLaw) -> LawExpression:
            return LawExpression(laws, problem.Q, value)

        self._size = at_points(lambda on: ufl.sqrt(on.law.yields.resistance(rate, rate)))
        self._density = at_points(lambda on: on.law.yields.support(rate))
        self._power = Integral(
            problem.comm, integrate(laws, lambda on: on.law.yields.support(rate))
        )

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        if self._flow is not None:
            self._flow.destroy()

    def of(self, velocity: fem.Function, active: PairFlags) -> MechanismBound:
        """Return an upper bound from a velocity. Collective.

        Args:
            velocity: Velocity near a collapse mechanism.
            active: Flags of pairs that stay closed, shape (num_pairs,).
        """
        flow = self._flow
        if flow is None:
            return MechanismBound(None, None, 0, self.unable)
        before = flow.solves
        # Regions that flow less than the mean are at most this many times more viscous. The second
        # value is used if rounding spoils a flow.
        penalties = (1e4, 1e2)
        for stiff in penalties:
            flow.velocity.x.array[:] = velocity.x.array
            try:
                self._enter_nothing(flow, active.copy(), stiff)
                break
            except NoFlow as failure:
                reason = str(failure)
        else:
            return MechanismBound(None, None, flow.solves - before, reason)
        mechanism = flow.velocity.copy()
        mechanism.name = flow.velocity.name
        bound = self._power() + self._rubbed(flow) - flow.dead_work()
        return MechanismBound(bound, mechanism, flow.solves - before)

    def _rubbed(self, flow: ViscousFlow) -> float:
        """Return the dissipation of friction in a flow. Collective."""
        friction = self._friction
        return self._comm.allreduce(friction.energy(flow.slips())) if friction.count else 0.0

    def _enter_nothing(self, flow: ViscousFlow, held: PairFlags, stiff: float) -> None:
        """Compute the flow of the bodies, in which pairs that close are held as well."""
        most_holds = 4  # rounds in which pairs that a mechanism would close are held
        for _ in range(most_holds + 1):
            self._descend(flow, held, stiff)
            if flow.hold(held):
                continue
            flow.make_admissible()
            if not flow.hold(held):
                return
        raise NoFlow("the mechanism closes open pairs")

    def _descend(self, flow: ViscousFlow, held: PairFlags, stiff: float) -> None:
        """Compute flows of the bodies until the bound falls no more."""
        bound = np.inf
        most_flows = 6  # from a velocity to a mechanism
        # Change of the bound in a flow, relative to the dissipation, at which the flows end.
        settled = 1e-5
        for _ in range(most_flows):
            self._thicken(flow, stiff)
            flow.solve(held)
            power = self._power() + self._rubbed(flow)
            before, bound = bound, power - flow.dead_work()
            if abs(before - bound) <= settled * power:
                break

    def _thicken(self, flow: ViscousFlow, stiff: float) -> None:
        """Set the viscosity of the bodies from the present velocity."""
        size, density = self._values(self._size), self._values(self._density)
        mean = self._mean(size)
        if not mean > 0:
            raise NoFlow("nothing is strained")
        strength = np.divide(density, size, out=np.zeros_like(size), where=size > 0)
        viscosity = strength / np.maximum(size, mean / stiff)
        usual = self._mean(viscosity[viscosity > 0])
        if not usual > 0:
            raise NoFlow("nothing dissipates")
        viscosity[viscosity == 0] = usual  # irrelevant where a strain is completely inadmissible
        flow.viscosity.x.array[: self._count] = viscosity
        if self._friction.count:
            rates = norms(flow.slips())
            least = max(self._mean(rates), TINY) / stiff
            flow.drag = self._friction.bound / np.maximum(rates, least)

    def _values(self, expression: LawExpression) -> Floats:
        expression.interpolate(self._value)
        values: Floats = self._value.x.array[: self._count].copy()
        return values

    def _mean(self, values: Floats) -> float:
        """Return the mean over all ranks; 0 without values. Collective."""
        total = self._comm.allreduce(np.array([values.sum(), len(values)]), MPI.SUM)
        return float(total[0] / max(total[1], 1))
