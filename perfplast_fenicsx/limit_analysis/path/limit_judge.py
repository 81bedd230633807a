"""Determine the limit load from the levels of a loading path, and choose the next level.

The module also computes the kinematic side of a mesh's limit load from an admissible mechanism. Let
v be a velocity that is zero on supports and causes no penetration, and let ε(v) be admissible for
the law of each body. Then the limit load is at most (D(v) − L₀(v))/L₁(v), where the dissipation D
is the support function of the yield sets (kinematic theorem of limit analysis, E. Christiansen,
Handbook of Numerical Analysis IV, 1996). Bodies that preserve their volume require div v = 0;
elastic bodies require ε(v) = 0.

The displacement increments of a loading path approach an admissible velocity v. The velocity after
v_k is the flow with the viscosity η_k = D(ε_k)/‖ε_k‖², where ε_k = ε(v_k), in the norm with which
the law has D(ε) = γ‖ε‖ (Kačanov's iteration). The bound does not increase, because for L₁(v) = 1

    D(v) − L₀(v) ≤ ½ ∫ γ(‖ε(v)‖²/‖ε_k‖ + ‖ε_k‖) − L₀(v),

and the flow minimises the right-hand side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.limit_analysis.path.viscous_flow import NoFlow, ViscousFlow
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, integrate
from perfplast_fenicsx.problem.assembled.spaces import Integral
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import TINY
from perfplast_fenicsx.solvers.load_stepping import Leap, Reached


@dataclass(frozen=True)
class MechanismBound:
    """The bound (D(v) − L₀(v))/L₁(v), or the reason why there is no bound.

    Attributes:
        value: The bound; None if there is no bound.
        mechanism: Mechanism v with L₁(v) = 1; None without a bound.
        solves: Number of linear systems solved.
        reason: Reason why there is no bound; empty if there is a bound.
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
        state: State at collapse; contact pairs with pressure in this state stay closed.
    """
    bound = KinematicBound(problem)
    try:
        return bound.of(velocity, state.active)
    finally:
        bound.destroy()


class KinematicBound:
    """Compute upper bounds from velocities, with forms that are compiled only once."""

    def __init__(self, problem: Problem) -> None:
        """Compile the forms if all laws have linear admissibility conditions. Collective."""
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
        self._size = LawExpression(
            laws, problem.Q, lambda on: ufl.sqrt(on.law.yields.resistance(rate, rate))
        )
        self._density = LawExpression(laws, problem.Q, lambda on: on.law.yields.support(rate))
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
        # Largest viscosity of regions that flow less than the mean, relative to the mean. The
        # method uses the second value if rounding errors spoil a flow.
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
        """Compute the flow of the bodies, and hold pairs until no open pair closes. Collective."""
        most_holds = 4  # rounds of holding the pairs that a mechanism would close
        for _ in range(most_holds + 1):
            self._descend(flow, held, stiff)
            if flow.hold(held):
                continue
            flow.make_admissible()
            if not flow.hold(held):
                return
        raise NoFlow("the mechanism closes open pairs")

    def _descend(self, flow: ViscousFlow, held: PairFlags, stiff: float) -> None:
        """Compute flows of the bodies until the bound no longer decreases. Collective."""
        bound = np.inf
        most_flows = 6  # flows from a velocity to a mechanism
        # Change of the bound in one flow, relative to the dissipation, below which the iteration
        # ends.
        settled = 1e-5
        for _ in range(most_flows):
            self._thicken(flow, stiff)
            flow.solve(held)
            power = self._power() + self._rubbed(flow)
            before, bound = bound, power - flow.dead_work()
            if abs(before - bound) <= settled * power:
                break

    def _thicken(self, flow: ViscousFlow, stiff: float) -> None:
        """Set the viscosity of the bodies from the present velocity. Collective."""
        size, density = self._values(self._size), self._values(self._density)
        mean = self._mean(size)
        if not mean > 0:
            raise NoFlow("nothing is strained")
        strength = np.divide(density, size, out=np.zeros_like(size), where=size > 0)
        viscosity = strength / np.maximum(size, mean / stiff)
        usual = self._mean(viscosity[viscosity > 0])
        if not usual > 0:
            raise NoFlow("nothing dissipates")
        viscosity[viscosity == 0] = usual  # no effect where the whole rate is inadmissible
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


Points = Sequence[tuple[float, float]]
"""Pairs (α, ζ) of levels, in ascending order of α."""


def tenfold_growth(points: Points) -> float:
    """Return the growth of ζ, relative to its last value, over the last tenfold increase of α.

    Returns:
        The growth; 1 if α has not increased tenfold since first yield.
    """
    alpha, zeta = points[-1]
    earlier = [z for a, z in points if a <= alpha / 10]
    return (zeta - earlier[-1]) / zeta if earlier else 1.0


def extrapolated_limit(points: Points) -> float | None:
    """Return ζ_∞ of ζ = ζ_∞ − c α^(−p) through three points.

    Returns:
        The limit; None if there are fewer than three points, if ζ grew only at the last of them, or
        if the curve hardly flattens (p would be below 0.05).
    """
    if len(points) < 3:
        return None
    (a, x), (b, y), (c, z) = points
    steady = 1e-11  # relative growth of ζ that counts as rounding
    if z - y <= steady * abs(z):
        return z
    if y - x <= 0:
        return None
    wanted = (z - y) / (y - x)

    def ratio(p: float) -> float:
        return float((1 - (c / b) ** -p) / ((a / b) ** -p - 1))

    low, high = 0.05, 50.0
    if wanted >= ratio(low):
        return None
    if wanted <= ratio(high):
        return z
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if ratio(middle) > wanted else (low, middle)
    return z + (z - y) / ((c / b) ** high - 1)


def not_level(points: Points, plastic_cells: int, degree: int, dilates: bool = False) -> str:
    """Return a message with the likely reason why a curve does not level off.

    Args:
        points: Pairs (α, ζ) of the levels.
        plastic_cells: Number of plastic cells at the last level.
        degree: Degree of the elements.
        dilates: Whether bodies dilate as they flow.
    """
    (first, _), (alpha, zeta) = points[0], points[-1]
    if plastic_cells == 0:
        return (
            f"ζ does not level off: nothing has yielded up to ζ = {zeta:.6g}; give the bodies"
            " that may collapse a yield stress"
        )
    told = (
        f"ζ does not level off: it has reached {zeta:.6g} and still rises at"
        f" {alpha / first:.3g} times the work at first yield; "
    )
    if dilates:
        return told + (
            "bodies that dilate in plastic flow may be confined by supports or by each other, and"
            " then carry any load; free a side of the bodies, or refine the mesh"
        )
    if degree == 1:
        return told + (
            "linear elements may lock, because plastic flow preserves volume, and the limit load of"
            " this mesh may be infinite; use quadratic elements (degree = 2 under [element])"
        )
    return told + (
        "the bodies may carry any multiple of the loads, or the mesh is too coarse; refine the mesh"
    )


FAR = 1e6
"""Largest work in a search, in multiples of the work at first yield."""


@dataclass
class Search:
    """The state of a search for a limit load, as plain data that a restart can read.

    Attributes:
        points: Pairs (α − α₀, ζ) of the levels.
        rest: Work α₀ at ζ = 0; None until this work is known, or if there are no loads at ζ = 0.
        estimates: Estimates of the limit load, one for each level that allows an estimate.
        upper: The smallest kinematic side so far, or with Coulomb's friction the smallest refused
            load; None if there is none.
        levelled_off: Whether the estimate is known to the tolerance.
        ended: Whether the search has ended.
        reason: Reason for the end.
        linear_solves: Number of linear systems solved.
    """

    points: list[tuple[float, float]] = field(default_factory=list)
    estimates: list[float] = field(default_factory=list)
    rest: float | None = None
    upper: float | None = None
    levelled_off: bool = False
    ended: bool = False
    reason: str = ""
    linear_solves: int = 0

    @property
    def lower(self) -> float:
        """Return the largest ζ of all levels; 0 without levels."""
        return max((zeta for _, zeta in self.points), default=0.0)

    @property
    def apart(self) -> float:
        """Return the relative difference between the bounds; ∞ without an upper bound.

        The result is also ∞ if the lower bound is not positive.
        """
        if self.upper is None or not self.lower > 0:
            return float("inf")
        return (self.upper - self.lower) / self.lower


class Judge:
    """Evaluate the bounds after each level, and decide whether to continue.

    Attributes:
        solves: Number of linear systems solved for bounds.
        mechanism: Mechanism of the smallest upper bound in this run; None without an upper bound.
    """

    def __init__(self, problem: Problem, rtol: float, search: Search) -> None:
        self._problem, self._rtol, self._search = problem, rtol, search
        self._bound: KinematicBound | None = None
        self._ahead: fem.Function | None = None
        self._asked = False
        self.solves = 0
        self.mechanism: fem.Function | None = None

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        if self._bound is not None:
            self._bound.destroy()

    def __call__(self, state: State, before: State | None, plastic_cells: int) -> None:
        """Add a level to the search, from its state and the state of the previous level.

        Collective.
        """
        search, points = self._search, self._search.points
        if before is None and not self._problem.is_elastic_at_first():
            search.rest = state.alpha
            return
        points.append((state.alpha - (search.rest or 0.0), state.zeta))
        self._look_ahead(before, state)
        self._decide(self._estimate())
        nearly = 1 - 1e-6  # share of the largest work from which this work counts as reached
        far = points[-1][0] >= nearly * FAR * points[0][0]
        most_levels = 60  # number of levels after which the search ends
        if not search.ended and (far or len(points) == most_levels):
            self._give_up(before, state, plastic_cells)

    def ahead(self, reached: Reached) -> Leap | None:
        """Return a leap along the mechanism of the last level; None without a mechanism.

        Collective.
        """
        if not self._asked:
            solves = self.solves
            self._look_ahead(reached.before, reached.last)  # the earlier run also did this,
            self.solves = solves  # and has already counted these solves
        if self._ahead is None:
            return None
        # Smallest and largest factor by which α increases in a leap along a known mechanism. If
        # ζ_lim − ζ decreases as α^(−1/2), a division of this gap by n needs n² times the work.
        stride, leap = 10.0, 100.0
        # largest number of Newton steps at a level after which a leap may exceed the stride
        easy = 10
        farthest = leap if reached.newton_iterations <= easy else stride
        growth = min(max((self._search.apart / self._rtol) ** 2, stride), farthest)
        end = FAR * self._search.points[0][0]
        far = min(growth * (reached.last.alpha - reached.rest), end)
        return Leap(reached.rest + far, self._ahead)

    def stop(self, before: State | None, last: State | None, why: str) -> None:
        """Conclude the search, because no further level converges. Collective."""
        search, problem = self._search, self._problem
        if last is not None:
            self._conclude(collapse_mechanism(problem, before, last), last)
        if not search.levelled_off:
            told = f"; {self._distance()}" if search.upper is not None else ""
            search.reason = f"no further level could be solved: {why}{told}"

    def _give_up(self, before: State | None, last: State, plastic_cells: int) -> None:
        """End a search that reached the largest work or number of levels. Collective."""
        search, points, rtol = self._search, self._search.points, self._rtol
        self._conclude(collapse_mechanism(self._problem, before, last), last)
        search.ended = True
        if search.levelled_off:
            return
        if search.upper is not None:
            times = points[-1][0] / points[0][0]
            search.reason = f"{self._distance()} at {times:.1e} times the work at first yield"
        elif extrapolated_limit(points[-3:]) is not None and tenfold_growth(points) <= rtol:
            search.levelled_off = True
            search.reason = (
                f"ζ grows by less than {rtol:g} of its value while the work grows tenfold"
            )
        else:
            dilates = any(on.law.dilates for on in self._problem.laws)
            search.reason = not_level(points, plastic_cells, self._problem.degree, dilates)

    def _conclude(self, velocity: fem.Function, last: State) -> None:
        """Reduce the difference between the bounds as far as possible without another level.

        Collective.
        """
        search = self._search
        velocity = self.mechanism or velocity
        # Largest number of improvements of the last mechanism if no level follows.
        most_flows = 8
        for _ in range(most_flows):
            apart = search.apart
            found = self._improve(velocity, last) if apart > self._rtol else None
            if found is None or not search.apart < apart - self._rtol / 10:
                break
            velocity = found
        self._decide(self._estimate(again=True))

    def _distance(self) -> str:
        return f"the bounds are still {self._search.apart:.1e} of ζ apart"

    def _look_ahead(self, before: State | None, last: State) -> None:
        """Compute the mechanism of the last level if ζ hardly increases. Collective."""
        self._asked, self._ahead = True, None
        last_two = [zeta for _, zeta in self._search.points[-2:]]
        # A level that increases ζ by less than this share indicates an incipient mechanism.
        flattest = 0.1
        if len(last_two) > 1 and last_two[1] - last_two[0] <= flattest * last_two[1]:
            velocity = collapse_mechanism(self._problem, before, last)
            self._ahead = self._improve(velocity, last)

    def _improve(self, velocity: fem.Function, state: State) -> fem.Function | None:
        """Return a mechanism close to a velocity; store its bound if it is the least so far.

        Collective.
        """
        if self._bound is None:
            self._bound = KinematicBound(self._problem)
        found, search = self._bound.of(velocity, state.active), self._search
        self.solves += found.solves
        if found.value is not None and (search.upper is None or found.value <= search.upper):
            search.upper, self.mechanism = found.value, found.mechanism
        return found.mechanism

    def _estimate(self, again: bool = False) -> float | None:
        """Store and return the mean of the bounds; without an upper bound, the extrapolated limit.

        With ``again``, the estimate replaces the last stored estimate.
        """
        search = self._search
        estimate = extrapolated_limit(search.points[-3:])
        if search.upper is not None:
            estimate = (search.lower + search.upper) / 2
        if again and estimate is not None and search.estimates:
            search.estimates.pop()
        if estimate is not None:
            search.estimates.append(estimate)
        return estimate

    def _decide(self, estimate: float | None) -> None:
        """Decide whether the estimate is accurate to the tolerance."""
        rtol, search = self._rtol, self._search
        search.levelled_off = False
        if search.apart < -rtol:
            search.ended = True
            search.reason = (
                f"ζ of a level is {-search.apart:.1e} above the load of a mechanism, because levels"
                " are in equilibrium only to a tolerance; give a smaller tolerance"
            )
        elif search.apart <= rtol:
            search.levelled_off = search.ended = True
            search.reason = f"both sides of the mesh are within {rtol:g} of each other"
        elif search.upper is None and estimate is not None and len(search.estimates) > 1:
            zeta, before = search.lower, search.estimates[-2]
            if estimate - zeta <= rtol * zeta and abs(estimate - before) <= rtol * zeta:
                search.levelled_off = search.ended = True
                search.reason = f"ζ has levelled off to {rtol:g} of its limit"


def collapse_mechanism(problem: Problem, before: State | None, last: State | None) -> fem.Function:
    """Return the last displacement increment, scaled to L₁(v) = 1; zero without an increment.

    Collective.
    """
    v = fem.Function(problem.V, name="mechanism")
    if last is None or (before is None and not problem.is_elastic_at_first()):
        return v
    v.x.array[:] = last.u.x.array
    if before is not None:
        v.x.array[:] -= before.u.x.array
    v.x.array[:] /= problem.loads.alpha(v.x.petsc_vec)
    return v
