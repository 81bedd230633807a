"""Both bounds at once on two ranks, each on its own copy of the mesh.

Two ranks together are hardly faster than one alone at what a bound takes most of, factorisations.
So each seeks one bound, and waits for the other only where steps are reported. What is found is
handed back to the mesh that both share (benchmarks/halves_at_once.py measures the saving).
"""

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from perfplast_fenicsx.limit_analysis.body.copied_results import Copied
from perfplast_fenicsx.limit_analysis.body.flow_problem import (
    FlowProblem,
    flow_problem,
    is_straight,
)
from perfplast_fenicsx.limit_analysis.body.meeting import Meeting
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.facets.associated_slip import with_strict_contact
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.stress.standing_stress import bound_by_stress
from perfplast_fenicsx.limit_analysis.stress.static_bound import form_that_fits
from perfplast_fenicsx.limit_analysis.stress.static_stress import StaticBound
from perfplast_fenicsx.machine_memory import spare_memory
from perfplast_fenicsx.mesh.whole_mesh import WholeMesh, whole_mesh
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)

Steps = Callable[[InteriorStep], None] | None


@dataclass(frozen=True)
class Halves:
    """The results of both ranks, on the mesh that they share.

    Attributes:
        flow: Where the mechanism was looked for.
        limit: With the mechanism, as :func:`discrete_limit.interior_point` returns it.
        static: The lower bound with its stress.
        question: Of which loads that is.
    """

    flow: FlowProblem
    limit: LimitLoad
    static: StaticBound
    question: Question


def pays(below: Problem, above: Problem) -> bool:
    """Whether both bounds are found sooner at once (benchmarks/halves_at_once.py). Collective."""
    comm, dim = below.comm, below.bodies.gdim
    cells = below.tagged_mesh.mesh.topology.index_map(dim).size_global
    # Fewer cells take less than a second in any case; of more two ranks do have the faster
    # factorisations, or it was not measured.
    few, many = ((1_000, 100_000), (250, 10_000))[dim - 2]
    of_a_cell = (25e3, 250e3)[dim - 2]  # bytes for a half; 17 and 230 kB were measured at most
    ranks = 2
    if comm.size != ranks or not few <= cells <= many or not is_straight(above):
        return False
    if not (below.as_declared and above.as_declared):
        return False
    return of_a_cell * cells <= 1e6 * spare_memory(comm)


def halves_at_once(below: Problem, above: Problem, rtol: float, monitor: Steps) -> Halves | None:
    """Seek the stress of one problem and the mechanism of another, each on one rank. Collective.

    Args:
        below: The bodies of the lower bound.
        above: Those of the upper one, on the same mesh.
        rtol: How near each bound comes to the best of its kind on this mesh, relative.
        monitor: Called on both ranks after each step of either.

    Returns:
        What was found; None where a half does not fit into memory.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`, on both ranks.
        StopSearch: Of the monitor, with the limit load as far as it is known.
    """
    comm, shared = below.comm, below.tagged_mesh
    copy, meeting = whole_mesh(shared), Meeting(below.comm, monitor)
    log.info(
        "both bounds at once, each on one rank; of two steps the upper one's is reported first"
    )
    question = Question.LIMIT if below.loads.grows() else Question.STANDS
    mechanism, stress = _Mechanism(above, copy), _Stress(below, copy, question)
    upper, lower = 0, 1  # the ranks that seek them
    mine = mechanism if comm.rank == upper else stress
    with ExitStack() as made:
        if not meeting.after(partial(mine.prepare, made)):
            return None
        flow, copied = flow_problem(above), Copied(shared, copy)
        try:
            fits = meeting.after(partial(mine.find, rtol, meeting.monitor))
        except StopSearch as stop:
            known = stop.found if isinstance(stop.found, LimitLoad) else mechanism.found
            stop.found = copied.limit(upper, flow, mechanism.flow, known)
            raise
    if not fits:
        return None
    limit = copied.limit(upper, flow, mechanism.flow, mechanism.found)
    assert limit is not None
    return Halves(flow, limit, copied.stress(lower, stress.found), question)


class _Mechanism:
    """The half of the upper bound."""

    flow: FlowProblem | None = None
    found: LimitLoad | None = None

    def __init__(self, problem: Problem, copy: WholeMesh) -> None:
        self._problem, self._copy = problem, copy

    def prepare(self, _: ExitStack) -> None:
        """Make the problem on the copy."""
        self.flow = flow_problem(self._problem.on(self._copy))
        self._strict = with_strict_contact(self.flow.problem)

    def find(self, rtol: float, steps: Steps) -> None:
        """Find the mechanism."""
        self.found = interior_point(self._strict, rtol, steps)


class _Stress:
    """The half of the lower bound."""

    found: StaticBound | None = None

    def __init__(self, problem: Problem, copy: WholeMesh, question: Question) -> None:
        self._problem, self._copy, self._question = problem, copy, question

    def prepare(self, made: ExitStack) -> None:
        """Make the problem on the copy, and see whether it fits into memory."""
        self._on = self._problem.on(self._copy)
        self._form = form_that_fits(self._on)
        if self._form is not None:
            made.callback(self._form.destroy)

    def find(self, rtol: float, steps: Steps) -> None:
        """Find the stress."""
        self.found = bound_by_stress(self._on, rtol, steps, self._question, self._form)
