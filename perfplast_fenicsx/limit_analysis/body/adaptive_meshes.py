"""Bounds of the limit load on meshes that are refined where the bounds say.

The difference of both bounds is the sum of shares of the cells, none below zero, and shows where
the mechanism is poor; the dissipation of the lower bound's multipliers shows where the stress is.
Cells that have most of either are refined. M. Ciria, J. Peraire and J. Bonet, doi:10.1002/nme.2310.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.surfaces.opposite_vertices import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.bare_cells import with_room_for_stress
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.body.marking import largest_shares, to_refine
from perfplast_fenicsx.limit_analysis.body.singular_edges import singular_edges
from perfplast_fenicsx.limit_analysis.body.singular_points import singular_points
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.mesh.crossing_edges import bend_crossings
from perfplast_fenicsx.mesh.refinement import fan, fan_around, refine
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import fetch_rows
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.mumps_memory import TooLarge


@dataclass(frozen=True)
class Round:
    """Bounds on one mesh.

    Attributes:
        number: From 1.
        cells: Of the mesh.
        lower: The lower bound found on it; None where there is none.
        upper: The upper bound.
        gap: What the best upper bound so far exceeds the best lower one by, relative; None where
            one of them is missing.
        seconds: Wall time so far.
    """

    number: int
    cells: int
    lower: float | None
    upper: float | None
    gap: float | None
    seconds: float


@dataclass(frozen=True)
class AdaptiveBounds:
    """Bounds on a sequence of meshes.

    Attributes:
        low: What was found on the mesh with the best lower bound.
        high: What was found on the mesh with the best upper bound.
        last: What was found on the last mesh.
        problem: On the last mesh; in space its cells are not split.
        sources: The same on the meshes of ``low`` and ``high``.
        rounds: All meshes.
        reason: Why it is the last one.
    """

    low: BodyBounds
    high: BodyBounds
    last: BodyBounds
    problem: Problem
    sources: tuple[Problem, Problem]
    rounds: list[Round]
    reason: str

    @property
    def lower(self) -> Bound:
        """The best lower bound of all meshes."""
        return self.low.lower

    @property
    def upper(self) -> Bound:
        """The best upper bound of all meshes."""
        return self.high.upper

    @property
    def best(self) -> BodyBounds:
        """What was found on the mesh of the best bounds.

        Where the lower one is of another mesh than the upper one, that of the two whose own bounds
        are nearer to each other.
        """
        gaps = [it.lower.apart(it.upper) for it in (self.low, self.high)]
        low, high = (np.inf if gap is None else gap for gap in gaps)
        return self.low if low < high else self.high

    @property
    def body(self) -> BodyBounds:
        """What was found on the mesh of the best bounds, with these in place of its own."""
        certificates = dict(self.low.certificates)
        certificates |= {k: v for k, v in self.high.certificates.items() if k == "inadmissible"}
        return replace(
            self.best,
            lower=self.lower,
            upper=self.upper,
            static=self.low.static,
            certificates=certificates,
            advice=self.high.advice,
        )

    def __repr__(self) -> str:
        return (
            f"AdaptiveBounds({self.lower!r}, {self.upper!r}; {len(self.rounds)} meshes;"
            f" {self.reason})"
        )


def adaptive_bounds(
    problem: Problem,
    adaptation: Adaptation | None = None,
    rtol: float = 1e-4,
    monitor: Callable[[Round], None] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
    design: float | None = None,
) -> AdaptiveBounds:
    """Bound the limit load on finer and finer meshes, as far as memory goes. Collective.

    Args:
        problem: The bodies and their loads, on the first mesh.
        adaptation: When to end.
        rtol: How near each bound comes to the best of its kind on its mesh, relative.
        monitor: Called on every rank after each mesh.
        steps: Called on every rank after each step of the interior point method.
        design: Load factor of the design load, for the end where that is decided.

    Raises:
        InputError: If the mesh cannot be adapted, there is no design load to decide on, and for
            what :func:`limit_bounds.limit_bounds` refuses.
    """
    adaptation = adaptation or Adaptation()
    adaptation.check(problem.tagged_mesh)
    adaptation.check_design(design)
    problem = with_room_for_stress(problem)
    began, rounds = time.perf_counter(), list[Round]()
    found = limit_bounds(problem, rtol, steps)
    low = high = found
    of_low = of_high = problem
    try:
        while True:
            gap = low.lower.apart(high.upper)
            round_ = Round(
                number=len(rounds) + 1,
                cells=_count(problem.tagged_mesh),
                lower=found.lower.value,
                upper=found.upper.value,
                gap=gap,
                seconds=time.perf_counter() - began,
            )
            rounds.append(round_)
            if monitor is not None:
                monitor(round_)
            # where constant loads are what is bounded, it is whether they are carried once
            stands = 1.0 if low.question is Question.STANDS else None
            if ends := adaptation.ends(low.lower, high.upper, stands or design):
                reason = ends
                break
            finer = _finer(problem, found, adaptation.cells)
            if isinstance(finer, str):
                reason = finer
                break
            finer_problem = problem.on(finer)
            try:
                found = limit_bounds(finer_problem, rtol, steps)
            except TooLarge as fault:
                reason = f"the next mesh has {_count(finer)} cells: {fault}"
                break
            problem = finer_problem
            other = found.question is not low.question  # bounds of other loads are no better ones
            if other or found.lower.improves(low.lower):
                low, of_low = found, problem
            if other or found.upper.improves(high.upper):
                high, of_high = found, problem
    except StopSearch as stop:
        reason = "the search on the next mesh was interrupted"
        of_both = (of_low, of_high)
        stop.adapted = AdaptiveBounds(low, high, found, problem, of_both, rounds, reason)
        raise
    return AdaptiveBounds(low, high, found, problem, (of_low, of_high), rounds, reason)


def _count(tagged_mesh: TaggedMesh) -> int:
    topology = tagged_mesh.mesh.topology
    count: int = topology.index_map(topology.dim).size_global
    return count


def _finer(problem: Problem, found: BodyBounds, cells: int) -> TaggedMesh | str:
    """The next mesh, or why there is none. Collective.

    Where it would have too many cells, as many are marked as fit. A mesh that has hardly more
    cells than this one would cost as much and find little new: in the plane a twelfth more, where
    they matter most, is worth a fifth of the gap.
    """
    halvings = 5
    # Dörfler's fraction by dimension: the marked cells carry this share of the gap, and of the
    # dissipation. Smaller in space, where closing the refinement divides many more cells.
    part, worth_while = {2: (0.4, 1.05), 3: (0.2, 1.2)}[problem.bodies.gdim]
    now, too_many = _count(problem.tagged_mesh), f"a finer mesh would have more than {cells} cells"
    if now >= cells:
        return too_many
    if found.static is not None and found.static.verdict is Verdict.NO_RESISTANCE:
        part = 1.0  # what carries nothing has no shares: cells are too large anywhere
    marked = to_refine(problem, found, part)
    if not problem.comm.allreduce(int(marked.sum())):
        return "nothing was found that says where to refine"
    largest = refined(problem, marked, found)
    fits, exceeds = 0.0, part
    if _count(largest) > cells:
        for _ in range(halvings):
            part = (fits + exceeds) / 2
            finer = refined(problem, to_refine(problem, found, part), found)
            if _count(finer) > cells:
                exceeds = part
            else:
                fits, largest = part, finer
        if not worth_while * now <= _count(largest) <= cells:
            return too_many
    return largest


def refined(
    problem: Problem, marked: npt.NDArray[np.bool_], found: BodyBounds | None = None
) -> TaggedMesh:
    """The mesh of a problem, finer where it is marked, with fans where it needs them. Collective.

    Args:
        problem: The bodies with their loads.
        marked: Of the cells that this rank owns.
        found: Bounds on the mesh. In space cells at singular edges, where the lower one loses most,
            are made fans in place of being refined: what it loses there is for want of directions.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    in_space = problem.bodies.gdim == 3
    if in_space and found is not None and found.static is not None:
        tagged_mesh, marked = _with_fans(problem, marked, found.static.dissipation)
    pairs = opposite_vertices(tagged_mesh, given.contacts)
    finer = refine(tagged_mesh, marked, pairs).tagged_mesh
    if in_space:
        return finer
    valence = 24  # cells that meet at least where the stress depends on the direction, in the end
    points = singular_points(finer, given, valence)
    if problem.comm.allreduce(len(points)):
        finer = fan(finer, points, opposite_vertices(finer, given.contacts)).tagged_mesh
    bend_crossings(finer)
    return finer


def _with_fans(
    problem: Problem, marked: npt.NDArray[np.bool_], dissipation: Floats
) -> tuple[TaggedMesh, npt.NDArray[np.bool_]]:
    """A mesh in space with fans at those of the marked cells that want them. Collective.

    Returns:
        The mesh, and which of its owned cells are still marked.
    """
    comm, given, tagged_mesh = problem.comm, problem.given, problem.tagged_mesh
    most = 0.5  # of the dissipation of the multipliers, which often is that of a few cells,
    nearly = 0.5  # and of theirs, which has to be at such edges: else size matters as well
    valence = 12  # around edges; each costs as many cells as the edge has
    few = largest_shares(comm, dissipation, most)
    edges = singular_edges(tagged_mesh, given, valence) & few[:, None]
    cut = edges.any(axis=1)
    at_edges, of_few = comm.allreduce(np.array([dissipation[cut].sum(), dissipation[few].sum()]))
    if not at_edges > nearly * of_few:
        return tagged_mesh, marked
    fans = fan_around(tagged_mesh, edges, opposite_vertices(tagged_mesh, given.contacts))
    return fans.tagged_mesh, fetch_rows(comm, marked & ~cut, fans.parents)
