"""Store a state of the bodies and the load level that ends with it; record accumulated slip."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.judged.report import Iteration, LevelReport
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.tables import NotebookResult, Row, notebook_table


@dataclass(frozen=True)
class State:
    """Displacement at a load, with the data to start the next solve.

    Attributes:
        u: Displacement (length).
        zeta: Load factor ζ.
        alpha: Work of the live loads α = L₁(u).
        active: Closed contact pairs hosted by this rank, shape (num_pairs,).
        history: Internal variables of the laws by name, as functions at the quadrature points;
            empty if the laws have none.
    """

    u: fem.Function
    zeta: float
    alpha: float
    active: PairFlags
    history: Mapping[str, fem.Function] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"State(zeta={self.zeta:.6g}, alpha={self.alpha:.6g})"


@dataclass(frozen=True)
class Level:
    """A load level. If the level has not converged, its state must not start another level.

    Attributes:
        state: State at the end of the level.
        stress: σ = Σ(ε(u)), Mandel vectors (:mod:`mandel`) at the quadrature points.
        contact_forces: Contact forces of the pairs hosted by this rank (force), positive in
            compression, shape (num_pairs,).
        report: Report of the level.
        iterations: Records of the steps.
        refuted: Whether the level ended with the verdict that no equilibrium exists for the
            friction bounds of the iteration, rather than without convergence.
    """

    state: State
    stress: fem.Function
    contact_forces: Floats
    report: LevelReport
    iterations: list[Iteration] = field(default_factory=list)
    refuted: bool = False

    def __repr__(self) -> str:
        return f"Level({self.report.summary()})"

    def _repr_html_(self) -> str:
        """Return the report of the level as a table."""
        return notebook_table("Load level", [*vars(self.report).items()])


@dataclass(frozen=True, init=False)
class LoadingPath(NotebookResult):
    """Levels in the order in which they were solved, as a table and a curve.

    Attributes:
        levels: The levels.
    """

    levels: tuple[Level, ...]

    def __init__(self, levels: Iterable[Level]) -> None:
        """Collect levels; an iterator such as :func:`load_path` solves them now. Collective."""
        object.__setattr__(self, "levels", tuple(levels))

    def __iter__(self) -> Iterator[Level]:
        return iter(self.levels)

    def __len__(self) -> int:
        return len(self.levels)

    def __repr__(self) -> str:
        return f"LoadingPath({len(self.levels)} levels)"

    def in_words(self) -> str:
        """Return how many levels are solved, and the reason if the last level has no solution."""
        solved = sum(level.report.converged for level in self.levels)
        words = f"{solved} of {len(self.levels)} levels are solved"
        if solved == len(self.levels):
            return f"{words}."
        return f"{words}; the last one has no solution: {self.levels[-1].report.reason}."

    def rows(self) -> list[Row]:
        """Return a row for each level: its number ``level``, and :meth:`LevelReport.row`."""
        return [{"level": k, **level.report.row()} for k, level in enumerate(self.levels, 1)]

    def draw_into(self, axes: Any) -> None:
        """Draw the load factor over the work of the growing loads, for the solved levels."""
        solved = [level.report for level in self.levels if level.report.converged]
        axes.plot([it.alpha for it in solved], [it.zeta for it in solved], "o-")
        axes.set(xlabel="work of the growing loads, alpha", ylabel="load factor, zeta")
        axes.grid(alpha=0.3)


def slipped(problem: Problem, state: State) -> Floats:
    """Return the slip from the initial position (length), shape (num_places, gdim − 1).

    Collective.

    Args:
        problem: Problem with friction.
        state: State of the problem.
    """
    y = problem.create_vector()
    problem.basis.M.mult(state.u.x.petsc_vec, y)
    slip = problem.friction.jumps(y) - problem.motion.slide_at(state.zeta)
    y.destroy()
    return slip


def remember_slip(problem: Problem, start: State | None) -> None:
    """In stages, set the origin of slip to the state from which a level starts. Collective.

    Without stages, a level is one step from rest for any initial state of its iteration.

    Args:
        problem: The problem, already moved to the load factor of the level.
        start: The initial state; None for the state at rest.
    """
    if problem.in_stages and problem.friction.count and start is not None:
        problem.friction.origin[:] += slipped(problem, start)


def check_slip_is_true(problem: Problem) -> None:
    """Refuse friction with associated slip, which levels and paths do not support.

    Raises:
        InputError: If friction is associated.
    """
    for it in (*problem.given.contacts, *problem.given.obstacles):
        if it.associated:
            raise InputError(
                f"the friction at '{it.on}' is associated, so slipping surfaces separate, which is "
                "supported only in bounds for the body; give control = 'bounds', or remove "
                "associated."
            )
