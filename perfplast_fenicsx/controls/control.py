"""Define the interface of a control: keys of ``[loading]``, their checks, and the computation.

A control is a frozen dataclass whose fields are the keys of the table other than ``control``. A
control either solves load levels, as ``control = "load"`` does, or computes a limit. It passes its
results to the :class:`Record` of the run, which writes and displays them. :class:`OfLevels` and
:class:`OfBody` implement the methods that controls of each kind share.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar, Protocol

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds, Round
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.interaction import Angles, Envelope, Proven, Proving
from perfplast_fenicsx.limit_analysis.body.safety_factor import FactorOfSafety
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import Direction, ShakedownLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_something_yields,
    idle_pores,
    ignored,
)
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Mover, Stage, follows
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.load_stepping import Reached, load_path, rests_first


@contextmanager
def of_other_loads(known: AdaptiveBounds | None = None) -> Iterator[None]:
    """Discard the partial result of an inner search if a signal stops the search.

    The loads or strengths of an inner search differ from the loads or strengths of the case.
    Therefore its partial result does not hold for the case.

    Args:
        known: The answer so far, which is reported instead of the partial result.

    Raises:
        StopSearch: With the known answer, if a signal stops the search.
    """
    try:
        yield
    except StopSearch as stop:
        stop.found, stop.adapted = None, known
        raise


@dataclass(frozen=True)
class Given:
    """The declarations of a case that a control checks.

    Attributes:
        loads: The loads.
        supports: Supports, and rigid surfaces that hold or move the bodies.
        obstacles: Rigid obstacles.
        contacts: Contacts, some of which may have a growing overlap.
        strained: Whether the bodies have initial strains or an overlap.
        initial: Initial strains and stresses.
        materials: Materials of the bodies by name.
    """

    loads: Sequence[Load]
    supports: Sequence[Support | RigidSurface]
    obstacles: Sequence[Obstacle]
    contacts: Sequence[Contact]
    strained: bool
    initial: Sequence[Initial] = ()
    materials: Mapping[str, object] = field(default_factory=dict)

    @property
    def movers(self) -> tuple[Mover, ...]:
        """Return all objects that may move or have a growing overlap."""
        return (*self.supports, *self.obstacles, *self.contacts)

    @property
    def moving(self) -> bool:
        """Return whether the loading multiplies any motion or overlap."""
        return any(follows(mover) for mover in self.movers)

    @property
    def settled(self) -> bool:
        """Return whether a support has a prescribed motion."""
        return any(support.moves for support in self.supports)

    @property
    def stays(self) -> bool:
        """Return whether initial strains, overlaps, prescribed motions or constant loads act."""
        return self.strained or self.settled or any(load.constant for load in self.loads)

    def require_load(self, enough: bool = False) -> None:
        """Refuse cases without loads.

        Args:
            enough: Whether the case has something other than a load that suffices for the control.

        Raises:
            InputError: If there is no load and ``enough`` is False.
        """
        if not self.loads and not enough:
            raise InputError(
                "no load is given; add a [[load]] table. Without a load, control = 'load' needs "
                "an interference, a temperature, an initial stress, a bolt or a constant "
                "displacement; control = 'displacement' or stages need motions that grow."
            )

    def require_limit(self) -> None:
        """Refuse cases in which nothing limits the load.

        Raises:
            InputError: If no body can yield, and there are no contacts and no obstacles.
        """
        touching = bool(self.contacts or self.obstacles)
        check_something_yields(self.materials.values(), touching)

    def refuse_moves(self) -> None:
        """Refuse obstacles that move.

        Raises:
            InputError: If an obstacle moves; the message names the first such obstacle.
        """
        for obstacle in self.obstacles:
            if any(obstacle.move):
                raise InputError(
                    f"the obstacle at '{obstacle.on}' has a move, which follows the load factor "
                    "only under control = 'displacement' or in stages; use one of the two, or "
                    "remove move."
                )


Moved = Callable[[str, str], bool]
"""Function of the name (possibly empty) and the surface of an object. It returns whether the
loading moves this object.
"""


class Record(Protocol):
    """The receiver of the results of a control, which writes, shows and logs them.

    All methods are collective. Each method except ``plan`` may raise an exception after a signal,
    to end the run.
    """

    def plan(self, levels: int) -> None:
        """Announce the number of levels that the run will solve."""

    def iteration(self, record: Iteration) -> None:
        """Record one iteration of an algorithm within a level."""

    def level(self, level: Level, search: Search | None = None) -> None:
        """Record a level and the state of the search for a limit load."""

    def interior(self, step: InteriorStep) -> None:
        """Record one step of the interior-point method."""

    def mesh(self, round_: Round) -> None:
        """Record the bounds on one mesh of an adaptive refinement."""

    def so_far(self, adaptive: AdaptiveBounds) -> None:
        """Record the bounds on the meshes so far, before the next mesh is solved."""

    def factor(self, factor: float, lower: Bound, upper: Bound, cells: int) -> None:
        """Record bounds on the load factor for strengths divided by ``factor``, and the cells."""

    def estimate(self, factor: float, times: float | None, cells: int) -> None:
        """Record ``times``, an estimate of the load factor for strengths divided by ``factor``."""

    def limit(
        self,
        limit: LimitLoad,
        body: BodyBounds | None = None,
        adaptive: AdaptiveBounds | None = None,
    ) -> None:
        """Record the limit load of a mesh (of several, the best) and proven bounds of the body."""

    def safety(self, found: FactorOfSafety) -> None:
        """Record a factor of safety."""

    def direction(
        self, angles: Angles, low: BodyBounds, high: BodyBounds, prove: Proving
    ) -> Proven:
        """Prove, record and return the bounds in one direction of an envelope."""

    def envelope(self, found: Envelope, names: Sequence[str]) -> None:
        """Record the set of multiples of the named loads that the bodies carry."""

    def shakedown(self, found: ShakedownLoad, diagram: Sequence[Direction]) -> None:
        """Record a shakedown load, and the loads in directions between two varying loads."""


@dataclass(frozen=True)
class Run:
    """The objects that a control uses in a run.

    Attributes:
        problem: The problem that is solved.
        solver: The algorithm of ``[solve]``; None for the interior point method.
        record: Receiver of the results.
        adapt: Parameters of the mesh adaptation; None without adaptation.
        history: The loading history; None without stages.
        start: The state from which the run continues; None for a new run.
        before: The state of the level before ``start``, if there is one.
        done: Number of levels that are already stored.
        search: State of the search for a limit load.
        reached: Progress, within these levels, of a loading whose steps the program chooses.
        directions: Directions of an envelope that are already stored.
    """

    problem: Problem
    solver: Any
    record: Record
    adapt: Adaptation | None = None
    history: LoadingHistory | None = None
    start: State | None = None
    before: State | None = None
    done: int = 0
    search: Search | None = None
    reached: Reached | None = None
    directions: Sequence[Proven] = ()


class Control(Protocol):
    """A control of ``[loading]``.

    Attributes:
        prescribes: The quantity that levels prescribe, or that multiplies the loads.
        element: Default values of ``[element]``.
        drives: Whether ζ multiplies the motions of supports and obstacles instead of the loads.
        of_body: Whether the result holds for the bodies, not only for their mesh.
        divides: Whether a factor divides all strengths except those with ``reduced = false``.
        together: Whether one load factor ζ multiplies all loads that grow; otherwise each has its
            own factor.
    """

    prescribes: ClassVar[Prescribed]
    element: ClassVar[Mapping[str, Any]]
    drives: ClassVar[bool]
    of_body: ClassVar[bool]
    divides: ClassVar[bool]
    together: ClassVar[bool]

    @property
    def values(self) -> Sequence[float] | None:
        """Return the values of the levels; None if they are not given."""

    @property
    def limit_tolerance(self) -> float | None:
        """Return the relative tolerance of a limit load; None if the control computes none."""

    @property
    def limit_method(self) -> str | None:
        """Return the method for a limit load; None if the program chooses it for the problem."""

    @property
    def design(self) -> float | None:
        """Return the load factor of the design load; None if it is not given."""

    def in_turn(self) -> Sequence[Stage]:
        """Return the stages of a loading history in order; empty for other controls."""

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that states whether the loading moves an object."""

    def check(self, given: Given) -> None:
        """Refuse declarations that do not fit the control.

        Raises:
            InputError: If a declaration does not fit; the message names it.
        """

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on a problem before the interior-point method begins. Collective."""

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems that :meth:`find` would refuse, before anything is solved. Collective.

        Args:
            problem: The bodies, their loads, supports and contacts.
            solver: The algorithm of ``[solve]``; None for the interior point method.

        Raises:
            InputError: If a declaration does not fit; the message names it.
        """

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return a sentence that explains the bounds on ζ; empty if ζ is a load factor.

        Args:
            lower: Strict lower bound; None if there is no lower bound.
            upper: Strict upper bound; None if there is no upper bound.
        """

    def find(self, run: Run) -> LimitLoad | None:
        """Compute the result and pass it to the record. Collective.

        Returns:
            The limit load; None for levels, each of which reports whether it is solved.

        Raises:
            InputError: If the control cannot solve the problem.
        """


class OfLevels:
    """Base of controls that solve load levels."""

    element: ClassVar[Mapping[str, Any]] = {}
    of_body: ClassVar[bool] = False
    divides: ClassVar[bool] = False
    together: ClassVar[bool] = True
    limit_tolerance: ClassVar[None] = None
    limit_method: ClassVar[None] = None
    design: ClassVar[None] = None

    def in_turn(self) -> Sequence[Stage]:
        """Return no stages."""
        return ()

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return no remarks."""
        return ()

    def admit(self, problem: Problem, solver: Any) -> None:
        """Do nothing, because the solver itself checks the problem."""

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return an empty text, because ζ is a load factor."""
        return ""


class OfBody:
    """Base of controls that compute bounds for the bodies."""

    prescribes: ClassVar[Prescribed] = Prescribed.WORK  # scaled so that L(v) = 1
    element: ClassVar[Mapping[str, Any]] = {"degree": 2}  # linear elements lock
    drives: ClassVar[bool] = False
    of_body: ClassVar[bool] = True
    divides: ClassVar[bool] = False
    together: ClassVar[bool] = True
    values: ClassVar[None] = None
    limit_method: ClassVar[LimitMethod] = LimitMethod.INTERIOR_POINT

    def in_turn(self) -> Sequence[Stage]:
        """Return no stages."""
        return ()

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that always returns False."""
        return none_moved

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on data that do not affect the limit load. Collective."""
        return [*ignored(problem), *idle_pores(problem)]

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return an empty text, because ζ is a load factor."""
        return ""


