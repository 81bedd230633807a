"""Compute both bounds in parallel on two ranks, each on its own copy of the mesh.

Factorisations dominate the cost of a bound, and two ranks are hardly faster at them than one. So
each rank computes one bound, and waits for the other only when steps are reported. Results are
transferred to the mesh that both ranks share (benchmarks/halves_at_once.py measures the saving).
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
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
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
        flow: Flow problem of the mechanism.
        limit: Limit load with the mechanism, as :func:`discrete_limit.interior_point` returns it.
        static: The lower bound with its stress.
        question: The loads of the lower bound.
    """

    flow: FlowProblem
    limit: LimitLoad
    static: StaticBound
    question: Question


def pays(below: Problem, above: Problem) -> bool:
    """Return whether computing both bounds in parallel is faster (benchmarks/halves_at_once.py).

    Collective.
    """
    comm, dim = below.comm, below.bodies.gdim
    cells = below.tagged_mesh.mesh.topology.index_map(dim).size_global
    # Fewer cells take less than a second in any case. With more, two ranks factorise faster
    # together, or it was not measured.
    few, many = ((1_000, 100_000), (250, 10_000))[dim - 2]
    of_a_cell = (25e3, 250e3)[
        dim - 2
    ]  # bytes per cell for each half; at most 17 and 230 kB were measured
    ranks = 2
    if comm.size != ranks or not few <= cells <= many or not is_straight(above):
        return False
    if not (below.as_declared and above.as_declared):
        return False
    return of_a_cell * cells <= 1e6 * spare_memory(comm)


def halves_at_once(below: Problem, above: Problem, rtol: float, monitor: Steps) -> Halves | None:
    """Compute the stress of one problem and the mechanism of another, each on one rank. Collective.

    Args:
        below: The bodies of the lower bound.
        above: The bodies of the upper bound, on the same mesh.
        rtol: Relative distance of each bound to the best of its kind on this mesh.
        monitor: Called on both ranks after each step of either.

    Returns:
        The results; None if a half does not fit into memory.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`, on both ranks.
        StopSearch: From the monitor, with the limit load as far as it is known.
    """
    comm, shared = below.comm, below.tagged_mesh
    copy, meeting = whole_mesh(shared), Meeting(below.comm, monitor)
    log.info(
        "both bounds in parallel, each on one rank; of two steps the upper one's is reported first"
    )
    question = Question.LIMIT if below.loads.grows() else Question.STANDS
    mechanism, stress = _Mechanism(above, copy), _Stress(below, copy, question)
    upper, lower = 0, 1  # the ranks of the two searches
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
    """The part of the upper bound."""

    flow: FlowProblem | None = None
    found: LimitLoad | None = None

    def __init__(self, problem: Problem, copy: WholeMesh) -> None:
        self._problem, self._copy = problem, copy

    def prepare(self, _: ExitStack) -> None:
        """Create the problem on the copy."""
        self.flow = flow_problem(self._problem.on(self._copy))
        self._strict = with_strict_contact(self.flow.problem)

    def find(self, rtol: float, steps: Steps) -> None:
        """Compute the mechanism."""
        self.found = interior_point(self._strict, rtol, steps)


class _Stress:
    """The part of the lower bound."""

    found: StaticBound | None = None

    def __init__(self, problem: Problem, copy: WholeMesh, question: Question) -> None:
        self._problem, self._copy, self._question = problem, copy, question

    def prepare(self, made: ExitStack) -> None:
        """Create the problem on the copy, and check that it fits into memory."""
        self._on = self._problem.on(self._copy)
        self._form = form_that_fits(self._on)
        if self._form is not None:
            made.callback(self._form.destroy)

    def find(self, rtol: float, steps: Steps) -> None:
        """Compute the stress."""
        self.found = bound_by_stress(self._on, rtol, steps, self._question, self._form)
