"""Define the iterate of a Newton-like method: gradient, tangent, line search, increments.

All algorithms share this module; they differ in their steps.

Vectors with an entry for each unknown are of two kinds, both of type ``PETSc.Vec``. Vectors in
nodal unknowns are named after u: displacements, their change δu
(:attr:`quadrature_fields.Direction.du`), and forces. Vectors in the jump unknowns of the jump basis
are named after y: y = M u, and ``delta_y`` with δu = T δy. Forces in jump unknowns are Tᵀ times the
forces in nodal unknowns.

The line search finds the length of a Newton step at which the derivative φ'(β) of the energy along
the step vanishes. The energy is convex, so φ' is nondecreasing, and bisection finds its zero.
"""

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.problem.fields.quadrature_fields import RIGID, Direction, QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.active_set.friction_qp import Slip, slipping, stuck
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


class Tangent(Protocol):
    """The tangent Σ^{o,ρ}(ε(u)) of the fields."""

    def at(self, rho: float) -> Any:
        """Return an operator for ρ and the current strains, which is valid until the next call.

        Collective.
        """
        ...


MakeTangent: TypeAlias = Callable[[QuadratureFields], Tangent]
"""Function that creates the tangent of given fields; collective."""


class JumpTangent:
    """The tangent of all bodies as one operator in jump unknowns."""

    def __init__(self, fields: QuadratureFields) -> None:
        """Compile the form. Collective."""
        self._stiffness = Stiffness(fields)
        self._operator = ContactOperator(fields.problem, self._stiffness.matrix)

    def at(self, rho: float) -> ContactOperator:
        """Return the operator; see :meth:`Tangent.at`."""
        self._stiffness.assemble(rho)
        self._operator.add_springs(None)
        return self._operator


Slope = Callable[[float], float]
"""Function that returns the derivative φ'(β); collective."""

SLOPE_REDUCTION = 1e-3
"""A shortened step ends where |φ'(β)| is at most this fraction of |φ'(0)|."""


LONGEST = 1.5
"""Largest length of a stretched step; a step of length 2 is too long where bodies bend."""

STRETCHABLE = 0.1
"""A step is stretched as long as φ' is negative and |φ'| exceeds this fraction of |φ'(0)|. The
yielded zone grows from step to step, so steps of length 1 are too short."""


def step_length(
    slope: Slope,
    noise: Callable[[], tuple[float, float]],
    longest: Callable[[], float] | None = None,
    kinked: bool = False,
) -> float:
    """Return the β with the least energy in (0, 1], or a larger β if the energy still falls at 1.

    β = 1 is accepted if φ'(1) is so small, relative to φ'(0) or to its terms, that another β gains
    nothing. Without ``longest``, β = 1 is also accepted if φ'(1) is negative. Collective.

    Args:
        slope: Function that returns φ'.
        noise: Function that returns two rounding errors of φ': from adding its terms, and from
            adding the terms and computing the strains; called only if rounding errors decide.
        longest: Function that returns the largest step length; None for a largest length of 1.
        kinked: Whether the energy has kinks that the step may not account for. If the energy then
            rises from the start, β is 0, and the next step uses a new linearisation of friction.
    """
    at_zero, at_one = slope(0.0), slope(1.0)
    if -STRETCHABLE * abs(at_zero) <= at_one <= SLOPE_REDUCTION * abs(at_zero):
        return 1.0
    of_sum, of_all = noise()
    enough = max(SLOPE_REDUCTION * abs(at_zero), of_sum)
    if at_one > max(enough, of_all) and at_zero < -of_sum:
        return _bisected(slope, 0.0, 1.0, enough)
    if kinked and at_one > max(enough, of_all) and at_zero > max(of_sum, of_all):
        return 0.0
    if longest is None or at_zero >= -of_all or at_one >= -STRETCHABLE * abs(at_zero):
        return 1.0
    if kinked:
        # If φ' at the end of the step is at least this fraction of φ'(0), the bodies move almost
        # rigidly, against friction alone, whose forces are constant. The step then continues until
        # a surface resists.
        nothing_resists = 0.9
        slides = at_one <= nothing_resists * at_zero
        return _slid(slope, enough, longest()) if slides else 1.0
    return _stretched(slope, STRETCHABLE * abs(at_zero), longest())


def longest_slide(last_turn: float, strain2: float, change2: float) -> float:
    """Return the largest length of a step in which bodies slide.

    Args:
        last_turn: Largest β at which a point of friction reverses its slip.
        strain2: ‖ε(u)‖².
        change2: ‖ε(δu)‖² of the step.
    """
    # The step may also be long enough to change the strains by this fraction.
    share = 1e-2
    strainless = share * (strain2 / change2) ** 0.5 if change2 > 0 else 0.0
    past = 1.01  # factor beyond the β of the last reversal of slip
    return max(past * last_turn, strainless)