def none_moved(name: str, on: str) -> bool:
    """Return False, because the loading moves nothing."""
    return False


def all_moved(name: str, on: str) -> bool:
    """Return True, because every motion follows the loading."""
    return True


def check_values(
    values: Sequence[float], what: str, falling: str = "or, with constant loads, all decrease"
) -> None:
    """Refuse missing values, and values that are not finite or neither increase nor decrease.

    Args:
        values: Values of the levels.
        what: Name of the values in messages.
        falling: Words of the message that say under which condition the values may decrease.

    Raises:
        InputError: If there are no values, or if a value is not valid; the message then names the
            first such value.
    """
    if not values:
        raise InputError(f"values is empty, but {what} are needed; give at least one number.")
    for value in values:
        if not math.isfinite(value):
            raise InputError(
                f"values contains {value}, but {what} must be finite numbers; correct this value."
            )
    falls = len(values) > 1 and values[1] < values[0]
    for before, value in pairwise(values):
        if value == before or (value < before) != falls:
            raise InputError(
                f"values contains {value} after {before}, but {what} must increase ({falling}); "
                "sort the values and give each value once."
            )


def check_rising(values: Sequence[float], what: str) -> None:
    """Refuse negative or decreasing values in a case without constant loads.

    Args:
        values: Values of the levels, as for :func:`check_values`.
        what: Name of the values in messages.

    Raises:
        InputError: If a value is negative, or if the values decrease.
    """
    for value in values:
        if value < 0:
            raise InputError(
                f"values contains {value}, but without constant loads {what} must be >= 0; correct "
                "this value."
            )
    if len(values) > 1 and values[1] < values[0]:
        raise InputError(
            f"values contains {values[1]} after {values[0]}, but without constant loads {what} "
            "must increase; sort the values and give each value once."
        )


def follow(run: Run, values: Sequence[float]) -> None:
    """Solve the levels whose results are not stored yet. Collective.

    Args:
        run: The run.
        values: Values of all levels.
    """
    rests = rests_first(run.solver, values)
    run.record.plan(len(values) + rests)
    left = values if run.start is None else values[run.done - rests :]
    for level in load_path(run.solver, left, run.record.iteration, run.start, run.before):
        run.record.level(level)
