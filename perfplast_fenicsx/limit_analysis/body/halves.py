"""Compute both bounds in parallel on two ranks, each bound on its rank's own copy of the mesh.

Factorisations dominate the cost of a bound, and two ranks factorise hardly faster than one.
Therefore each rank computes one bound, and waits for the other rank only when steps are reported.
The module then transfers the results to the mesh that both ranks share
(benchmarks/halves_at_once.py measures the saving).
"""

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

from mpi4py import MPI

import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.limit_analysis.body.bound_problems import (
    FlowProblem,
    by_cells,
    flow_problem,
    is_straight,
    of_parts,
)
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.facets.entering import with_strict_contact
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import (
    StaticBound,
    bound_by_stress,
    form_that_fits,
)
from perfplast_fenicsx.machine_memory import spare_memory
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.mesh.whole_mesh import WholeMesh, to_owners, whole_mesh
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge

log = logging.getLogger(__name__)


class Meeting:
    """Synchronise all ranks after each step of any rank; ranks that have finished wait."""

    def __init__(self, comm: MPI.Intracomm, monitor: Callable[[InteriorStep], None] | None) -> None:
        """Start the synchronisation of these ranks.

        Args:
            comm: The ranks.
            monitor: Called on every rank after each step of any rank.
        """
        self._comm, self._monitor = comm, monitor
        self.monitor = None if monitor is None else self._tell
        """Called after each step of this rank; other ranks receive the step when they synchronise.
        """

    def after(self, work: Callable[[], None]) -> bool:
        """Do this rank's work, which must not be collective, and wait for the work of all ranks.

        Collective.

        Returns:
            Whether the work is done; False if the work of any rank does not fit into memory.

        Raises:
            InputError: On all ranks, if the work of any rank raises it.
            StopSearch: On all ranks, whether they work or wait, if the monitor raises it.
        """
        fault, fits = None, True
        try:
            work()
        except TooLarge:
            fits = False
        except InputError as error:
            fault = str(error)
        while self._meet(None):
            pass
        raise_together(self._comm, fault)
        return self._comm.allreduce(fits, MPI.LAND)

    def _tell(self, step: InteriorStep) -> None:
        """Report a step of this rank, and receive the steps of other ranks."""
        self._meet(step)

    def _meet(self, step: InteriorStep | None) -> bool:
        """Report a step, or None at the end of the work; return whether any rank still works."""
        told = [it for it in self._comm.allgather(step) if it is not None]
        if self._monitor is not None:
            for it in told:
                self._monitor(it)
        return bool(told)


@dataclass(frozen=True)
class Copied:
    """A mesh that the ranks share, and this rank's copy of the whole mesh."""

    shared: TaggedMesh
    copy: WholeMesh

    def limit(
        self, root: int, flow: FlowProblem, own: FlowProblem | None, found: LimitLoad | None
    ) -> LimitLoad | None:
        """Return a limit load on the shared mesh, with mechanism and stress but no contact forces.

        Collective.

        Args:
            root: The rank with the result.
            flow: The flow problem on the shared mesh.
            own: The flow problem on the copy; only the root uses it.
            found: The result on the root; ignored on other ranks.

        Returns:
            The same result on every rank; None if nothing was found.
        """
        told, rows = None, dict[str, npt.NDArray]()
        if self._comm.rank == root and own is not None and found is not None:
            fields = {"mechanism": found.mechanism, "stress": found.stress}
            rows = {name: _rows(it, own) for name, it in fields.items() if it is not None}
            told = vars(found) | dict.fromkeys((*fields, "contact_forces"))
        told = self._comm.bcast(told, root)
        if told is None:
            return None
        rows = to_owners(self.shared, self.copy, root, rows)
        problem = flow.problem
        spaces = {"mechanism": problem.V, "stress": problem.S}
        fields = {name: _function(flow, spaces[name], name, it) for name, it in rows.items()}
        return LimitLoad(**(told | fields))

    def stress(self, root: int, found: StaticBound | None) -> StaticBound:
        """Return a lower bound with its stress on the shared mesh. Collective.

        Args:
            root: The rank with the result.
            found: The result on the root; ignored on other ranks.
        """
        told, rows = dict[str, Any](), dict[str, npt.NDArray]()
        if self._comm.rank == root and found is not None:
            rows = {"stress": found.stress, "dissipation": found.dissipation}
            told = vars(found) | dict.fromkeys(rows)
        told = self._comm.bcast(told, root)
        return StaticBound(**(told | to_owners(self.shared, self.copy, root, rows)))

    @property
    def _comm(self) -> MPI.Intracomm:
        return self.shared.mesh.comm