def _slid(slope: Slope, enough: float, longest: float) -> float:
    """Return a β ≥ 1 at which another surface resists, or the largest allowed β. Collective."""
    low = 1.0
    while low < longest:
        high = min(2 * low, longest)
        if slope(high) > 0:
            return _bisected(slope, low, high, enough)
        low = high
    return longest if longest > 1 else 1.0


def _stretched(slope: Slope, enough: float, longest: float) -> float:
    """Return the β ≥ 1 up to which the energy still falls steeply, for φ'(1) < -``enough``.

    Collective.

    Args:
        slope: Function that returns φ'.
        enough: |φ'| at which the step may end.
        longest: Largest step length.
    """
    if longest <= 1:
        return 1.0
    return longest if slope(longest) <= 0 else _bisected(slope, 1.0, longest, enough)


def _bisected(slope: Slope, low: float, high: float, enough: float) -> float:
    """Return β where φ' vanishes, between ``low`` with φ' < 0 and ``high`` with φ' > 0."""
    most_bisections = 40
    for _ in range(most_bisections):
        middle = (low + high) / 2
        here = slope(middle)
        if abs(here) <= enough:
            return middle
        low, high = (middle, high) if here < 0 else (low, middle)
    return high


ROUNDING = 1e-13
"""A slope is a difference of terms; below this fraction of the terms it is a rounding error."""


