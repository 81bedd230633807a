"""Define the interface of a control: keys of ``[loading]``, their checks, and the computation.

A control is a frozen dataclass whose fields are the keys beside ``control``. A control follows
levels, as ``control = "load"`` does, or computes a limit. It hands results to the :class:`Record`
of the run, which writes and shows them. :class:`OfLevels` and :class:`OfBody` implement the common
methods of each kind.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds, Round
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.interaction import Angles, Envelope, Proven, Proving
from perfplast_fenicsx.limit_analysis.body.safety_factor import FactorOfSafety
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.limit_analysis.shakedown.diagram import Direction
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_result import ShakedownLoad
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.limit_analysis.statements.limit_checks import idle_pores, ignored
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.state import Iteration, Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.load_stepping import Reached

Moved = Callable[[str, str], bool]
"""Function of a name, which may be empty, and a surface: whether the loading moves it."""


class Record(Protocol):
    """The receiver of the results of a control, which writes, shows and logs them.

    All methods are collective.

    Each except ``plan`` may end the run by an exception after a signal.
    """

    def plan(self, levels: int) -> None:
        """Announce the number of levels."""

    def iteration(self, record: Iteration) -> None:
        """Record a step of an algorithm within a level."""

    def level(self, level: Level, search: Search | None = None) -> None:
        """Record a level and the state of the search for a limit load."""

    def interior(self, step: InteriorStep) -> None:
        """Record a step of the interior point method."""

    def mesh(self, round_: Round) -> None:
        """Record the bounds on one of several meshes."""

    def so_far(self, adaptive: AdaptiveBounds) -> None:
        """The bounds on the meshes before another one is solved."""

    def factor(self, factor: float, lower: Bound, upper: Bound) -> None:
        """Record bounds with strengths that are divided by a factor."""

    def limit(
        self,
        limit: LimitLoad,
        body: BodyBounds | None = None,
        adaptive: AdaptiveBounds | None = None,
    ) -> None:
        """Record a limit load and what is proven of the body; with several meshes the best."""

    def safety(self, found: FactorOfSafety) -> None:
        """Record a factor of safety."""

    def direction(
        self, angles: Angles, low: BodyBounds, high: BodyBounds, prove: Proving
    ) -> Proven:
        """Return the bounds that are proven in a direction of an envelope."""

    def envelope(self, found: Envelope, names: Sequence[str]) -> None:
        """Record which multiples of the loads with these names are carried."""

    def shakedown(self, found: ShakedownLoad, diagram: Sequence[Direction]) -> None:
        """Record a shakedown load, and those in directions between two varying loads."""


@dataclass(frozen=True)
class Run:
    """The objects that a control uses.

    Attributes:
        problem: The problem that is solved.
        solver: The algorithm of ``[solve]``; None for the interior point method.
        record: Receives the results.
        adapt: How the mesh is adapted; None without adaptation.
        history: The loading history; None without stages.
        start: The state from which the run continues; None for a new run.
        before: The state of the level before ``start``, if there is one.
        done: Levels that are already on file.
        search: State of the search for a limit load.
        reached: Progress of a loading with chosen steps in these levels.
        directions: Directions of an envelope that are already on file.
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
        element: Defaults of ``[element]``.
        drives: Whether ζ multiplies motions of supports and obstacles instead of loads.
        of_body: Whether the answer holds for the bodies, not only for their mesh.
        divides: Whether a factor divides strengths, except those with ``reduced = false``.
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
        """Return the values of the levels, if they are given."""

    @property
    def limit_tolerance(self) -> float | None:
        """Return the relative tolerance of a limit load; None if the control computes none."""

    @property
    def limit_method(self) -> str | None:
        """Return the method for a limit load; None lets the problem decide."""

    @property
    def design(self) -> float | None:
        """Return the load factor of the design load, if given."""

    def in_turn(self) -> Sequence[Stage]:
        """Return the stages of a loading history; empty for other controls."""

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return which motions follow the loading."""

    def check(self, given: Given) -> None:
        """Refuse declarations that do not fit the control.

        Raises:
            InputError: Naming the declaration that does not fit.
        """

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on a problem before the interior point method begins. Collective."""

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems that :meth:`find` would refuse, before it solves. Collective.

        Args:
            problem: The bodies, their loads, supports and contacts.
            solver: The algorithm of ``[solve]``; None for the interior point method.

        Raises:
            InputError: Naming the declaration that does not fit.
        """

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return the meaning of bounds of ζ in a sentence; empty if ζ is a load factor.

        Args:
            lower: Strict lower bound; None without one.
            upper: Strict upper bound; None without one.
        """

    def find(self, run: Run) -> LimitLoad | None:
        """Compute the answer and pass it to the record. Collective.

        Returns:
            The limit load; None for levels, each of which reports whether it is solved.

        Raises:
            InputError: If the control cannot solve the problem.
        """


class OfLevels:
    """Base of controls that follow levels."""

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
        """Do nothing: the solver checks the requirements of levels."""

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return no sentence: ζ is a load factor."""
        return ""


class OfBody:
    """Base of controls that compute bounds of the bodies."""

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
        """Return a function that is always False."""
        return none_moved

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on data that do not affect the limit load. Collective."""
        return [*ignored(problem), *idle_pores(problem)]

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return no sentence: ζ is a load factor."""
        return ""


def none_moved(name: str, on: str) -> bool:
    """Return False: the loading moves nothing."""
    return False


def all_moved(name: str, on: str) -> bool:
    """Return True: every motion follows the loading."""
    return True
