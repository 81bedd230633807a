"""The interface of a control: keys of ``[loading]``, their checks, and the way to the answer.

A control is a frozen dataclass whose fields are the keys beside ``control``. It follows levels, as
``control = "load"`` does, or looks for a limit. It hands results to the :class:`Record` of the run,
which writes and shows them. :class:`OfLevels` and :class:`OfBody` have what most of either kind
have in common.
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
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.next_work import Reached

Moved = Callable[[str, str], bool]
"""Whether the loading moves what has a name, which may be empty, and a surface."""


class Record(Protocol):
    """Where a control hands on what it finds: written, shown and logged. All are collective.

    Each but ``plan`` may end the run by an exception where a signal has come.
    """

    def plan(self, levels: int) -> None:
        """How many levels there will be."""

    def iteration(self, record: Iteration) -> None:
        """A step of an algorithm within a level."""

    def level(self, level: Level, search: Search | None = None) -> None:
        """A level, and what is known of a limit load that is looked for."""

    def interior(self, step: InteriorStep) -> None:
        """A step of the interior point method."""

    def mesh(self, round_: Round) -> None:
        """The bounds on a mesh of several."""

    def so_far(self, adaptive: AdaptiveBounds) -> None:
        """The bounds on the meshes before another one is solved."""

    def factor(self, factor: float, lower: Bound, upper: Bound) -> None:
        """Bounds with strengths that are divided by a factor."""

    def limit(
        self,
        limit: LimitLoad,
        body: BodyBounds | None = None,
        adaptive: AdaptiveBounds | None = None,
    ) -> None:
        """A limit load, and what is proven of the body; of several meshes the best."""

    def safety(self, found: FactorOfSafety) -> None:
        """A factor of safety."""

    def direction(
        self, angles: Angles, low: BodyBounds, high: BodyBounds, prove: Proving
    ) -> Proven:
        """Return the bounds that are proven in a direction of an envelope."""

    def envelope(self, found: Envelope, names: Sequence[str]) -> None:
        """Which multiples of loads, with these names, are carried."""

    def shakedown(self, found: ShakedownLoad, diagram: Sequence[Direction]) -> None:
        """A shakedown load, and those of directions between two of what varies."""


@dataclass(frozen=True)
class Run:
    """The objects that a control works with.

    Attributes:
        problem: The problem that is solved.
        solver: The algorithm of ``[solve]``; None where the interior point method is to answer.
        record: Receives the results.
        adapt: How the mesh is adapted; None where it is not.
        history: The loading history; None without stages.
        start: The state that the run goes on from; None for a new run.
        before: The state of the level before that, where there is one.
        done: Levels that are on file.
        search: State of the search for a limit load.
        reached: How far a loading by chosen steps has come with these.
        directions: Directions of an envelope that are on file.
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
        prescribes: What levels prescribe, or multiplies the loads.
        element: Defaults of ``[element]``.
        drives: ζ multiplies motions of supports and obstacles, and not loads.
        of_body: What holds for the bodies is asked for, not for their mesh alone.
        divides: Strengths are divided by a factor, but for those with ``reduced = false``.
        together: One load factor ζ multiplies all that grows; else what varies has factors of its
            own.
    """

    prescribes: ClassVar[Prescribed]
    element: ClassVar[Mapping[str, Any]]
    drives: ClassVar[bool]
    of_body: ClassVar[bool]
    divides: ClassVar[bool]
    together: ClassVar[bool]

    @property
    def values(self) -> Sequence[float] | None:
        """Values of the levels, if they are given."""

    @property
    def limit_tolerance(self) -> float | None:
        """Relative tolerance of a limit load; None if the control seeks none."""

    @property
    def limit_method(self) -> str | None:
        """How a limit load is found; None leaves it to the problem."""

    @property
    def design(self) -> float | None:
        """Load factor of the design load, if given."""

    def in_turn(self) -> Sequence[Stage]:
        """Return the stages of a loading history; none elsewhere."""

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return which motions follow the loading."""

    def check(self, given: Given) -> None:
        """Refuse what does not go with it.

        Raises:
            InputError: Naming what does not fit.
        """

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on a problem before the interior point method begins. Collective."""

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse what :meth:`find` would refuse of a problem before it solves. Collective.

        Args:
            problem: The bodies, their loads, supports and contacts.
            solver: The algorithm of ``[solve]``; None where the interior point method is to answer.

        Raises:
            InputError: Naming what does not fit.
        """

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return what bounds of ζ mean, in a sentence; empty where they are a load factor.

        Args:
            lower: Strict lower bound; None without one.
            upper: Strict upper bound; None without one.
        """

    def find(self, run: Run) -> LimitLoad | None:
        """Find the answer, and hand it on. Collective.

        Returns:
            The limit load; None of levels, each of which says by itself whether it is solved.

        Raises:
            InputError: If it cannot answer the problem.
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
        """None."""
        return ()

    def remarks(self, problem: Problem) -> Sequence[str]:
        """None."""
        return ()

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse nothing: the solver checks what levels need."""

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return no sentence: ζ is a load factor."""
        return ""


class OfBody:
    """Base of controls that ask for bounds of the bodies."""

    prescribes: ClassVar[Prescribed] = Prescribed.WORK  # L(v) = 1
    element: ClassVar[Mapping[str, Any]] = {"degree": 2}  # linear ones lock
    drives: ClassVar[bool] = False
    of_body: ClassVar[bool] = True
    divides: ClassVar[bool] = False
    together: ClassVar[bool] = True
    values: ClassVar[None] = None
    limit_method: ClassVar[LimitMethod] = LimitMethod.INTERIOR_POINT

    def in_turn(self) -> Sequence[Stage]:
        """None."""
        return ()

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """None."""
        return none_moved

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return remarks on data that do not change the limit load. Collective."""
        return [*ignored(problem), *idle_pores(problem)]

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return no sentence: ζ is a load factor."""
        return ""


def none_moved(name: str, on: str) -> bool:
    """Nothing is moved by the loading."""
    return False


def all_moved(name: str, on: str) -> bool:
    """Return all that moves follows the loading."""
    return True