class Iterate:
    """A displacement u ∈ K_h, its fields, and a direction δu.

    All methods except :meth:`room` are collective.

    Attributes:
        fields: u (nodal) with its strain, stress and integrals.
        direction: δu (nodal) and the integrals along it.
        y: u in jump unknowns.
        lifted: Whether the initial u did not satisfy the supports, interferences and initial
            strains.
        first_force: Largest unbalanced force at the start of the level.
        slip: Linearisation of friction for the next step.
    """

    def __init__(self, problem: Problem, tangent: MakeTangent = JumpTangent) -> None:
        """Compile the forms, and create the tangent with ``tangent``. Collective."""
        self.problem = problem
        self.fields = QuadratureFields(problem)
        self.direction = Direction(self.fields)
        self._tangent = tangent(self.fields)
        self.y = problem.create_vector()
        self._delta_y = problem.create_vector()
        self._gradient_u = problem.create_vector()
        self._gradient_y = problem.create_vector()
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self.lifted, self.first_force = False, 0.0
        self.slip: Slip = stuck(problem.friction.index.shape)

    def begin(self, start: State | None) -> PairFlags:
        """Start from a state or from zero displacement, and remove penetrations to get u ∈ K_h.

        Supported unknowns get their values u_D, which no direction changes, and the laws get the
        history of the state.

        Returns:
            The active set of the state; without a state, the first active set of the problem.
        """
        problem, basis, u = self.problem, self.problem.basis, self.fields.u
        problem.remember(start.history if start else {})
        u.x.array[:] = 0.0 if start is None else start.u.x.array
        self.fields.leave()
        before = self._remembered(start)
        self.lifted = start is None and problem.initial_strain is not None
        if problem.motion.moves_supports:
            held, known = problem.fixed.ravel(), problem.prescribed[problem.fixed]
            self.lifted |= problem.comm.allreduce(bool((u.x.array[held] != known).any()), MPI.LOR)
            u.x.array[held] = known
            problem.guides.settle(u.x.array.reshape(problem.fixed.shape), problem.prescribed)
        basis.M.mult(u.x.petsc_vec, self.y)
        jumps = self.y.array_r[basis.index]
        if problem.comm.allreduce(int((jumps > basis.gap).sum())):
            self.y.array[basis.index] = np.minimum(jumps, basis.gap)
            basis.T.mult(self.y, u.x.petsc_vec)
            u.x.scatter_forward()
            self.lifted |= start is None or problem.motion.driven
        self._stick(start)
        self.fields.update()
        if self.lifted:  # to avoid artificial yield in the first step
            self.fields.take_elastic_stress(before)
        return problem.first_active.copy() if start is None else start.active.copy()

    def _stick(self, start: State | None) -> None:
        """Set which points of friction slip: those whose slip at the start exceeds rounding errors.

        Collective.
        """
        problem, friction, slide = self.problem, self.problem.friction, self.problem.motion.slide_at
        least = ROUNDING * self.y.norm(PETSc.NormType.NORM_INFINITY)
        now = self.jumps()
        then = now + slide(problem.moved_to) - (slide(start.zeta) if start else 0.0)
        slips = (norms(then) > least) & np.isfinite(friction.bound)
        near = ~slips & (norms(now) <= least)
        if problem.comm.allreduce(bool(now[near].any()), MPI.LOR):
            self.y.array[friction.unknowns(near)] -= now[near][friction.index[near] >= 0]
            problem.basis.T.mult(self.y, self.fields.u.x.petsc_vec)
            self.fields.u.x.scatter_forward()
        self.slip = slipping(then, friction.bound, slips)

    def jumps(self) -> Floats:
        """Return the slip (length) at the points of friction on this rank."""
        return self.problem.friction.slip(self.y)

    def _remembered(self, start: State | None) -> tuple[Floats, Floats] | None:
        """Return the strain and the stress of ``start``.

        The method returns None without ``start``, if laws have no history, or if neither supports
        nor gaps move.
        """
        problem = self.problem
        moves = problem.motion.moves_supports or problem.motion.driven
        if start is None or not (problem.history and moves):
            return None
        self.fields.update()
        return self.fields.e.x.array.copy(), self.fields.stress.x.array.copy()

    def room(self) -> Floats:
        """Return the current gap g − s ≥ 0 of each pair on this rank, shape (num_pairs,)."""
        basis = self.problem.basis
        return np.maximum(basis.gap - self.y.array_r[basis.index], 0)

    def work(self) -> float:
        """Return α = L₁(u)."""
        return self.problem.loads.alpha(self.fields.u.x.petsc_vec)

    def total_work(self, zeta: float) -> float:
        """Return L₀(u) + ζL₁(u)."""
        return self.problem.loads.work(self.fields.u.x.petsc_vec, zeta)

    def energy(self, zeta: float) -> float:
        """Return J_ζ(u) = Ψ(ε(u)) − L₀(u) − ζL₁(u) plus the friction energy."""
        return self.fields.potential() - self.total_work(zeta) + self.rubbed()

    def rubbed(self) -> float:
        """Return Σ c‖slip‖, the dissipation by friction. Collective."""
        return self.problem.comm.allreduce(self.problem.friction.energy(self.jumps()))

    def _rubbing(self, beta: float) -> float:
        """Return the derivative of the friction energy along δu, at u + β δu. Collective."""
        friction = self.problem.friction
        if not friction.count:
            return 0.0
        change = friction.jumps(self._delta_y)
        return self.problem.comm.allreduce(friction.slope(self.jumps(), change, beta))

    def gradient(self, zeta: float) -> PETSc.Vec:
        """Return ⟨Σ(ε(u)), ε(·)⟩ − L₀ − ζL₁ in jump unknowns, without friction.

        The vector is valid until the next call.
        """
        self.fields.assemble_force().copy(self._gradient_u)
        self.problem.loads.subtract_from(self._gradient_u, zeta)
        self.problem.basis.T.multTranspose(self._gradient_u, self._gradient_y)
        return self._gradient_y

    def operator(self, rho: float) -> Any:
        """Return the tangent Σ^{o,ρ}(ε(u)), which is valid until the next call."""
        return self._tangent.at(rho)

    def aim(self, delta_y: PETSc.Vec) -> None:
        """Set the direction δu = T δy."""
        delta_y.copy(self._delta_y)
        du = self.direction.du
        self.problem.basis.T.mult(delta_y, du.x.petsc_vec)
        du.x.array[: self._fixed.size][self._fixed] = 0
        du.x.scatter_forward()
        self.direction.update()

    @phase("line search")
    def line_search(self, zeta: float, stretch: bool = False, halted: bool = False) -> float:
        """Return the step length β along δu, from the derivative of J_ζ(u + β δu).

        See :func:`step_length`.

        Args:
            zeta: Load factor.
            stretch: Whether β may exceed 1 if J_ζ still falls steeply at β = 1.
            halted: Whether the last step had β = 0; a second such step would change nothing.
        """
        direction = self.direction
        load = self.problem.loads.work(direction.du.x.petsc_vec, zeta)

        def slope(beta: float) -> float:
            direction.beta.value = beta
            return direction.slope() - load + self._rubbing(beta)

        rubs = self.problem.friction.count > 0 and not halted
        may = self._longest if stretch and not halted else None
        return step_length(slope, self._noise, may, kinked=rubs)

    def _noise(self) -> tuple[float, float]:
        """Return two rounding errors of slopes; see :func:`step_length`."""
        stress, change = self.fields.stress_norm2(), self.direction.du_norm2()
        friction = self.problem.friction
        rubbing = friction.energy(friction.jumps(self._delta_y))
        terms = max(float(np.sqrt(stress * change)), self.problem.comm.allreduce(rubbing))
        strains = 0.0
        if stress <= self.least_norm2():
            strains = float(np.sqrt(self.fields.jagged_norm2() * change))
        return ROUNDING * terms, ROUNDING * max(terms, strains)

    def _longest(self) -> float:
        """Return the largest allowed step length β, for which u + β δu must lie in K_h."""
        friction, comm, most = self.problem.friction, self.problem.comm, LONGEST
        if friction.count:
            turn = friction.last_turn(self.jumps(), friction.jumps(self._delta_y), comm)
            most = longest_slide(turn, self.fields.u_norm2(), self.direction.du_norm2())
        jump = self._delta_y.array_r[self.problem.basis.index]
        closing = jump > ROUNDING * self._delta_y.norm(PETSc.NormType.NORM_INFINITY)
        shares = self.room()[closing] / jump[closing]
        return float(comm.allreduce(shares.min(initial=most), MPI.MIN))

    def descends_until(self, work: float, zeta: float) -> bool:
        """Return whether J_ζ still falls along δu at the point where L₀ + ζL₁ reaches ``work``.

        If ``work`` is smaller than ten times the work at u, the function considers ten times the
        work at u. If J_ζ falls at this point, it falls along the whole segment, because J_ζ is
        convex. The ray must stay in K_h, so pairs that δu would close keep their gaps. The result
        is False if the loads do no positive work on δu.
        """
        direction, basis = self.direction, self.problem.basis
        jump = self._delta_y.array_r[basis.index]
        if self.problem.comm.allreduce(int((jump > 0).sum())):
            self._delta_y.array[basis.index] = np.minimum(jump, 0)
            self.aim(self._delta_y)
        along = self.problem.loads.work(direction.du.x.petsc_vec, zeta)
        if along <= 0:
            return False
        here = self.total_work(zeta)
        direction.beta.value = (max(abs(work), 10 * abs(here)) - here) / along
        return direction.slope() + self._rubbing(float(direction.beta.value)) < along

    def take_step(self, beta: float, stopping: str, zeta: float = 0.0) -> float:
        """Advance by β δu, and return the size of the step in the criterion ``stopping``.

        Remark 1 of the paper defines the criteria. The criterion "energy" is the relative change of
        J_ζ. If work is prescribed, the caller gives ζ = 0, and J_ζ is Ψ − L₀. If bodies are loaded
        at ζ = 0, or if laws have history, the change is relative to at least |Ψ| + ½‖σ‖².
        """
        if stopping != "energy":
            increment = self.increment(stopping)
            self.advance(beta)
            return increment
        before = self.energy(zeta)
        self.advance(beta)
        after = self.energy(zeta)
        total = max(abs(after) + abs(before), self.least_norm2())
        if self.problem.history or self.problem.loaded_at_zero():  # J_ζ may pass through zero
            total = max(total, self.fields.size())
        return abs(after - before) / total if total > 0 else 0.0

    def increment(self, stopping: str) -> float:
        """Return ‖δu‖ or ‖δσ‖_E relative to the sum of the norms before and after the step.

        Remark 1 of the paper defines this criterion.
        """
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
        total = fields.at_least(RIGID, float(np.sqrt(before) + np.sqrt(after)))
        return float(np.sqrt(max(change, 0)) / total) if total > 0 else 0.0

    def least_norm2(self) -> float:
        """Return the ‖·‖² below which the strain and stress of u are mainly rounding errors.

        Collective.
        """
        return RIGID**2 * self.fields.jagged_norm2()

    def load_change(self, change: float, zeta: float) -> float:
        """Return a change of ζ relative to ζ, or to other forces if these are larger. Collective.

        ζ may be exactly 0 if moving supports and constant loads are in balance, or if bodies move
        almost rigidly.
        """
        fields, loads = self.fields, self.problem.loads
        forces = abs(zeta) * loads.live.norm()
        if self.problem.loaded_at_zero():
            forces = max(forces, loads.dead.norm(), fields.assemble_all_forces().norm())
        if fields.u_norm2() <= self.least_norm2():
            forces = max(forces, RIGID * fields.gross_force())
        return abs(change) * loads.live.norm() / forces if forces > 0 else 0.0

    def first_work(self, zeta: float) -> float:
        """Return the reference value for works in later steps, after the first step. Collective.

        The value is the larger of |L₀(u) + ζL₁(u)|, which may vanish, and |Ψ| + ½‖σ‖².
        """
        return max(abs(self.total_work(zeta)), self.fields.size())

    def advance(self, beta: float) -> None:
        """Advance the iterate: u ← u + β δu."""
        u = self.fields.u
        u.x.array[:] += beta * self.direction.du.x.array
        self.y.axpy(beta, self._delta_y)
        self.fields.update()

    def state(self, zeta: float, active: PairFlags) -> State:
        """Return a state with the updated history and a copy of u.

        Later steps do not change the copy.
        """
        u = fem.Function(self.problem.V, name="displacement")
        u.x.array[:] = self.fields.u.x.array
        return State(u, zeta, self.work(), active.copy(), self.fields.updated_history())