def _rows(function: fem.Function, own: FlowProblem) -> Floats:
    """Return the values of a function at the nodes of each cell, or of each part of split cells."""
    dofmap = function.function_space.dofmap
    values: Floats = function.x.array.reshape(-1, dofmap.index_map_bs)[dofmap.list]
    return values if own.split is None else by_cells(values, own.split)


def _function(
    flow: FlowProblem, space: fem.FunctionSpace, name: str, rows: npt.NDArray
) -> fem.Function:
    """Return a function with the given values. Collective."""
    function, dofmap = fem.Function(space, name=name), space.dofmap
    values = rows if flow.split is None else of_parts(rows, flow.split)
    function.x.array.reshape(-1, dofmap.index_map_bs)[dofmap.list[: len(values)]] = values
    function.x.scatter_forward()
    return function


Steps = Callable[[InteriorStep], None] | None


@dataclass(frozen=True)
class Halves:
    """The results of both ranks, on the mesh that they share.

    Attributes:
        flow: Flow problem of the mechanism.
        limit: Limit load with the mechanism, as :func:`discrete_limit.interior_point` returns it.
        static: The lower bound with its stress.
        question: The loads that the lower bound multiplies.
    """

    flow: FlowProblem
    limit: LimitLoad
    static: StaticBound
    question: Question


def pays(below: Problem, above: Problem) -> bool:
    """Return whether computing both bounds in parallel is faster and fits into memory. Collective.

    The limits were measured with benchmarks/halves_at_once.py.
    """
    comm, dim = below.comm, below.bodies.gdim
    cells = below.tagged_mesh.mesh.topology.index_map(dim).size_global
    # With fewer cells, a bound takes less than a second in any case. With more cells, joint
    # factorisations on both ranks are faster, or the times were not measured.
    few, many = ((1_000, 100_000), (250, 10_000))[dim - 2]
    of_a_cell = (25e3, 250e3)[
        dim - 2
    ]  # bytes per cell for each bound; at most 17 and 230 kB were measured
    ranks = 2
    if comm.size != ranks or not few <= cells <= many or not is_straight(above):
        return False
    if not (below.as_declared and above.as_declared):
        return False
    return of_a_cell * cells <= 1e6 * spare_memory(comm)


def halves_at_once(below: Problem, above: Problem, rtol: float, monitor: Steps) -> Halves | None:
    """Return the stress of one problem and the mechanism of another, each from one rank.

    Collective.

    Args:
        below: The bodies of the lower bound.
        above: The bodies of the upper bound, on the same mesh.
        rtol: Largest relative distance of each bound from the best bound of its kind on this mesh.
        monitor: Called on both ranks after each step of either rank.

    Returns:
        The results; None if the work of a rank does not fit into memory.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`, on both ranks.
        StopSearch: From the monitor, with the limit load that is known so far.
    """
    comm, shared = below.comm, below.tagged_mesh
    copy, meeting = whole_mesh(shared), Meeting(below.comm, monitor)
    log.info(
        "both bounds run in parallel, each on one rank; of two steps, that of the upper bound is "
        "reported first"
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
    """The search for the upper bound, on one rank."""

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
    """The search for the lower bound, on one rank."""

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
